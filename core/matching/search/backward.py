"""The compiled search backward in time: the best complete route through each survivor of the forward pass.

The best score to each survivor and the best score on from it give the max-marginal of the survivor: the score of the best
complete route through it. Dropping survivors whose max-marginal is far behind is forward-backward pruning (A. Sixtus and
S. Ortmanns, "High quality word graphs using forward-backward pruning", 1999). What is left are alternatives to the best route.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.matching.search.beam import Survivors
from hippodrome.core.matching.search.hypotheses import NOWHERE, Hypotheses, Successors, index_of_best
from hippodrome.core.matching.search.model import Drive, SearchModel, observation_of_step
from hippodrome.core.matching.search.states import Scratch, empty_states, forget_states, make_scratch, state_of
from hippodrome.core.matching.search.successors import jump_bar, successors
from hippodrome.core.types import Float32Array, FloatArray, IntArray


class Alternatives(NamedTuple):
    """Places other than the best route's: sample ``t`` owns rows ``row_start[t]:row_start[t + 1]``."""

    row_start: NDArray[np.int64]  # (T + 1,)
    points_m: Float32Array  # (rows, 2)
    through_nats: Float32Array  # (rows,) score of the best complete route through this place, less that of the best of all
    scale_bin: IntArray  # (rows,)


def backward(
    drive: Drive, model: SearchModel, margin_nats: float, survivors: Survivors, onward_nats: Float32Array
) -> Float32Array:
    """Backward pass: the score of the best complete route through each survivor (rows,), less that of the best of all.

    It is 0 for the best route, and the more negative the less likely the survivor is.

    Args:
        drive: as in the forward pass.
        model: as in the forward pass.
        margin_nats: survivors that fall farther behind the best route get ``NOWHERE``.
        survivors: what the forward pass returned.
        onward_nats: score of the best route onward from each survivor of the last sample; 0 if the drive ends there.
    """
    through: Float32Array = _backward(drive, model, margin_nats, survivors, onward_nats, empty_states(model))
    return through


@njit(cache=True, error_model="numpy")
def _backward(
    drive: Drive, model: SearchModel, margin_nats: float, survivors: Survivors, onward_nats: Float32Array, empty: IntArray
) -> Float32Array:
    """As ``backward``, with the empty table of states."""
    row_start, rows, places, _ = survivors
    times = row_start.shape[0] - 1
    through = np.full(rows.shape[0], NOWHERE, np.float32)
    best = NOWHERE
    for i in range(row_start[times - 1], row_start[times]):
        through[i] = rows[i].score_nats + onward_nats[i - row_start[times - 1]]
        best = max(best, through[i])
    scratch = make_scratch(model, empty)
    for t in range(times - 1, 0, -1):
        begin, end = row_start[t - 1], row_start[t]
        observation = observation_of_step(drive, t)
        jump_from = jump_bar(rows[begin:end], rows[begin + index_of_best(rows[begin:end])].score_nats)
        most_onward = _prune_and_index(survivors, through, t, best - margin_nats, scratch)
        for i in range(begin, end):
            score = rows[i].score_nats
            most_cost = score + most_onward - best + margin_nats  # a successor that costs more leads nowhere within the margin
            if most_cost < 0.0:
                continue
            may_jump = score >= jump_from
            found = successors(rows[i], places, observation, model, may_jump, most_cost, scratch.successors)
            _pass_back(rows, through, i, scratch.successors[:found], scratch)
        forget_states(rows[end : row_start[t + 1]], scratch)
    for i in range(rows.shape[0]):
        through[i] = through[i] - best if through[i] >= best - margin_nats else NOWHERE
    return through


@njit(cache=True, error_model="numpy")
def _prune_and_index(survivors: Survivors, through: Float32Array, t: int, least_nats: float, scratch: Scratch) -> float:
    """Prepare the survivors of sample ``t``, whose best complete routes are known, for the step backward from them.

    Survivors that score below ``least_nats`` become ``NOWHERE``. The others on the network are entered into the table of states;
    those off it have a single parent each, to which the score of their best complete route is passed on at once. Returns the
    largest score that any of them still gains after this sample.
    """
    rows, most_onward = survivors.hypotheses, NOWHERE
    for i in range(survivors.row_start[t], survivors.row_start[t + 1]):
        if through[i] < least_nats:
            through[i] = NOWHERE
            continue
        most_onward = max(most_onward, through[i] - rows[i].score_nats)
        if rows[i].bin >= 0:
            scratch.number_of_state[state_of(rows[i], scratch)] = i + 1
        else:
            through[rows[i].parent] = max(through[rows[i].parent], through[i])
    return most_onward


