"""The compiled search: a beam search forward in time, and the best complete route through each survivor backward in time.

Forward, this is the Viterbi algorithm with pruning, known as beam search (B. Lowerre, "The HARPY speech recognition system",
1976): of the hypotheses in one state only the best is kept, and those that fall behind the best of their step by more than the
beam are dropped. A hypothesis carries two values beside its state (see ``hypotheses``). They make the search exact in length and
invariant to translation and rotation, at the price that they are those of the best route to the state, as in a particle filter.

Backward, the best score to each survivor and the best score on from it give the max-marginal of the survivor: the score of the
best complete route through it. Dropping survivors whose max-marginal is far behind is forward-backward pruning (A. Sixtus and
S. Ortmanns, "High quality word graphs using forward-backward pruning", 1999). What is left are alternatives to the best route.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.matching.search.hypotheses import (
    NOWHERE,
    SUCCESSOR,
    Hypotheses,
    Places,
    Successors,
    index_of_best,
    with_room,
)
from hippodrome.core.matching.search.model import Drive, SearchModel, StepObservation, observation_of_step
from hippodrome.core.matching.search.off_network import MOST_OFF, StepRows, step_off_network
from hippodrome.core.matching.search.successors import MOST_SUCCESSORS, jump_bar, successors
from hippodrome.core.types import Float32Array, FloatArray, IntArray


class BeamLimits(NamedTuple):
    """What bounds the forward pass."""

    beam_nats: float  # beam width: a hypothesis this far behind the best of its step is dropped
    most_survivors: int  # about how many may survive a step
    enough_survivors: int  # the pass ends early once no more than these are left
    most_rows: int  # the pass ends early once this many hypotheses have survived, all steps together
    least_nats: float  # a hypothesis with a lower score is dropped, however good the others are


class Survivors(NamedTuple):
    """The hypotheses that survived each of t steps: step ``s`` owns rows ``row_start[s]:row_start[s + 1]``."""

    row_start: NDArray[np.int64]  # (t + 1,)
    hypotheses: Hypotheses
    places: Places  # of the hypotheses off the network
    died_out: bool  # whether the search ended because no hypothesis survived the step after the last


class Alternatives(NamedTuple):
    """Places other than the best route's: sample ``t`` owns rows ``row_start[t]:row_start[t + 1]``."""

    row_start: NDArray[np.int64]  # (T + 1,)
    points_m: Float32Array  # (rows, 2)
    through_nats: Float32Array  # (rows,) score of the best complete route through this place, less that of the best of all
    scale_bin: IntArray  # (rows,)


class _Scratch(NamedTuple):
    """Arrays that all steps use, so that no step has to allocate them; the two tables hold -1 everywhere between steps."""

    row_of_state: IntArray  # (N * K,) row of the hypothesis in each state, bin by bin
    index_of_lane: IntArray  # (L,) which of the hypotheses that leave the network is on each lane
    successors: Successors  # (MOST_SUCCESSORS,)
    scale_count: int  # K


@njit(cache=True, error_model="numpy")
def _make_scratch(model: SearchModel) -> _Scratch:
    """Allocate the memory that the steps share, with both tables set to -1."""
    scale_count = model.scales.shape[0]
    row_of_state = np.full(model.graph.lane.shape[0] * scale_count, -1, np.int32)
    index_of_lane = np.full(model.graph.lane.max() + 1, -1, np.int32)
    return _Scratch(row_of_state, index_of_lane, np.empty(MOST_SUCCESSORS, SUCCESSOR), scale_count)


@njit(cache=True, error_model="numpy", inline="always")
def _state(row: Any, scratch: _Scratch) -> int:
    """Number of the state, bin and scale bin, of a hypothesis on the network or of a successor."""
    return int(row.bin * scratch.scale_count + row.scale_bin)


@njit(cache=True, error_model="numpy")
def forward(drive: Drive, model: SearchModel, limits: BeamLimits, initial: Hypotheses, initial_places: Places) -> Survivors:
    """Beam search over the T samples of a drive, from the hypotheses at its first sample.

    Returns:
        The survivors of the t <= T samples searched; t < T if a limit was reached or no hypothesis was left.
    """
    samples = drive.heading_rad.shape[0]
    size, place_count = initial.shape[0], initial_places.shape[0]
    rows, places = with_room(initial, size + 1), with_room(initial_places, place_count + 1)
    row_start = np.zeros(samples + 1, np.int64)
    row_start[1] = size
    scratch, died_out = _make_scratch(model), False
    for t in range(1, samples):
        begin, end = row_start[t - 1], row_start[t]
        observation = observation_of_step(drive, t)
        rows, size, best = _step_on_network(rows, places, begin, end, observation, model, limits.beam_nats, scratch)
        rows, places = with_room(rows, size + MOST_OFF), with_room(places, place_count + MOST_OFF)
        filled = StepRows(begin, end, size, place_count)
        size, place_count, best = step_off_network(
            rows, places, filled, best, limits.beam_nats, observation, model, scratch.index_of_lane
        )
        least_nats = max(best - limits.beam_nats, limits.least_nats)
        row_start[t + 1] = end + _keep_best(rows[end:size], least_nats, limits.most_survivors)
        if row_start[t + 1] - end <= limits.enough_survivors or row_start[t + 1] >= limits.most_rows:
            died_out = row_start[t + 1] == end
            samples = t if died_out else t + 1
            break
    return Survivors(row_start[: samples + 1], rows[: row_start[samples]], places[:place_count], died_out)


