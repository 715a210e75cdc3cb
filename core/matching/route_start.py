"""Where the route search may begin: from a prior pose, or from nothing at all.

From nothing: coarse bins are searched from a moment at which the drive turns much, only until few hypotheses survive. From
what survives, 1 m bins are searched backwards in time to the drive's beginning.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hippodrome.core.matching import route_kernel
from hippodrome.core.matching.lane_graph import LaneGraph, build_lane_graph, mirrored, reversed_network
from hippodrome.core.matching.search_config import RouteSearchConfig, SearchCosts
from hippodrome.core.matching.search_field import SearchField, Seeds, kernel_arguments
from hippodrome.core.matching.track import Track
from hippodrome.core.se2 import wrap
from hippodrome.core.types import Float32Array, IntArray, StartPose

_HORIZON = 60  # steps (300 m) over which an anchor's turns are counted: about what a start needs in order to be unique
_NO_PLACES = np.empty((0, 2), np.float32), np.empty(0, np.float32)


def anchors(track: Track, most: int) -> list[int]:
    """Samples to begin at, those with the most turning ahead first, at least a horizon apart."""
    turning = np.abs(np.diff(track.heading_rad, append=track.heading_rad[-1]))
    total = np.concatenate([[0.0], np.cumsum(np.minimum(turning, 0.5))])  # a turn is a turn: U-turns do not count more
    last = np.minimum(np.arange(len(turning)) + _HORIZON, len(turning))
    ahead = total[last] - total[:-1]
    chosen: list[int] = []
    for t in np.argsort(-ahead, kind="stable").tolist():
        if all(abs(t - other) >= _HORIZON for other in chosen):
            chosen.append(t)
        if len(chosen) == most:
            break
    return chosen


def starts_from(field: SearchField, anchor: int, config: RouteSearchConfig) -> Seeds:
    """Hypotheses at the drive's beginning that lead to the good ones at sample ``anchor``."""
    seeds = _everywhere(field.graph, len(field.log_scale), float(field.track.heading_rad[anchor]))
    promising = _promising(field, anchor, config)
    seeds = (*(column[promising] for column in seeds[:5]), *_NO_PLACES)
    return seeds if anchor == 0 else _traced_back(field, anchor, seeds, config)


def prior_starts(field: SearchField, start: StartPose, config: RouteSearchConfig) -> Seeds:
    """Hypotheses near a start pose, at every scale; one at the pose itself, should it lie off the network."""
    scales = len(field.log_scale)
    bins, k, _, offset, rest, _, _ = _everywhere(field.graph, scales, float(field.track.heading_rad[0]))
    score = np.repeat(_prior_nats(field.graph, start), scales)
    near = score >= score.max() - config.beam_nats
    off_offset = float(wrap(np.array(start.heading_rad - field.track.heading_rad[0])))
    away = np.full(scales, start.sigma_m / config.off_network.drift, np.float32)  # driven metres that would leave as much doubt
    return (
        np.concatenate([bins[near], -1 - np.arange(scales, dtype=np.int32)]),
        np.concatenate([k[near], np.arange(scales, dtype=np.uint8)]),
        np.concatenate([score[near], np.full(scales, -config.off_network.leave_nats, np.float32)]),
        np.concatenate([offset[near], np.full(scales, off_offset, np.float32)]),
        np.concatenate([rest[near], np.zeros(scales, np.float32)]),
        np.tile(np.array([[start.x_m, start.y_m]], np.float32), (scales, 1)),
        away,
    )


def _everywhere(graph: LaneGraph, scales: int, heading_rad: float) -> Seeds:
    """Every (bin, scale bin) as a hypothesis, bin-major."""
    bins = np.repeat(np.arange(graph.bin_count, dtype=np.int32), scales)
    k = np.tile(np.arange(scales, dtype=np.uint8), graph.bin_count)
    offset = wrap(graph.heading_rad[bins].astype(np.float64) - heading_rad).astype(np.float32)
    return bins, k, np.zeros(len(bins), np.float32), offset, np.zeros(len(bins), np.float32), *_NO_PLACES


def _prior_nats(graph: LaneGraph, start: StartPose) -> Float32Array:
    """Log prior (N,) of beginning in each bin."""
    away = np.hypot(graph.points_m[:, 0] - start.x_m, graph.points_m[:, 1] - start.y_m) / start.sigma_m
    turned = wrap(graph.heading_rad.astype(np.float64) - start.heading_rad) / start.sigma_rad
    return (-0.5 * (away**2 + turned**2)).astype(np.float32)


def _promising(field: SearchField, anchor: int, config: RouteSearchConfig) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Which (fine bin, scale bin) lie in a coarse cell from which a good coarse route leads on."""
    many = config.coarse
    log_scale = field.log_scale[many // 2 :: many]
    step = 2.0 * field.track.step  # coarse bins need longer steps, to be moved by more than a bin
    coarse = replace(
        field,
        track=replace(field.track, step=step),
        log_scale=log_scale,
        graph=build_lane_graph(
            field.network, step * float(np.exp(log_scale[-1])) + 4.0 * many * config.bin_m, many * config.bin_m
        ),
        costs=_coarse_costs(config),
        off_network=replace(config.off_network, leave_nats=1e9),  # a search for the start has nowhere to leave from
        bin_m=many * config.bin_m,
    )
    arguments = kernel_arguments(coarse, field.track.heading_rad[anchor::2])
    starts = _everywhere(coarse.graph, len(log_scale), float(field.track.heading_rad[anchor]))
    limit = 40 * config.most_survivors
    survivors = route_kernel.forward(*arguments, config.coarse_beam_nats, limit, config.coarse_enough, starts)
    through = route_kernel.backward(*arguments, config.margin_nats, survivors)[: len(starts[0])]
    good = (through >= through.max() - config.seed_margin_nats).reshape(coarse.graph.bin_count, len(log_scale))
    cell = coarse.graph.lane_start[field.graph.lane] + _share_of_lane(field.graph, coarse.graph)
    scale_cell = np.minimum(np.arange(len(field.log_scale)) // many, len(log_scale) - 1)
    promising: np.ndarray[tuple[int], np.dtype[np.bool_]] = good[cell][:, scale_cell].ravel()
    return promising


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


def _traced_back(field: SearchField, anchor: int, seeds: Seeds, config: RouteSearchConfig) -> Seeds:
    """Hypotheses at the drive's beginning, from those at ``anchor``: the search run against time, on lanes driven backwards."""
    network = reversed_network(field.network)
    backwards = replace(field, network=network, graph=build_lane_graph(network, field.graph.reach_limit_m, field.bin_m))
    heading = field.track.heading_rad[anchor::-1] + np.pi
    arguments = kernel_arguments(backwards, heading)
    bins, k, score, offset, rest, place, away = seeds
    turned = (mirrored(field.graph, bins), k, score, offset, -rest, place, away)
    row_start, bins, k, _, score, offset, rest, place, away = route_kernel.forward(
        *arguments, config.beam_nats, config.most_survivors, 0, turned
    )
    last = slice(row_start[-2], row_start[-1])
    good = score[last] >= score[last].max() - config.seed_margin_nats
    return (
        mirrored(field.graph, bins[last][good]), k[last][good], np.zeros(int(good.sum()), np.float32), offset[last][good],
        -rest[last][good], place, away,
    )  # fmt: skip
