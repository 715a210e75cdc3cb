"""One step on the network, compiled: which hypotheses a hypothesis leads to, and at which cost.

Costs are negative log likelihoods in nats: of the heading error and the length error (both normal, the former truncated), of a
change of scale and of a lane change. The step sees bins and tables only; it knows no roads.

The functions that run for every hypothesis are inlined: to hand the model over, a tuple of many arrays, costs as much as a step.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hippodrome.core.matching.search.hypotheses import Hypotheses, Hypothesis, Places, Successors
from hippodrome.core.matching.search.model import SearchModel, StepCosts, StepObservation
from hippodrome.core.matching.search.off_network import dead_reckoned, followed_offset, rejoin
from hippodrome.core.roads.lanes_ahead import WAYS
from hippodrome.core.se2 import wrap_near_zero

MOST_SUCCESSORS = 2048  # room for one hypothesis: a few bins x scale bins x branches of a junction, or the bins around a place
_FARTHEST_JUMP = 12  # scale bins of the largest jump in scale: 50 % either way
_JUMP_SPREAD = 2.0  # only hypotheses this close to the best (nats) may jump in scale ...
_MOST_JUMPING = 200  # ... and only if they are no more than this
_BEFORE, _BEHIND = 0.501, 0.499  # centres of bins lie half a bin from their ends, and a little room for rounding


class _Prediction(NamedTuple):
    """Where a hypothesis is expected to be after the step, for one choice of the next scale bin."""

    scale_bin: int
    cost_nats: float  # cost of the change of scale
    ahead_m: float  # driven length from the centre of the present bin
    tolerance_m: float  # bins that are off by more are not tried
    heading_offset_rad: float
    heading_rad: float  # expected heading on the network


@njit(cache=True, error_model="numpy", inline="always")
def successors(
    hypothesis: Hypothesis, places: Places, observation: StepObservation, model: SearchModel, may_jump: bool, most_cost: float,
    out: Successors,
) -> int:  # fmt: skip
    """Write the successors on the network of one hypothesis, itself on or off the network, into ``out``; returns their number."""
    if hypothesis.bin >= 0:
        return expand(hypothesis, observation, model, may_jump, most_cost, out)
    return rejoin(hypothesis, dead_reckoned(hypothesis, places, observation, model), observation, model, out)


@njit(cache=True, error_model="numpy", inline="always")
def expand(
    hypothesis: Hypothesis, observation: StepObservation, model: SearchModel, may_jump: bool, most_cost: float, out: Successors
) -> int:
    """Write the successors of a hypothesis on the network that cost at most ``most_cost`` into ``out``; returns their number.

    The scale may change by one bin, or by many if ``may_jump``. Without a change of scale, bins next to the predicted one are
    tried too, since a corner that is cut or taken wide makes the driven length differ from that of the lane.
    """
    costs, scales = model.costs, model.scales
    own, offset, remainder = hypothesis.scale_bin, float(hypothesis.heading_offset_rad), float(hypothesis.remainder_m)
    heading = observation.heading_rad + offset
    farthest = _FARTHEST_JUMP if may_jump else 1
    half_bin, with_neighbour = costs.half_bin_m, 3.0 * costs.half_bin_m  # from the centre to the end of the bin, of the next one
    count = 0
    for scale_bin in range(max(own - farthest, 0), min(own + farthest + 1, scales.shape[0])):
        cost = min(costs.scale_step_nats * abs(scale_bin - own), costs.scale_jump_nats)
        if cost > most_cost:
            continue
        ahead = observation.step * scales[scale_bin] + remainder
        tolerance = with_neighbour if scale_bin == own else half_bin
        prediction = _Prediction(scale_bin, cost, ahead, tolerance, offset, heading)
        count = _append_ahead(hypothesis.bin, prediction, observation, model, most_cost, out, count)
    return count


@njit(cache=True, error_model="numpy", inline="always")
def _append_ahead(
    bin_: int, prediction: _Prediction, observation: StepObservation, model: SearchModel, most_cost: float, out: Successors,
    count: int,
) -> int:  # fmt: skip
    """Append to ``out`` the bins near the prediction that cost at most ``most_cost``; returns the new number of rows.

    The lanes ahead are gone through way by way: on the lane itself, or on an adjacent one after a lane change.
    """
    graph, ahead = model.graph, model.graph.ahead
    nearest, farthest = prediction.ahead_m - prediction.tolerance_m, prediction.ahead_m + prediction.tolerance_m
    for way in range(WAYS * graph.lane[bin_], WAYS * graph.lane[bin_] + WAYS):
        entry_m = graph.position_m[bin_] * ahead.entry[way]
        change_nats = 0.0 if way % WAYS == 0 else model.costs.lane_change_nats
        for r in range(ahead.start[way], ahead.start[way + 1]):
            row = ahead.rows[r]
            begin_m = row.begin_m - entry_m
            if begin_m > farthest:
                break
            first = max(math.ceil((nearest - begin_m) / row.bin_m - _BEFORE), 0)
            last = min(math.floor((farthest - begin_m) / row.bin_m - _BEHIND), row.bin_count - 1)
            for n in range(first, last + 1):
                distance_m = begin_m + (n + 0.5) * row.bin_m
                error = prediction.ahead_m - float(np.float32(distance_m))
                if distance_m <= 0.0 or abs(error) > prediction.tolerance_m or count == out.shape[0]:
                    continue
                count = _append(row.first_bin + n, error, change_nats, prediction, observation, model, most_cost, out, count)
    return count


@njit(cache=True, error_model="numpy", inline="always")
def _append(
    target: int, error_m: float, change_nats: float, prediction: _Prediction, observation: StepObservation, model: SearchModel,
    most_cost: float, out: Successors, count: int,
) -> int:  # fmt: skip
    """Append a bin to ``out`` unless it costs more than ``most_cost``; returns the new number of rows."""
    graph, costs = model.graph, model.costs
    turn = wrap_near_zero(graph.heading_rad[target] - prediction.heading_rad)
    cost = prediction.cost_nats + change_nats + _heading_cost(turn, costs) + _length_cost(error_m, costs)
    cost += _place_cost(graph.points_m[target, 0], graph.points_m[target, 1], observation, costs)
    if cost > most_cost:
        return count
    successor = out[count]
    successor.bin, successor.scale_bin, successor.log_likelihood = target, prediction.scale_bin, -cost
    successor.heading_offset_rad = followed_offset(prediction.heading_offset_rad, turn, costs)
    successor.remainder_m = min(max(error_m, -costs.half_bin_m), costs.half_bin_m)
    return count + 1


@njit(cache=True, error_model="numpy", inline="always")
def _heading_cost(turn_rad: float, costs: StepCosts) -> float:
    """Cost of a difference between the lane's heading and the predicted one: half the square of its sigmas, truncated."""
    return min(0.5 * (turn_rad * (1.0 / costs.heading_sigma_rad)) ** 2, costs.heading_limit_nats)


