"""Hypotheses off the network, compiled: which may leave it, where dead reckoning takes them, and where they come back.

A hypothesis leaves from where the route was well known, moves by dead reckoning, and may come back to any lane near its place
whose direction fits.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.matching.search.hypotheses import Hypotheses, Hypothesis, Places, Successors, index_of_best
from hippodrome.core.matching.search.model import SearchModel, StepCosts, StepObservation
from hippodrome.core.roads.lane_graph import BinGrid
from hippodrome.core.se2 import wrap_near_zero
from hippodrome.core.types import IntArray

MOST_OFF = 192  # hypotheses off the network in one step; beyond this the worst gives way
_SAME_PLACE_M = 4.0  # closer than this, two hypotheses off the network count as one ...
_SAME_OFFSET_RAD = 0.3  # ... if their heading offsets are no farther apart than this
_KNOWN_LANES = 30  # with good hypotheses on more lanes than this the route is too uncertain to say where it leaves the network
_PLACE_SIGMA_M = 2.0  # sigma of a place at which the network was just left; it grows with the metres driven since
_RETURN_SIGMAS = 2.5  # the vehicle returns to no lane that is more sigmas away than this
_OFFSET_SIGMAS = 3.0  # heading errors are clipped at this many sigmas before the heading offset follows them


class Place(NamedTuple):
    """A dead-reckoned place."""

    x_m: float
    y_m: float
    driven_m: float  # metres driven since the network was left


class StepRows(NamedTuple):
    """Which rows of the hypotheses and of the places are filled while a step is made."""

    begin: int  # hypotheses begin:end are those before the step ...
    end: int
    size: int  # ... and end:size those after it that were found so far
    place_count: int  # rows of the places that are filled


@njit(cache=True, error_model="numpy", inline="always")
def followed_offset(offset_rad: float, turn_rad: float, costs: StepCosts) -> float:
    """Let the heading offset follow the drift of the gyro: add a share of the heading error ``turn_rad`` of this step.

    The error is clipped first, so that a single large one hardly moves the offset.
    """
    most = _OFFSET_SIGMAS * costs.heading_sigma_rad
    return wrap_near_zero(offset_rad + costs.offset_gain * min(max(turn_rad, -most), most))


@njit(cache=True, error_model="numpy")
def rejoin(hypothesis: Hypothesis, place: Place, observation: StepObservation, model: SearchModel, out: Successors) -> int:
    """Write the bins at which a hypothesis off the network, now at ``place``, may rejoin it into ``out``; returns how many."""
    graph, costs, off = model.graph, model.costs, model.off_network
    spread = _PLACE_SIGMA_M + off.drift * place.driven_m
    radius = _RETURN_SIGMAS * spread
    column_0, column_1, row_0, row_1 = _cells_around(off.grid, place.x_m, place.y_m, radius)
    if column_0 > column_1:
        return 0
    count = 0
    for row in range(row_0, row_1 + 1):
        first_cell, last_cell = row * off.grid.columns + column_0, row * off.grid.columns + column_1
        for n in range(off.grid.start[first_cell], off.grid.start[last_cell + 1]):
            bin_ = off.grid.bin[n]
            gap_sq = (graph.points_m[bin_, 0] - place.x_m) ** 2 + (graph.points_m[bin_, 1] - place.y_m) ** 2
            turn = wrap_near_zero(graph.heading_rad[bin_] - observation.heading_rad - hypothesis.heading_offset_rad)
            if gap_sq > radius * radius or abs(turn) > off.turn_limit_rad:
                continue
            if count == out.shape[0]:
                return count
            heading_cost = min(0.5 * (turn / costs.heading_sigma_rad) ** 2, costs.heading_limit_nats)
            successor = out[count]
            successor.bin, successor.scale_bin, successor.remainder_m = bin_, hypothesis.scale_bin, 0.0
            successor.log_likelihood = -(off.return_nats + 0.5 * gap_sq / spread**2 + heading_cost)
            successor.heading_offset_rad = followed_offset(hypothesis.heading_offset_rad, turn, costs)
            count += 1
    return count


@njit(cache=True, error_model="numpy", inline="always")
def _cells_around(grid: BinGrid, x_m: float, y_m: float, radius_m: float) -> tuple[int, int, int, int]:
    """First and last column, first and last row of the grid's cells that a circle may touch; last < first if there are none."""
    column_0 = max(int((x_m - radius_m - grid.origin_m[0]) / grid.cell_m), 0)
    column_1 = min(int((x_m + radius_m - grid.origin_m[0]) / grid.cell_m), grid.columns - 1)
    row_0 = max(int((y_m - radius_m - grid.origin_m[1]) / grid.cell_m), 0)
    row_1 = min(int((y_m + radius_m - grid.origin_m[1]) / grid.cell_m), grid.rows - 1)
    return column_0, column_1, row_0, row_1


@njit(cache=True, error_model="numpy")
def dead_reckoned(hypothesis: Hypothesis, places: Places, observation: StepObservation, model: SearchModel) -> Place:
    """Where dead reckoning takes a hypothesis over one step, from its bin's centre or from its place off the network."""
    far = observation.step * model.scales[hypothesis.scale_bin]
    course = observation.course_rad + hypothesis.heading_offset_rad
    x, y = far * math.cos(course), far * math.sin(course)
    if hypothesis.bin >= 0:
        return Place(x + model.graph.points_m[hypothesis.bin, 0], y + model.graph.points_m[hypothesis.bin, 1], far)
    before = places[-1 - hypothesis.bin]
    return Place(x + before.x_m, y + before.y_m, far + before.driven_m)


