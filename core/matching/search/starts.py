"""Where the route search may begin: from a prior pose, or from nothing at all.

From nothing: hypotheses everywhere, in coarse bins, are searched over a short stretch of the drive that begins with a turn. What
explains it is searched again in fine bins, and what explains it still is traced backwards in time to the drive's beginning.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hippodrome.core.matching.search import beam as route_kernel
from hippodrome.core.matching.search.config import RouteSearchConfig, SearchCosts
from hippodrome.core.matching.search.hypotheses import (
    NOWHERE,
    OFF,
    ROW,
    Rows,
)
from hippodrome.core.matching.search.passes import last_of, survivors_from
from hippodrome.core.matching.search.problem import SearchField, Seeds, kernel_arguments
from hippodrome.core.matching.search.track import Track
from hippodrome.core.roads.lane_graph import (
    LaneGraph,
    build_lane_graph,
    mirrored,
    reversed_network,
)
from hippodrome.core.se2 import wrap
from hippodrome.core.types import Float32Array, IntArray, StartPose

_HORIZON = 60  # steps (300 m) over which an anchor's turns are counted: about what a start needs in order to be unique
_MOST_STARTS = 1_000_000  # hypotheses a step while searching for the start: a large town in coarse bins
_NO_PLACES = np.empty(0, OFF)


def anchors(track: Track, most: int) -> list[int]:
    """Samples to begin at, at least a horizon apart, those with the most turning ahead first; soon counts more than late."""
    turning = np.minimum(np.abs(np.diff(track.heading_rad, append=track.heading_rad[-1])), 0.5)  # U-turns do not count more
    soon = 1.0 - np.arange(_HORIZON) / _HORIZON
    ahead = np.correlate(np.concatenate([turning, np.zeros(_HORIZON - 1)]), soon, "valid")
    chosen: list[int] = []
    for t in np.argsort(-ahead, kind="stable").tolist():
        if all(abs(t - other) >= _HORIZON for other in chosen):
            chosen.append(t)
        if len(chosen) == most:
            break
    return chosen


def starts_from(field: SearchField, anchor: int, config: RouteSearchConfig) -> Seeds:
    """Hypotheses at the drive's beginning that lead to the good ones at sample ``anchor``."""
    nats, scales = _coarse_nats(field, anchor, config), len(field.log_scale)
    bins = np.flatnonzero(nats.max(axis=1) > NOWHERE).astype(np.int32)
    rows = _hypotheses(field.graph, bins, scales, float(field.track.heading_rad[anchor]))
    rows["score"] = nats[bins].ravel()
    rows = rows[rows["score"] > NOWHERE]
    return Seeds(rows, _NO_PLACES) if anchor == 0 else _traced_back(field, anchor, rows, config)


def prior_starts(field: SearchField, start: StartPose, config: RouteSearchConfig) -> Seeds:
    """Hypotheses near a start pose, at every scale; one at the pose itself, should it lie off the network."""
    scales = len(field.log_scale)
    prior = _prior_nats(field.graph, start)
    near = np.flatnonzero(prior >= prior.max() - config.beam_nats).astype(np.int32)
    rows = _hypotheses(field.graph, near, scales, float(field.track.heading_rad[0]))
    rows["score"] = np.repeat(prior[near], scales)
    off, places = np.zeros(scales, ROW), np.zeros(scales, OFF)
    off["bin"], off["k"], off["score"] = -1 - np.arange(scales), np.arange(scales), -config.off_network.leave_nats
    off["offset"] = float(wrap(np.array(start.heading_rad - field.track.heading_rad[0])))
    places["x"], places["y"] = start.x_m, start.y_m
    places["away"] = start.sigma_m / config.off_network.drift  # driven metres that would leave as much doubt
    return Seeds(np.concatenate([rows, off]), places)


def _hypotheses(graph: LaneGraph, bins: IntArray, scales: int, heading_rad: float) -> Rows:
    """Every scale bin in each of some bins, bin-major."""
    rows = np.zeros(len(bins) * scales, ROW)
    rows["bin"] = np.repeat(bins, scales)
    rows["k"] = np.tile(np.arange(scales, dtype=np.int32), len(bins))
    rows["offset"] = np.repeat(wrap(graph.heading_rad[bins].astype(np.float64) - heading_rad), scales)
    return rows