@njit(cache=True, error_model="numpy", inline="always")
def _length_cost(error_m: float, costs: StepCosts) -> float:
    """Cost of a difference between the driven length and the length along the lanes; half a bin either way is free."""
    beyond = (abs(error_m) - costs.half_bin_m) * (1.0 / costs.length_sigma_m)
    return 0.5 * beyond * beyond if beyond > 0.0 else 0.0


@njit(cache=True, error_model="numpy", inline="always")
def _place_cost(x_m: float, y_m: float, observation: StepObservation, costs: StepCosts) -> float:
    """Cost of the distance from the known place, if one is known."""
    if observation.place_weight > 0.0:
        away_sq = (x_m - observation.x_m) ** 2 + (y_m - observation.y_m) ** 2
        return min(0.5 * observation.place_weight * away_sq, costs.heading_limit_nats)
    return 0.0


@njit(cache=True, error_model="numpy")
def jump_bar(hypotheses: Hypotheses, best_nats: float) -> float:
    """The least score with which a hypothesis may jump in scale: close to ``best_nats``, the best score of its step.

    It is infinite while many hypotheses are about as good as the best, as jumps would multiply them.
    """
    bar = best_nats - _JUMP_SPREAD
    count = 0
    for i in range(hypotheses.shape[0]):
        count += hypotheses[i].score_nats >= bar
    return bar if count <= _MOST_JUMPING else math.inf
