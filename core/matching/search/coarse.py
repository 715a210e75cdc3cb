"""The coarse search for an unknown start: which states may be the right one at a sample of the drive.

It begins in all bins of the network and all scales, with bins and scale bins several times as large as those of the fine search.
A large network is searched in parts, so that memory does not grow with it; the best route found in one part prunes the others.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hippodrome.core.matching.search.backward import backward
from hippodrome.core.matching.search.config import RouteSearchConfig, SearchCosts
from hippodrome.core.matching.search.hypotheses import HYPOTHESIS, NOWHERE, PLACE, Hypotheses
from hippodrome.core.matching.search.model import Drive, SearchModel
from hippodrome.core.matching.search.passes import forward_pass
from hippodrome.core.matching.search.problem import InitialHypotheses, SearchProblem, compiled_drive, compiled_model
from hippodrome.core.roads.lanes_ahead import SearchGraph, build_search_graph
from hippodrome.core.se2 import wrap
from hippodrome.core.types import Float32Array, FloatArray, IntArray

_MOST_STATES = 500_000  # coarse states of one part: 100 km of road
_MOST_COARSE = 1_000_000  # hypotheses kept at each step
_STEPS = 60  # coarse steps (600 m) over which the states of a network in several parts are compared
_MOST_FINE = 200_000  # fine states that are handed on, the best rated ones


def good_states(problem: SearchProblem, anchor: int, config: RouteSearchConfig, least_nats: float) -> Hypotheses:
    """The fine states that may be the right one at sample ``anchor``, with their ratings as scores.

    The rating is the score of the best coarse route that begins in the state, less that of the best of all; states more than
    ``seed_margin_nats`` behind are left out, and all of them if no route scores ``least_nats``. All fine states within one
    coarse state have the same rating.
    """
    coarse = _coarse_problem(problem, config)
    states, nats = _rated_states(coarse, problem.track.heading_rad[anchor::2], config, least_nats)
    return _fine_states(problem, coarse, states, nats, float(problem.track.heading_rad[anchor]), config.coarse)


def _rated_states(
    coarse: SearchProblem, heading_rad: FloatArray, config: RouteSearchConfig, least_nats: float
) -> tuple[IntArray, Float32Array]:
    """Numbers (n,) of the good coarse states, bin by bin, and their ratings (n,)."""
    scales = len(coarse.log_scale)
    bins_at_once = max(_MOST_STATES // scales, 1)
    parts = range(0, coarse.graph.bin_count, bins_at_once)
    alone = len(parts) == 1
    # the steps of the coarse search are twice as long as those of the drive, so that the caller takes every second sample
    drive = compiled_drive(coarse, heading_rad if alone else heading_rad[: _STEPS + 1])
    model, floor, found = compiled_model(coarse), least_nats, []
    for first in parts:
        bins = np.arange(first, min(first + bins_at_once, coarse.graph.bin_count), dtype=np.int32)
        initial = hypotheses_in(coarse.graph, bins, scales, float(heading_rad[0]))
        rated, best = _rated_part(drive, model, initial, config, floor, config.coarse_enough if alone else 0)
        found.append((first * scales + rated[0], rated[1]))
        floor = max(floor, best - config.seed_margin_nats)
    states, nats = (np.concatenate(column) for column in zip(*found, strict=True))
    good = nats >= nats.max(initial=NOWHERE) - config.seed_margin_nats
    return states[good], nats[good] - nats.max(initial=NOWHERE)


def _rated_part(
    drive: Drive, model: SearchModel, starts: Hypotheses, config: RouteSearchConfig, least_nats: float, enough: int
) -> tuple[tuple[IntArray, Float32Array], float]:
    """The good ones among some initial states, each with the score of the best route from it, and the best score."""
    initial = InitialHypotheses(starts, np.empty(0, PLACE))
    survivors = forward_pass(drive, model, initial, config.coarse_beam_nats, _MOST_COARSE, enough, least_nats)
    if survivors.died_out and least_nats > NOWHERE:
        return (np.empty(0, np.int32), np.empty(0, np.float32)), NOWHERE
    last = survivors.hypotheses["score_nats"][survivors.row_start[-2] :]
    through = backward(drive, model, config.seed_margin_nats, survivors, np.zeros(len(last), np.float32))[: len(starts)]
    good = np.flatnonzero(through > NOWHERE).astype(np.int32)
    best = float(last.max())
    return (good, through[good] + np.float32(best)), best


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
    hypotheses = hypotheses_in(problem.graph, bins, fine_scales, heading_rad)
    hypotheses["score_nats"] = rating[coarse_bin[bins]][:, coarse_scale].ravel()
    return hypotheses[hypotheses["score_nats"] > NOWHERE]


def hypotheses_in(graph: SearchGraph, bins: IntArray, scales: int, heading_rad: float) -> Hypotheses:
    """Hypotheses for every scale bin in each of the bins, bin by bin.

    Each is headed along its lane while odometry says ``heading_rad``; the difference is its heading offset.
    """
    rows = np.zeros(len(bins) * scales, HYPOTHESIS)
    rows["bin"] = np.repeat(bins, scales)
    rows["scale_bin"] = np.tile(np.arange(scales, dtype=np.int32), len(bins))
    rows["heading_offset_rad"] = np.repeat(wrap(graph.heading_rad[bins].astype(np.float64) - heading_rad), scales)
    return rows


def _coarse_problem(problem: SearchProblem, config: RouteSearchConfig) -> SearchProblem:
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
