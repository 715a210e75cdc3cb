"""Route search: a hidden Markov model over (position on the lane graph) x (log scale), with unknown start and scale.

It sees the raw motions only, so false loop closures cannot hurt it. ``route_start`` tells how an unknown start is found; from
there, 1 m bins are searched over the whole drive.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hippodrome.core.matching.search.config import RouteSearchConfig
from hippodrome.core.matching.search.passes import best_through
from hippodrome.core.matching.search.problem import (
    SearchField,
    Seeds,
    kernel_arguments,
    search_field,
)
from hippodrome.core.matching.search.starts import anchors, prior_starts, starts_from
from hippodrome.core.matching.search.track import Track
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import Float32Array, FloatArray, HippodromeError, IntArray, StartPose, Visits

_STRETCH = 24  # steps (120 m): single corners must not decide


@dataclass(frozen=True, slots=True, eq=False)
class RouteAlternatives:
    """Other places at each moment: sample ``t`` of the track owns rows ``row_start[t]:row_start[t + 1]``."""

    row_start: NDArray[np.int64]  # (T + 1,)
    points_m: Float32Array  # (rows, 2)
    through_nats: Float32Array  # (rows,) score of the best complete route through this place, less that of the best of all


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
    found = best_through(field, kernel_arguments(field, field.track.heading_rad, places), seeds, config)
    if found is None:
        length_m = field.track.arc[-1] * np.exp(np.mean(field.log_scale))
        raise HippodromeError(
            f"cognitive map: no route of this network is about {length_m:.0f} m long; is it the one that was driven?"
        )
    graph, rows = field.graph, found.rows
    on_network, at = rows["bin"] >= 0, np.maximum(rows["bin"], 0)
    position = np.clip(graph.position_m[at] + rows["rest"], 0.0, field.network.lane_lengths_m()[graph.lane[at]])
    return Route(
        track=field.track,
        points_m=found.places_m,
        lane=np.where(on_network, graph.lane[at], -1).astype(np.int32),
        position_m=np.where(on_network, position, np.nan),
        log_scale=field.log_scale[rows["k"]],
        heading_offset_rad=rows["offset"].astype(np.float64),
        score_nats=np.diff(found.score_nats, prepend=0.0),
        total_nats=float(found.score_nats[-1]),
        alternatives=RouteAlternatives(found.row_start, found.points_m, found.through_nats),
    )
