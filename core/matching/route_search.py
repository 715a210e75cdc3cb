"""Route search: a hidden Markov model over (position on the lane graph) x (log scale), with unknown start and scale.

It sees the raw motions only, so false loop closures cannot hurt it. ``route_start`` tells how an unknown start is found; from
there, 1 m bins are searched over the whole drive.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hippodrome.core.matching import route_kernel
from hippodrome.core.matching.route_start import anchors, prior_starts, starts_from
from hippodrome.core.matching.search_config import RouteSearchConfig
from hippodrome.core.matching.search_field import SearchField, Seeds, kernel_arguments, search_field
from hippodrome.core.matching.track import Track
from hippodrome.core.road_network import RoadNetwork
from hippodrome.core.types import Float32Array, FloatArray, HippodromeError, IntArray, StartPose, Visits

_STRETCH = 24  # steps (120 m): single corners must not decide


@dataclass(frozen=True, slots=True, eq=False)
class RouteAlternatives:
    """All surviving hypotheses: sample ``t`` of the track owns rows ``row_start[t]:row_start[t + 1]``."""

    row_start: np.ndarray[tuple[int], np.dtype[np.int64]]  # (T + 1,)
    points_m: FloatArray  # (rows, 2)
    through_nats: Float32Array  # (rows,) score of the best complete route through this hypothesis


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """The best route through T track samples, and what else was possible."""

    track: Track
    points_m: FloatArray  # (T, 2) on the lane, or dead-reckoned off the network
    lane: IntArray  # (T,) -1: off the network
    position_m: FloatArray  # (T,) arc length on the lane; nan off the network
    log_scale: FloatArray  # (T,) ln(metres per map unit)
    heading_offset_rad: FloatArray  # (T,) network heading minus odometry heading
    score_nats: FloatArray  # (T,) log likelihood of each step
    total_nats: float
    alternatives: RouteAlternatives

    def explained(self, limit_nats: float) -> bool:
        """Whether no stretch costs as much as driving off the network would."""
        width = min(_STRETCH, len(self.score_nats))
        stretches = np.convolve(self.score_nats, np.full(width, 1.0 / width), "valid")
        return bool(np.all(stretches > -limit_nats) and np.all(self.lane >= 0))


def search_route(visits: Visits, network: RoadNetwork, config: RouteSearchConfig, start: StartPose | None = None) -> Route:
    """The most likely drive through the network; ``start`` is only a prior on its first pose.

    Without one, the search begins where the drive turns most. Should the answer leave stretches unexplained, it begins elsewhere
    too (it may have begun on a road that the network lacks), and the answer that explains the whole drive best is kept.
    """
    field = search_field(visits, network, config)
    if start is not None:
        return best_route(field, prior_starts(field, start, config), config)
    routes: list[Route] = []
    for anchor in anchors(field.track, config.anchors):
        routes.append(best_route(field, starts_from(field, anchor, config), config))
        if routes[-1].explained(config.off_network.step_nats):
            break
    return max(routes, key=lambda route: route.total_nats)


def best_route(field: SearchField, seeds: Seeds, config: RouteSearchConfig, places: FloatArray | None = None) -> Route:
    """The most likely route from given starts; ``places`` (T, 3): x, y, 1/sigma^2 of what is known of the way."""
    arguments = kernel_arguments(field, field.track.heading_rad, places)
    survivors = route_kernel.forward(*arguments, config.beam_nats, config.most_survivors, 0, seeds)
    if len(survivors[0]) - 1 < len(field.track.arc):
        length_m = field.track.arc[-1] * np.exp(np.mean(field.log_scale))
        raise HippodromeError(
            f"cognitive map: no route of this network is about {length_m:.0f} m long; is it the one that was driven?"
        )
    return _as_route(field, survivors, route_kernel.backward(*arguments, config.margin_nats, survivors))


def _as_route(field: SearchField, survivors: tuple[Any, ...], through: Float32Array) -> Route:
    graph, track, log_scale = field.graph, field.track, field.log_scale
    row_start, bins, k, parent, score, offset, rest, places, _ = survivors
    row = np.empty(len(track.arc), dtype=np.int64)
    row[-1] = row_start[-2] + np.argmax(score[row_start[-2] :])
    for t in range(len(row) - 1, 0, -1):
        row[t - 1] = parent[row[t]]
    on_network = bins[row] >= 0
    at = np.maximum(bins[row], 0)
    lane = np.where(on_network, graph.lane[at], -1).astype(np.int32)
    position = np.clip(graph.position_m[at] + rest[row], 0.0, field.network.lane_lengths_m()[graph.lane[at]])
    points = graph.points_m[np.maximum(bins, 0)].astype(np.float32)
    points[bins < 0] = places[-1 - bins[bins < 0]]
    return Route(
        track=track,
        points_m=points[row].astype(np.float64),
        lane=lane,
        position_m=np.where(on_network, position, np.nan),
        log_scale=log_scale[k[row]],
        heading_offset_rad=offset[row].astype(np.float64),
        score_nats=np.diff(score[row].astype(np.float64), prepend=0.0),
        total_nats=float(score[row[-1]]),
        alternatives=RouteAlternatives(row_start, points, through),
    )