@njit(cache=True, error_model="numpy")
def _pass_back(rows: Hypotheses, through: Float32Array, i: int, found: Successors, scratch: Scratch) -> None:
    """One step of the backward recursion: set ``through[i]`` to the score of the best complete route through hypothesis ``i``.

    A route through a successor scores what the route up to ``i`` scores, plus the log likelihood of the step, plus what the best
    route onward from the successor adds. Successors that did not survive are not in the table of states and are left out.
    """
    score = rows[i].score_nats
    for c in range(found.shape[0]):
        at = scratch.number_of_state[state_of(found[c], scratch)] - 1
        if at >= 0:
            through[i] = max(through[i], score + found[c].log_likelihood + (through[at] - rows[at].score_nats))


def alternatives(survivors: Survivors, through: Float32Array, points_m: FloatArray, cell: IntArray) -> Alternatives:
    """Collect the alternatives to the best route: the survivors through which a complete route within the margin passes.

    Alternatives close to each other are one and the same. Each lane is therefore divided into cells, and at each sample only the
    best alternative in each cell is kept. Those off the network are all kept.

    Args:
        survivors: what the forward pass returned.
        through: (rows,) what the backward pass returned for them.
        points_m: (N, 2) centre of each bin.
        cell: (N,) cell that each bin belongs to.
    """
    return Alternatives(*_alternatives(survivors, through, points_m, cell))


@njit(cache=True, error_model="numpy")
def _alternatives(
    survivors: Survivors, through: Float32Array, points_m: FloatArray, cell: IntArray
) -> tuple[NDArray[np.int64], Float32Array, Float32Array, IntArray]:
    """The compiled part of ``alternatives``; the fields of its result."""
    row_start, rows = survivors.row_start, survivors.hypotheses
    times, count = row_start.shape[0] - 1, 0
    for i in range(rows.shape[0]):
        count += through[i] > NOWHERE
    kept_start, kept = np.zeros(times + 1, np.int64), np.empty(count, np.int32)
    kept_of_cell = np.full(cell.max() + 1, -1, np.int32)
    for t in range(times):
        kept_start[t + 1] = _keep_best_of_cells(survivors, through, t, cell, kept, kept_start[t], kept_of_cell)
    size = kept_start[times]
    points, values, scale_bin = np.empty((size, 2), np.float32), np.empty(size, np.float32), np.empty(size, np.int32)
    for j in range(size):
        row = rows[kept[j]]
        values[j], scale_bin[j] = through[kept[j]], row.scale_bin
        if row.bin >= 0:
            points[j, 0], points[j, 1] = points_m[row.bin, 0], points_m[row.bin, 1]
        else:
            place = survivors.places[-1 - row.bin]
            points[j, 0], points[j, 1] = place.x_m, place.y_m
    return kept_start, points, values, scale_bin


@njit(cache=True, error_model="numpy")
def _keep_best_of_cells(
    survivors: Survivors, through: Float32Array, t: int, cell: IntArray, kept: IntArray, size: int, kept_of_cell: IntArray
) -> int:
    """Thin out sample ``t`` for ``alternatives``: append to ``kept`` the row of the best survivor of each cell.

    The rows of survivors off the network are all appended. ``kept`` holds ``size`` rows before; returns how many it holds
    afterwards. ``kept_of_cell`` is scratch memory for the index in ``kept`` of each cell's survivor: -1 everywhere before and
    after.
    """
    rows, first = survivors.hypotheses, size
    for i in range(survivors.row_start[t], survivors.row_start[t + 1]):
        if through[i] == NOWHERE:
            continue
        at = kept_of_cell[cell[rows[i].bin]] if rows[i].bin >= 0 else -1
        if at < 0:
            at, size = size, size + 1
            if rows[i].bin >= 0:
                kept_of_cell[cell[rows[i].bin]] = at
        elif through[i] <= through[kept[at]]:
            continue
        kept[at] = i
    for j in range(first, size):
        if rows[kept[j]].bin >= 0:
            kept_of_cell[cell[rows[kept[j]].bin]] = -1
    return size
