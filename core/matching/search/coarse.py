"""The coarse search for an unknown start: which states may be the right one at a sample of the drive.

It begins in all bins of the network and all scales, with bins and scale bins several times as large as those of the fine search.
In a large network, places that may be right are found first. It is searched in parts, so that memory does not grow with it; the
best routes found in one part prune the others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np

from hippodrome.core.matching.search.backward import backward
from hippodrome.core.matching.search.config import RouteSearchConfig, SearchCosts
from hippodrome.core.matching.search.floor import Floor
from hippodrome.core.matching.search.hypotheses import HYPOTHESIS, NOWHERE, PLACE, Hypotheses
from hippodrome.core.matching.search.model import Drive, SearchModel
from hippodrome.core.matching.search.passes import forward_pass
from hippodrome.core.matching.search.problem import InitialHypotheses, SearchProblem, compiled_drive, compiled_model
from hippodrome.core.roads.lanes_ahead import SearchGraph, build_search_graph
from hippodrome.core.roads.network import BoolArray
from hippodrome.core.se2 import wrap
from hippodrome.core.types import Float32Array, FloatArray, IntArray

_MOST_STATES = 400_000  # coarse states of one part: 100 km of lanes
_NEAR_M = 40.0  # routes that have joined began this close together, as a search begins right before a turn
_MOST_COARSE = 1_000_000  # hypotheses kept at each step
_STEPS = 60  # coarse steps (600 m) over which the states of a network in several parts are compared
_MOST_FINE = 200_000  # fine states that are handed on, the best rated ones


class CoarseStates(NamedTuple):
    """The coarse states in which a search may begin: all of these scale bins in all of these bins."""

    bins: IntArray  # ascending
    scale_bins: IntArray  # ascending

    @classmethod
    def everywhere(cls, coarse: SearchProblem) -> Self:
        return cls(np.arange(coarse.graph.bin_count, dtype=np.int32), np.arange(len(coarse.log_scale), dtype=np.int32))


def good_states(
    problem: SearchProblem, coarse: SearchProblem, anchor: int, config: RouteSearchConfig, floor: Floor | None = None,
    among: CoarseStates | None = None,
) -> Hypotheses:  # fmt: skip
    """The fine states that may be the right one at sample ``anchor``, with their ratings as scores.

    The rating is the score of the best coarse route that begins in the state, less that of the best of all; states more than
    ``seed_margin_nats`` behind are left out, and all of them if all routes stay below the floor. All fine states within one
    coarse state have the same rating. Only coarse states ``among`` those given are tried, or all.
    """
    heading_rad = problem.track.heading_rad[anchor::2]  # the steps of the coarse search are twice as long as those of the drive
    least_nats = np.full(len(heading_rad), NOWHERE) if floor is None else floor.from_sample(anchor, 2)
    tried = CoarseStates.everywhere(coarse) if among is None else among
    states, nats = _rated_states(coarse, heading_rad, config, least_nats, tried)
    return _fine_states(problem, coarse, states, nats, float(problem.track.heading_rad[anchor]), config.coarse)


def _rated_states(
    coarse: SearchProblem, heading_rad: FloatArray, config: RouteSearchConfig, least_nats: FloatArray, tried: CoarseStates
) -> tuple[IntArray, Float32Array]:
    """Numbers (n,) of the good coarse states, and their ratings (n,)."""
    whole = len(tried.bins) * len(tried.scale_bins) <= _MOST_STATES and least_nats[-1] == NOWHERE
    samples = len(heading_rad) if whole else min(_STEPS + 1, len(heading_rad))
    drive, least_nats = compiled_drive(coarse, heading_rad[:samples]), least_nats[:samples]
    model, enough = compiled_model(coarse), config.coarse_enough if whole else 0
    if len(tried.bins) * len(tried.scale_bins) > _MOST_STATES:
        tried = CoarseStates(_promising_bins(coarse, drive, model, config, tried), tried.scale_bins)
    found, least_nats = [], least_nats.copy()
    for initial in _parts(coarse, tried, float(heading_rad[0])):
        found.append(_rated_part(drive, model, initial, config, least_nats, enough))
        _raise_floor(least_nats, found[-1].best_nats, config.coarse_beam_nats, config.seed_margin_nats)
    longest = max(len(part.best_nats) for part in found)
    states, nats = (np.concatenate([part[i] for part in found if len(part.best_nats) == longest]) for i in range(2))
    good = nats >= nats.max(initial=NOWHERE) - config.seed_margin_nats
    return states[good], nats[good] - nats.max(initial=NOWHERE)


def _parts(coarse: SearchProblem, tried: CoarseStates, heading_rad: float) -> Iterator[Hypotheses]:
    """The states in which a search begins, in parts that are searched one after the other."""
    bins_at_once = max(_MOST_STATES // len(tried.scale_bins), 1)
    for first in range(0, max(len(tried.bins), 1), bins_at_once):
        yield hypotheses_in(coarse.graph, tried.bins[first : first + bins_at_once], tried.scale_bins, heading_rad)


def _raise_floor(least_nats: FloatArray, best_nats: Float32Array | FloatArray, beam_nats: float, margin_nats: float) -> None:
    """Let what a part of the network scores at each sample prune the others, as if all were searched at once, in place."""
    own = slice(0, len(best_nats))
    least_nats[own] = np.maximum(least_nats[own], best_nats - beam_nats)
    if len(best_nats) == len(least_nats):
        least_nats[-1] = max(least_nats[-1], best_nats[-1] - margin_nats)


def _promising_bins(
    coarse: SearchProblem, drive: Drive, model: SearchModel, config: RouteSearchConfig, tried: CoarseStates
) -> IntArray:
    """The bins, out of a large network, around those from which the best routes lead on, within ``seed_margin_nats``.

    This pass looks for places. To tell states there apart, as ``_rated_part`` does, takes longer. Routes whose ways have joined
    have begun close together, so that all but the best of them may be forgotten.
    """
    least_nats, begun, nats = np.full(len(drive.heading_rad), NOWHERE), [], []
    for starts in _parts(coarse, tried, float(drive.heading_rad[0])):
        if (found := _begun_part(drive, model, starts, config, least_nats)) is not None:
            _raise_floor(least_nats, found.best_nats, config.coarse_beam_nats, config.seed_margin_nats)
            nats.append(found.nats)
            begun.append(found.states)
    if not begun:
        return tried.bins
    rating = np.concatenate(nats)
    places = np.unique(np.concatenate(begun)[rating >= rating.max() - config.seed_margin_nats])
    return tried.bins[_are_near(coarse.graph.points_m[tried.bins], coarse.graph.points_m[places])]


def _are_near(points_m: FloatArray, places_m: FloatArray) -> BoolArray:
    """Which of the points (N, 2) lie in a square cell with one of the places (P, 2), or in a cell beside it."""
    low = points_m.min(axis=0)
    cells, own = (((points - low) / _NEAR_M).astype(np.int64) + 1 for points in (points_m, places_m))
    marked = np.zeros(cells.max(axis=0) + 2, dtype=bool)
    for east in (-1, 0, 1):
        for north in (-1, 0, 1):
            marked[own[:, 0] + east, own[:, 1] + north] = True
    near: BoolArray = marked[cells[:, 0], cells[:, 1]]
    return near


class _Rated(NamedTuple):
    """The good ones among some initial states."""

    states: IntArray  # (n,) their numbers, or those of their bins
    nats: Float32Array  # (n,) score of the best route from each
    best_nats: Float32Array | FloatArray  # (t,) best score at each sample, up to where the search ended


def _begun_part(
    drive: Drive, model: SearchModel, starts: Hypotheses, config: RouteSearchConfig, least_nats: FloatArray
) -> _Rated | None:
    """The bins of the initial states from which the routes lead on that survive to the last sample; None if none survives.

    The survivors, up to 200 MB, end with this function, before the next part is searched.
    """
    initial = InitialHypotheses(starts, np.empty(0, PLACE))
    survivors = forward_pass(drive, model, initial, config.coarse_beam_nats, _MOST_COARSE, least_nats=least_nats)
    if survivors.died_out:
        return None
    score, row = survivors.hypotheses["score_nats"], np.arange(*survivors.row_start[-2:])
    nats, best_nats = score[row].copy(), np.maximum.reduceat(score, survivors.row_start[:-1])
    for _ in range(len(survivors.row_start) - 2):
        row = survivors.hypotheses["parent"][row]
    return _Rated(starts["bin"][row], nats, best_nats)


def _rated_part(
    drive: Drive, model: SearchModel, starts: Hypotheses, config: RouteSearchConfig, least_nats: FloatArray, enough: int
) -> _Rated:
    """Search from some initial states, and rate those from which good routes lead on. There are none if all stay too low."""
    initial = InitialHypotheses(starts, np.empty(0, PLACE))
    survivors = forward_pass(drive, model, initial, config.coarse_beam_nats, _MOST_COARSE, enough, least_nats)
    if survivors.died_out and np.any(least_nats > NOWHERE):
        return _Rated(np.empty(0, np.int32), np.empty(0, np.float32), np.empty(0))
    score = survivors.hypotheses["score_nats"]
    last = score[survivors.row_start[-2] :]
    through = backward(drive, model, config.seed_margin_nats, survivors, np.zeros(len(last), np.float32))[: len(starts)]
    good = starts[through > NOWHERE]
    states = good["bin"] * np.int32(len(model.scales)) + good["scale_bin"]
    best = np.maximum.reduceat(score, survivors.row_start[:-1]).astype(np.float64)
    return _Rated(states, through[through > NOWHERE] + np.float32(best[-1]), best)


def _fine_states(
    problem: SearchProblem, coarse: SearchProblem, states: IntArray, nats: Float32Array, heading_rad: float, factor: int
) -> Hypotheses:
    """The fine states within good coarse ones, at most ``_MOST_FINE`` of them."""
    most = max(_MOST_FINE // factor**2, 1)
    if len(states) > most:
        kept = np.sort(np.argsort(-nats, kind="stable")[:most])
        states, nats = states[kept], nats[kept]
    scales, fine_scales = len(coarse.log_scale), len(problem.log_scale)
    rating = np.full((coarse.graph.bin_count, scales), NOWHERE, np.float32)
    rating.ravel()[states] = nats
    coarse_bin = coarse.graph.lane_start[problem.graph.lane] + _coarse_bin_of_lane(problem.graph, coarse.graph)
    bins = np.flatnonzero(rating.max(axis=1)[coarse_bin] > NOWHERE).astype(np.int32)
    coarse_scale = np.minimum(np.arange(fine_scales) // factor, scales - 1)
    hypotheses = hypotheses_in(problem.graph, bins, np.arange(fine_scales, dtype=np.int32), heading_rad)
    hypotheses["score_nats"] = rating[coarse_bin[bins]][:, coarse_scale].ravel()
    return hypotheses[hypotheses["score_nats"] > NOWHERE]


def hypotheses_in(graph: SearchGraph, bins: IntArray, scale_bins: IntArray, heading_rad: float) -> Hypotheses:
    """Hypotheses for every one of the scale bins in each of the bins, bin by bin.

    Each is headed along its lane while odometry says ``heading_rad``; the difference is its heading offset.
    """
    rows = np.zeros(len(bins) * len(scale_bins), HYPOTHESIS)
    rows["bin"] = np.repeat(bins, len(scale_bins))
    rows["scale_bin"] = np.tile(scale_bins, len(bins))
    offset = wrap(graph.heading_rad[bins].astype(np.float64) - heading_rad)
    rows["heading_offset_rad"] = np.repeat(offset, len(scale_bins))
    return rows


def coarse_problem(problem: SearchProblem, config: RouteSearchConfig) -> SearchProblem:
    """The same problem with bins and scale bins ``config.coarse`` times as large and steps twice as long.

    It has so few states that all of them can be searched.
    """
    factor = config.coarse
    log_scale = problem.log_scale[factor // 2 :: factor]  # the middle of each group of scale bins
    step = 2.0 * problem.track.step  # coarse bins need longer steps, to be moved by more than a bin
    reach_m = step * float(np.exp(log_scale[-1])) + 4.0 * factor * config.bin_m
    return replace(
        problem,
        track=replace(problem.track, step=step),
        log_scale=log_scale,
        graph=build_search_graph(problem.network, reach_m, factor * config.bin_m),
        costs=_coarse_costs(config),
        off_network=replace(config.off_network, leave_nats=1e9),  # the start is sought on the network only
        bin_m=factor * config.bin_m,
    )


def _coarse_costs(config: RouteSearchConfig) -> SearchCosts:
    """Costs of the coarse search: looser, because its bins and scales fit badly and the true start must not be lost."""
    return replace(
        config.costs, heading_sigma_rad=0.2, heading_limit_nats=5.0, offset_gain=0.1, length_sigma_m=1.5, scale_step_nats=2.0
    )


def _coarse_bin_of_lane(fine: SearchGraph, coarse: SearchGraph) -> IntArray:
    """The coarse bin (N,) in which each fine bin lies, counted from the beginning of its lane."""
    counts = np.diff(fine.lane_start)[fine.lane]
    order = np.arange(fine.bin_count) - fine.lane_start[fine.lane]
    return ((order + 0.5) / counts * np.diff(coarse.lane_start)[fine.lane]).astype(np.int32)