@njit(cache=True, error_model="numpy")
def _step_on_network(
    rows: Hypotheses, places: Places, begin: int, end: int, observation: StepObservation, model: SearchModel, beam_nats: float,
    scratch: _Scratch,
) -> tuple[Hypotheses, int, float]:  # fmt: skip
    """Append the successors on the network of the hypotheses ``begin:end``, the best one of each state.

    Returns:
        The rows, moved if there was no room left, how many there are now, and the best score of the step.
    """
    lead = begin + index_of_best(rows[begin:end])
    jump_from = jump_bar(rows[begin:end], rows[lead].score_nats)
    size, best = end, NOWHERE
    for n in range(begin - 1, end):
        i = lead if n < begin else n  # the best goes first: what it leads to sets the bar for the others
        score = rows[i].score_nats
        if n == lead or score < best - beam_nats:
            continue
        rows = with_room(rows, size + MOST_SUCCESSORS)
        most_cost = score - best + beam_nats
        found = successors(rows[i], places, observation, model, score >= jump_from, most_cost, scratch.successors)
        size, best = _merge(rows, size, i, scratch.successors[:found], best, beam_nats, scratch)
    _forget_states(rows[end:size], scratch)
    return rows, size, best


@njit(cache=True, error_model="numpy")
def _merge(
    rows: Hypotheses, size: int, parent: int, found: Successors, best: float, beam_nats: float, scratch: _Scratch
) -> tuple[int, float]:
    """Append the successors of one hypothesis, unless a better hypothesis is in their state or they fall behind the beam.

    Returns the new number of rows and the best score of the step.
    """
    score = rows[parent].score_nats
    for c in range(found.shape[0]):
        total = score + found[c].log_likelihood
        if total < best - beam_nats:
            continue
        best = max(best, total)
        state = _state(found[c], scratch)
        at = scratch.row_of_state[state]
        if at < 0:
            at = size
            scratch.row_of_state[state] = at
            size += 1
        elif total <= rows[at].score_nats:
            continue
        row = rows[at]
        row.bin, row.scale_bin, row.parent, row.score_nats = found[c].bin, found[c].scale_bin, parent, total
        row.heading_offset_rad, row.remainder_m = found[c].heading_offset_rad, found[c].remainder_m
    return size, best


@njit(cache=True, error_model="numpy")
def _forget_states(hypotheses: Hypotheses, scratch: _Scratch) -> None:
    """Set the entries of these hypotheses in the table of states back to -1, for the next step."""
    for i in range(hypotheses.shape[0]):
        if hypotheses[i].bin >= 0:
            scratch.row_of_state[_state(hypotheses[i], scratch)] = -1


@njit(cache=True, error_model="numpy")
def _keep_best(hypotheses: Hypotheses, least_nats: float, most: int) -> int:
    """Move the hypotheses with at least ``least_nats``, about the ``most`` best of them, to the front; returns their number."""
    count = hypotheses.shape[0]
    if count > most:
        scores = np.empty(count, np.float32)
        for i in range(count):
            scores[i] = hypotheses[i].score_nats
        least_nats = max(least_nats, np.partition(scores, count - most)[count - most])
    kept = 0
    for i in range(count):
        if hypotheses[i].score_nats >= least_nats:
            hypotheses[kept] = hypotheses[i]
            kept += 1
    return kept


@njit(cache=True, error_model="numpy")
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
    row_start, rows, places, _ = survivors
    times = row_start.shape[0] - 1
    through = np.full(rows.shape[0], NOWHERE, np.float32)
    best = NOWHERE
    for i in range(row_start[times - 1], row_start[times]):
        through[i] = rows[i].score_nats + onward_nats[i - row_start[times - 1]]
        best = max(best, through[i])
    scratch = _make_scratch(model)
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
        _forget_states(rows[end : row_start[t + 1]], scratch)
    for i in range(rows.shape[0]):
        through[i] = through[i] - best if through[i] >= best - margin_nats else NOWHERE
    return through


@njit(cache=True, error_model="numpy")
def _prune_and_index(survivors: Survivors, through: Float32Array, t: int, least_nats: float, scratch: _Scratch) -> float:
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
            scratch.row_of_state[_state(rows[i], scratch)] = i
        else:
            through[rows[i].parent] = max(through[rows[i].parent], through[i])
    return most_onward


@njit(cache=True, error_model="numpy")
def _pass_back(rows: Hypotheses, through: Float32Array, i: int, found: Successors, scratch: _Scratch) -> None:
    """One step of the backward recursion: set ``through[i]`` to the score of the best complete route through hypothesis ``i``.

    A route through a successor scores what the route up to ``i`` scores, plus the log likelihood of the step, plus what the best
    route onward from the successor adds. Successors that did not survive are not in the table of states and are left out.
    """
    score = rows[i].score_nats
    for c in range(found.shape[0]):
        at = scratch.row_of_state[_state(found[c], scratch)]
        if at >= 0:
            through[i] = max(through[i], score + found[c].log_likelihood + (through[at] - rows[at].score_nats))


@njit(cache=True, error_model="numpy")
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
    return Alternatives(kept_start, points, values, scale_bin)


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