def _prior_nats(graph: LaneGraph, start: StartPose) -> Float32Array:
    """Log prior (N,) of beginning in each bin."""
    away = np.hypot(graph.points_m[:, 0] - start.x_m, graph.points_m[:, 1] - start.y_m) / start.sigma_m
    turned = wrap(graph.heading_rad.astype(np.float64) - start.heading_rad) / start.sigma_rad
    return (-0.5 * (away**2 + turned**2)).astype(np.float32)


def _coarse_nats(field: SearchField, anchor: int, config: RouteSearchConfig) -> Float32Array:
    """For each fine bin and scale bin (N, K), how far the best route on from its coarse cell falls behind the best of all."""
    many = config.coarse
    log_scale = field.log_scale[many // 2 :: many]
    step = 2.0 * field.track.step  # coarse bins need longer steps, to be moved by more than a bin
    reach_m = step * float(np.exp(log_scale[-1])) + 4.0 * many * config.bin_m
    coarse = replace(
        field,
        track=replace(field.track, step=step),
        log_scale=log_scale,
        graph=build_lane_graph(field.network, reach_m, many * config.bin_m),
        costs=_coarse_costs(config),
        off_network=replace(config.off_network, leave_nats=1e9),  # a search for the start has nowhere to leave from
        bin_m=many * config.bin_m,
    )
    arguments = kernel_arguments(coarse, field.track.heading_rad[anchor::2])
    everywhere = np.arange(coarse.graph.bin_count, dtype=np.int32)
    starts = _hypotheses(coarse.graph, everywhere, len(log_scale), float(field.track.heading_rad[anchor]))
    beam_nats, enough = config.coarse_beam_nats, config.coarse_enough
    survivors = survivors_from(arguments, Seeds(starts, _NO_PLACES), beam_nats, _MOST_STARTS, enough)
    nothing = np.zeros(survivors[0][-1] - survivors[0][-2], np.float32)
    through = route_kernel.backward(*arguments, config.seed_margin_nats, survivors, nothing)[: len(starts)]
    cell = coarse.graph.lane_start[field.graph.lane] + _share_of_lane(field.graph, coarse.graph)
    scale_cell = np.minimum(np.arange(len(field.log_scale)) // many, len(log_scale) - 1)
    nats: Float32Array = through.reshape(coarse.graph.bin_count, len(log_scale))[cell][:, scale_cell]
    return nats


def _coarse_costs(config: RouteSearchConfig) -> SearchCosts:
    """Looser, because neither bin nor scale bin fits: what counts is that the true start is not lost."""
    return replace(
        config.costs, heading_sigma_rad=0.2, heading_limit_nats=5.0, offset_gain=0.1, length_sigma_m=1.5, scale_step_nats=2.0
    )


def _share_of_lane(fine: LaneGraph, coarse: LaneGraph) -> IntArray:
    """For each fine bin, which coarse bin of its lane it lies in."""
    counts = np.diff(fine.lane_start)[fine.lane]
    order = np.arange(fine.bin_count) - fine.lane_start[fine.lane]
    return ((order + 0.5) / counts * np.diff(coarse.lane_start)[fine.lane]).astype(np.int32)


def _traced_back(field: SearchField, anchor: int, rows: Rows, config: RouteSearchConfig) -> Seeds:
    """Hypotheses at the drive's beginning, from those at ``anchor``: the search run against time, on lanes driven backwards."""
    network = reversed_network(field.network)
    backwards = replace(field, network=network, graph=build_lane_graph(network, field.graph.reach_limit_m, field.bin_m))
    arguments = kernel_arguments(backwards, field.track.heading_rad[anchor::-1] + np.pi)
    turned = Seeds(_reversed(field.graph, rows), _NO_PLACES)
    first, places = last_of(survivors_from(arguments, turned, config.beam_nats, config.most_survivors))
    first = _reversed(field.graph, first[first["score"] >= first["score"].max() - config.seed_margin_nats])
    first["score"] = 0.0  # the whole drive decides
    return Seeds(first, places)


def _reversed(graph: LaneGraph, rows: Rows) -> Rows:
    """The same hypotheses with time running the other way."""
    turned = rows.copy()
    turned["bin"], turned["rest"] = mirrored(graph, rows["bin"]), -rows["rest"]
    return turned