@njit(cache=True, error_model="numpy")
def step_off_network(
    hypotheses: Hypotheses, places: Places, rows: StepRows, best: float, beam_nats: float, observation: StepObservation,
    model: SearchModel, index_of_lane: IntArray,
) -> tuple[int, int, float]:  # fmt: skip
    """Append the hypotheses that are off the network after a step: those that were off it before, and those that leave it now.

    Hypotheses and places must have room for ``MOST_OFF`` more rows. Of hypotheses near each other only the better one is kept,
    and once there are ``MOST_OFF``, a new one has to beat the worst. ``best`` is the best score of the step so far; a hypothesis
    more than ``beam_nats`` below it is dropped.

    Returns:
        How many hypotheses and how many places there are now, and the best score of the step.
    """
    off, size, place_count = model.off_network, rows.size, rows.place_count
    for i in _going_off(hypotheses, rows.begin, rows.end, model, index_of_lane):
        parent = hypotheses[i]
        total = parent.score_nats - off.step_nats - (0.0 if parent.bin < 0 else off.leave_nats)
        if total < best - beam_nats:
            continue
        best = max(best, total)
        place = dead_reckoned(parent, places, observation, model)
        at = _row_to_replace(hypotheses, places, rows.size, size, place, parent.heading_offset_rad)
        if at < 0:
            at, size, place_count = size, size + 1, place_count + 1
            hypotheses[at].bin = -place_count
        elif total <= hypotheses[at].score_nats:
            continue
        child = hypotheses[at]
        own_place = places[-1 - child.bin]
        own_place.x_m, own_place.y_m, own_place.driven_m = place.x_m, place.y_m, place.driven_m
        child.scale_bin, child.parent, child.score_nats = parent.scale_bin, i, total
        child.heading_offset_rad, child.remainder_m = parent.heading_offset_rad, 0.0
    return size, place_count, best


@njit(cache=True, error_model="numpy")
def _row_to_replace(
    hypotheses: Hypotheses, places: Places, first: int, size: int, place: Place, heading_offset_rad: float
) -> int:
    """The row of the hypothesis off the network that a new one has to beat, among the rows ``first:size``.

    It is the last one at about the same place and heading offset; if there is none, the worst one once there are ``MOST_OFF``,
    and -1, so that the new one is appended, as long as there are fewer.
    """
    same, worst = -1, first
    for other in range(first, size):
        other_place = places[-1 - hypotheses[other].bin]
        if (
            abs(other_place.x_m - place.x_m) + abs(other_place.y_m - place.y_m) < _SAME_PLACE_M
            and abs(wrap_near_zero(hypotheses[other].heading_offset_rad - heading_offset_rad)) < _SAME_OFFSET_RAD
        ):
            same = other
        worst = other if hypotheses[other].score_nats < hypotheses[worst].score_nats else worst
    return worst if same < 0 and size - first == MOST_OFF else same


@njit(cache=True, error_model="numpy")
def _going_off(hypotheses: Hypotheses, begin: int, end: int, model: SearchModel, index_of_lane: IntArray) -> NDArray[np.int64]:
    """Rows of the hypotheses that are off the network after the step: those off it already, then those that leave it now."""
    rows, count = np.empty(end - begin + _KNOWN_LANES, np.int64), 0
    for i in range(begin, end):
        if hypotheses[i].bin < 0:
            rows[count] = i
            count += 1
    for i in _leaving(hypotheses[begin:end], model, index_of_lane):
        rows[count] = begin + i
        count += 1
    return rows[:count]


@njit(cache=True, error_model="numpy")
def _leaving(hypotheses: Hypotheses, model: SearchModel, index_of_lane: IntArray) -> NDArray[np.int64]:
    """Choose the hypotheses that leave the network in this step: the best one on each lane; returns their indices.

    Only those at most ``spread_nats`` behind the best of all are considered. If they lie on more than ``_KNOWN_LANES`` lanes, the
    route is too uncertain for any to leave. ``index_of_lane`` (L,) is scratch memory: -1 everywhere before and after, and in
    between the index, within the answer, of each lane's best hypothesis.
    """
    lane, best = model.graph.lane, hypotheses[index_of_best(hypotheses)].score_nats
    found, count = np.empty(_KNOWN_LANES, np.int64), 0
    route_is_known = True
    for i in range(hypotheses.shape[0]):
        if hypotheses[i].bin < 0 or hypotheses[i].score_nats < best - model.off_network.spread_nats:
            continue
        at = index_of_lane[lane[hypotheses[i].bin]]
        if at >= 0:
            if hypotheses[i].score_nats > hypotheses[found[at]].score_nats:
                found[at] = i
        elif count == _KNOWN_LANES:
            route_is_known = False
            break
        else:
            index_of_lane[lane[hypotheses[i].bin]] = count
            found[count] = i
            count += 1
    for n in range(count):
        index_of_lane[lane[hypotheses[found[n]].bin]] = -1
    return found[:count] if route_is_known else found[:0]
