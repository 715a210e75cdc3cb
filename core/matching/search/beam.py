"""The compiled search forward in time: a beam search.

This is the Viterbi algorithm with pruning, known as beam search (B. Lowerre, "The HARPY speech recognition system", 1976): of the
hypotheses in one state only the best is kept, and those that fall behind the best of their step by more than the beam are
dropped. A hypothesis carries two values beside its state (see ``hypotheses``). They make the search exact in length and invariant
to translation and rotation, at the price that they are those of the best route to the state, as in a particle filter.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.matching.search.hypotheses import NOWHERE, Hypotheses, Places, Successors, index_of_best, with_room
from hippodrome.core.matching.search.model import Drive, SearchModel, StepObservation, observation_of_step
from hippodrome.core.matching.search.off_network import MOST_OFF, StepRows, step_off_network
from hippodrome.core.matching.search.states import Scratch, empty_states, forget_states, make_scratch, state_of
from hippodrome.core.matching.search.successors import MOST_SUCCESSORS, jump_bar, successors
from hippodrome.core.types import FloatArray, IntArray

MANY_ROWS = 250_000  # 6 MB: a search that keeps more may keep up to its limit, and has the room for that at once


class BeamLimits(NamedTuple):
    """What bounds the forward pass."""

    beam_nats: float  # beam width: a hypothesis this far behind the best of its step is dropped
    most_survivors: int  # about how many may survive a step
    enough_survivors: int  # the pass ends early once no more than these are left
    most_rows: int  # the pass ends early once this many hypotheses have survived, all steps together
    least_nats: FloatArray  # (T,) a hypothesis with a lower score at its sample is dropped, however good the others are


class Survivors(NamedTuple):
    """The hypotheses that survived each of t steps: step ``s`` owns rows ``row_start[s]:row_start[s + 1]``."""

    row_start: NDArray[np.int64]  # (t + 1,)
    hypotheses: Hypotheses
    places: Places  # of the hypotheses off the network
    died_out: bool  # whether the search ended because no hypothesis survived the step after the last


def forward(drive: Drive, model: SearchModel, limits: BeamLimits, initial: Hypotheses, initial_places: Places) -> Survivors:
    """Beam search over the T samples of a drive, from the hypotheses at its first sample.

    Returns:
        The survivors of the t <= T samples searched; t < T if a limit was reached or no hypothesis was left.
    """
    return Survivors(*_forward(drive, model, limits, initial, initial_places, empty_states(model)))


@njit(cache=True, error_model="numpy")
def _forward(
    drive: Drive, model: SearchModel, limits: BeamLimits, initial: Hypotheses, initial_places: Places, empty: IntArray
) -> tuple[NDArray[np.int64], Hypotheses, Places, bool]:
    """As ``forward``, with the empty table of states; the fields of ``Survivors``."""
    samples = drive.heading_rad.shape[0]
    size, place_count = initial.shape[0], initial_places.shape[0]
    rows, places = with_room(initial, size + 1), with_room(initial_places, place_count + 1)
    row_start = np.zeros(samples + 1, np.int64)
    row_start[1] = size
    scratch, died_out = make_scratch(model, empty), False
    for t in range(1, samples):
        begin, end = row_start[t - 1], row_start[t]
        if end > MANY_ROWS:  # room costs nothing until it is written to; while it doubled, the old and the new were 300 MB
            rows = with_room(rows, limits.most_rows + limits.most_rows // 2)
        observation = observation_of_step(drive, t)
        rows, size, best = _step_on_network(rows, places, begin, end, observation, model, limits.beam_nats, scratch)
        rows, places = with_room(rows, size + MOST_OFF), with_room(places, place_count + MOST_OFF)
        filled = StepRows(begin, end, size, place_count)
        size, place_count, best = step_off_network(
            rows, places, filled, best, limits.beam_nats, observation, model, scratch.index_of_lane
        )
        least_nats = max(best - limits.beam_nats, limits.least_nats[t])
        row_start[t + 1] = end + _keep_best(rows[end:size], least_nats, limits.most_survivors)
        if row_start[t + 1] - end <= limits.enough_survivors or row_start[t + 1] >= limits.most_rows:
            died_out = row_start[t + 1] == end
            samples = t if died_out else t + 1
            break
    return row_start[: samples + 1], rows[: row_start[samples]], places[:place_count], died_out


@njit(cache=True, error_model="numpy")
def _step_on_network(
    rows: Hypotheses, places: Places, begin: int, end: int, observation: StepObservation, model: SearchModel, beam_nats: float,
    scratch: Scratch,
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
    forget_states(rows[end:size], scratch)
    return rows, size, best


@njit(cache=True, error_model="numpy")
def _merge(
    rows: Hypotheses, size: int, parent: int, found: Successors, best: float, beam_nats: float, scratch: Scratch
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
        state = state_of(found[c], scratch)
        at = scratch.number_of_state[state] - 1
        if at < 0:
            at = size
            size += 1
            scratch.number_of_state[state] = size
        elif total <= rows[at].score_nats:
            continue
        row = rows[at]
        row.bin, row.scale_bin, row.parent, row.score_nats = found[c].bin, found[c].scale_bin, parent, total
        row.heading_offset_rad, row.remainder_m = found[c].heading_offset_rad, found[c].remainder_m
    return size, best


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
