"""Route search: a hidden Markov model over (position on the lane graph) x (log scale), with unknown start and scale.

Stage 1 searches coarse bins over the first stretch of the drive, only until few hypotheses survive, and keeps the starts
from which a good route leads on. Stage 2 searches 1 m bins from these starts over the whole drive. Both see raw motions
only, so false loop closures cannot hurt them.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hippodrome.core.matching import route_kernel
from hippodrome.core.matching.lane_graph import LaneGraph, bin_cells, build_lane_graph
from hippodrome.core.matching.track import Track, driven, make_track, scale_range
from hippodrome.core.road_network import RoadNetwork
from hippodrome.core.se2 import wrap
from hippodrome.core.types import Float32Array, FloatArray, HippodromeError, IntArray, StartPose, Visits


@dataclass(frozen=True, slots=True)
class SearchCosts:
    """Log likelihoods of one step. Defaults: 1 m bins and 5 m steps."""

    heading_sigma_rad: float = 0.12  # odometry against a lane's polyline, corners included
    heading_limit_nats: float = 6.0  # truncation: a few steps astray (lane change, kinked lanes) must not kill a route
    offset_gain: float = 0.05  # share of each heading error that the carried offset takes over: follows 1 rad of drift per km
    length_sigma_m: float = 0.4  # of a step, beyond what the carried rest absorbs: corners cut or swung out
    scale_step_nats: float = 3.0  # one bin of scale change in a step: about 1 in 20
    lane_change_nats: float = 5.0  # about 1 in 150 steps, once in 750 m


@dataclass(frozen=True, slots=True)
class OffNetworkCosts:
    """Driving where the network has no road, by dead reckoning."""

    leave_nats: float = 8.0  # rare: once in 15 km
    step_nats: float = 1.0  # a right route costs 0.1-0.3 a step, a wrong one 1 and more
    return_nats: float = 4.0
    drift: float = 0.05  # growth of the place's sigma per metre off the network: scale and heading drift
    turn_limit_rad: float = 0.5  # largest difference of heading at which a lane is taken up again
    spread_nats: float = 8.0  # hypotheses this far behind the best may leave the network


@dataclass(frozen=True, slots=True)
class RouteSearchConfig:
    bin_m: float = 1.0
    step_m: float = 5.0  # at the middle of the scale range
    scale_bin: float = 0.04  # of log scale
    beam_nats: float = 40.0
    most_survivors: int = 60_000  # bounds time and memory where a town is too self-similar for the beam to prune
    costs: SearchCosts = field(default_factory=SearchCosts)
    off_network: OffNetworkCosts = field(default_factory=OffNetworkCosts)
    coarse: int = 4  # coarse bins, of length and of scale, are this many fine bins
    coarse_beam_nats: float = 25.0
    coarse_enough: int = 1_000  # survivors at which stage 1 may stop
    seed_margin_nats: float = 20.0  # starts that score less than this below the best coarse route are searched finely
    margin_nats: float = 25.0  # alternatives up to this far behind the best route are looked for


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
    alternatives: RouteAlternatives


def search_route(visits: Visits, network: RoadNetwork, config: RouteSearchConfig, start: StartPose | None = None) -> Route:
    """The most likely drive through the network; ``start`` is only a prior on its first pose."""
    low, high = scale_range(visits, network)
    log_scale = np.arange(np.log(low), np.log(high) + config.scale_bin, config.scale_bin)
    step = min(config.step_m / np.sqrt(low * high), 0.25 * driven(visits)[-1])
    track = make_track(visits, step)
    fine = build_lane_graph(network, step * np.exp(log_scale[-1]) + 4.0 * config.bin_m, config.bin_m)
    seeds = _all_starts(fine, len(log_scale), track, start)
    if start is None:
        promising = _promising_starts(network, fine, track, log_scale, config)
        seeds = tuple(column[promising] for column in seeds)
    arguments = _kernel_arguments(track.heading_rad, step, log_scale, fine, config.costs, config.off_network, config.bin_m)
    survivors = route_kernel.forward(*arguments, config.beam_nats, config.most_survivors, 0, seeds)
    if len(survivors[0]) - 1 < len(track.arc):
        length_m = track.arc[-1] * np.exp(np.mean(log_scale))
        raise HippodromeError(
            f"cognitive map: no route of this network is about {length_m:.0f} m long; is it the one that was driven?"
        )
    through = route_kernel.backward(*arguments, config.margin_nats, survivors)
    return _best_route(fine, network.lane_lengths_m(), track, log_scale, survivors, through)


def _kernel_arguments(
    heading_rad: FloatArray,
    step: float,
    log_scale: FloatArray,
    graph: LaneGraph,
    costs: SearchCosts,
    off: OffNetworkCosts,
    bin_m: float,
) -> tuple[Any, ...]:
    """What both passes of the compiled search take, in its order."""
    tables = graph.reach_start, graph.reach_bin, graph.reach_m, graph.reach_changes, graph.heading_rad, graph.lane
    on_road = (
        costs.heading_sigma_rad, costs.heading_limit_nats, costs.offset_gain, 0.5 * bin_m, costs.length_sigma_m,
        costs.scale_step_nats, costs.lane_change_nats,
    )  # fmt: skip
    cells = bin_cells(graph)
    grid = graph.points_m, cells.start, cells.bin, cells.origin_m[0], cells.origin_m[1], cells.size_m, cells.columns, cells.rows
    off_road = off.return_nats, off.drift, off.turn_limit_rad, off.leave_nats, off.step_nats, off.spread_nats
    return np.ascontiguousarray(heading_rad), step, np.exp(log_scale), tables, on_road, (*grid, *off_road)


def _all_starts(graph: LaneGraph, scales: int, track: Track, start: StartPose | None) -> tuple[Any, ...]:
    """Every (bin, scale bin) as a hypothesis, bin-major: bin, scale bin, score, heading offset, rest."""
    bins = np.repeat(np.arange(graph.bin_count, dtype=np.int32), scales)
    k = np.tile(np.arange(scales, dtype=np.uint8), graph.bin_count)
    offset = wrap(graph.heading_rad[bins].astype(np.float64) - track.heading_rad[0]).astype(np.float32)
    score = np.zeros(len(bins), np.float32) if start is None else np.repeat(_prior_nats(graph, start), scales)
    return bins, k, score, offset, np.zeros(len(bins), np.float32)


def _prior_nats(graph: LaneGraph, start: StartPose) -> Float32Array:
    """Log prior (N,) of beginning in each bin."""
    away = np.hypot(graph.points_m[:, 0] - start.x_m, graph.points_m[:, 1] - start.y_m) / start.sigma_m
    turned = wrap(graph.heading_rad.astype(np.float64) - start.heading_rad) / start.sigma_rad
    return (-0.5 * (away**2 + turned**2)).astype(np.float32)


def _promising_starts(
    network: RoadNetwork, fine: LaneGraph, track: Track, log_scale: FloatArray, config: RouteSearchConfig
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Which (fine bin, scale bin) starts lie in a coarse cell from which a good coarse route leads on."""
    many = config.coarse
    coarse_scale = log_scale[many // 2 :: many]
    step = 2.0 * track.step  # coarse bins need longer steps, to be moved by more than a bin
    graph = build_lane_graph(network, step * np.exp(coarse_scale[-1]) + 4.0 * many * config.bin_m, many * config.bin_m)
    off = replace(config.off_network, leave_nats=1e9)  # a search for the start has nowhere to leave from
    arguments = _kernel_arguments(
        track.heading_rad[::2], step, coarse_scale, graph, _coarse_costs(config), off, many * config.bin_m
    )
    starts = _all_starts(graph, len(coarse_scale), track, None)
    limit = 20 * config.most_survivors
    survivors = route_kernel.forward(*arguments, config.coarse_beam_nats, limit, config.coarse_enough, starts)
    through = route_kernel.backward(*arguments, config.margin_nats, survivors)[: len(starts[0])]
    good = (through >= through.max() - config.seed_margin_nats).reshape(graph.bin_count, len(coarse_scale))
    cell = graph.lane_start[fine.lane] + _share_of_lane(fine, graph)
    scale_cell = np.minimum(np.arange(len(log_scale)) // many, len(coarse_scale) - 1)
    promising: np.ndarray[tuple[int], np.dtype[np.bool_]] = good[cell][:, scale_cell].ravel()
    return promising


def _coarse_costs(config: RouteSearchConfig) -> SearchCosts:
    """Looser, because neither bin nor scale bin fits: what counts is that the true start is not lost."""
    return SearchCosts(
        heading_sigma_rad=0.2, heading_limit_nats=5.0, offset_gain=0.1, length_sigma_m=1.5, scale_step_nats=2.0,
        lane_change_nats=config.costs.lane_change_nats,
    )  # fmt: skip


def _share_of_lane(fine: LaneGraph, coarse: LaneGraph) -> IntArray:
    """For each fine bin, which coarse bin of its lane it lies in."""
    counts = np.diff(fine.lane_start)[fine.lane]
    order = np.arange(fine.bin_count) - fine.lane_start[fine.lane]
    return ((order + 0.5) / counts * np.diff(coarse.lane_start)[fine.lane]).astype(np.int32)


def _best_route(
    graph: LaneGraph,
    lane_length_m: FloatArray,
    track: Track,
    log_scale: FloatArray,
    survivors: tuple[Any, ...],
    through: Float32Array,
) -> Route:
    row_start, bins, k, parent, score, offset, rest, places, _ = survivors
    row = np.empty(len(track.arc), dtype=np.int64)
    row[-1] = row_start[-2] + np.argmax(score[row_start[-2] :])
    for t in range(len(row) - 1, 0, -1):
        row[t - 1] = parent[row[t]]
    on_network = bins[row] >= 0
    at = np.maximum(bins[row], 0)
    lane = np.where(on_network, graph.lane[at], -1).astype(np.int32)
    position = np.clip(graph.position_m[at] + rest[row], 0.0, lane_length_m[graph.lane[at]])
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
        alternatives=RouteAlternatives(row_start, points, through),
    )
