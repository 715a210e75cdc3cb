"""The compiled search behind ``route_search``: a beam over hypotheses forward in time, and what each led to backward.

What a hypothesis carries beside its state (``hypotheses``) makes the search exact in length over any number of bins and invariant
to translation and rotation, at the price that it follows the survivor (as in any particle-like Viterbi).
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.matching.search.hypotheses import (
    NOWHERE,
    Costs,
    OffNetwork,
    OffRows,
    Rows,
    Tables,
    put,
    with_room,
)
from hippodrome.core.matching.search.off_network import MOST_OFF, drive_off
from hippodrome.core.matching.search.successors import (
    MOST_SUCCESSORS,
    jump_bar,
    moment_at,
    successors,
)

Survivors: TypeAlias = tuple[NDArray[Any], Rows, OffRows]  # row_start (t + 1,), rows, rows off the network


@njit(cache=True, error_model="numpy")
def forward(
    headings: NDArray[Any], places: NDArray[Any], step: float, scales: NDArray[Any], tables: Tables, costs: Costs,
    off: OffNetwork, limits: tuple[float, int, int, int], seeds: Rows, off_seeds: OffRows,
) -> Survivors:  # fmt: skip
    """Beam search over T headings and (known) places (T, 3), from hypotheses at heading 0.

    ``limits``: the beam (nats), about how many may survive a step, how few are enough to end early, and at how many rows in all
    to end. Returns the survivors of the t <= T steps searched.
    """
    beam, most, enough, budget = limits
    times, scale_count, lane = headings.shape[0], scales.shape[0], tables[5]
    size, off_size = seeds.shape[0], off_seeds.shape[0]
    rows, off_rows = with_room(seeds, size + 1), with_room(off_seeds, off_size + 1)
    row_start = np.zeros(times + 1, np.int64)
    row_start[1] = size
    slot = np.full((tables[0].shape[0] - 1) * scale_count, -1, np.int32)
    lane_slot = np.full(lane.max() + 1, -1, np.int32)
    out = np.empty((MOST_SUCCESSORS, 5))
    for t in range(1, times):
        begin, end = row_start[t - 1], row_start[t]
        moment = moment_at(headings, places, step, t)
        jump_from, lead = jump_bar(rows[begin:end])
        size, best = end, NOWHERE
        for n in range(-1, end - begin):
            i = begin + (lead if n < 0 else n)  # the best goes first: what it leads to sets the bar for the others
            score = rows[i].score
            if n == lead or score < best - beam:
                continue
            rows = with_room(rows, size + MOST_SUCCESSORS)
            most_cost = score - best + beam
            found = successors(rows[i], off_rows, moment, scales, tables, costs, off, score >= jump_from, most_cost, out)
            for c in range(found):
                total = score + out[c, 2]
                if total < best - beam:
                    continue
                best = max(best, total)
                state = int(out[c, 0]) * scale_count + int(out[c, 1])
                at = slot[state]
                if at < 0:
                    at = size
                    slot[state] = at
                    size += 1
                elif total <= rows[at].score:
                    continue
                put(rows, at, int(out[c, 0]), int(out[c, 1]), i, total, out[c, 3], out[c, 4])
        for i in range(end, size):
            slot[rows[i].bin * scale_count + rows[i].k] = -1
        rows, off_rows = with_room(rows, size + MOST_OFF), with_room(off_rows, off_size + MOST_OFF)
        span = (begin, end, size, off_size)
        size, off_size, best = drive_off(rows, off_rows, span, best, beam, moment, scales, tables, off, lane_slot)
        row_start[t + 1] = end + keep_best(rows[end:size], best - beam, most)
        if row_start[t + 1] - end <= enough or row_start[t + 1] >= budget:
            times = t + 1 if row_start[t + 1] > end else t
            break
    return row_start[: times + 1], rows[: row_start[times]], off_rows[:off_size]


@njit(cache=True, error_model="numpy")
def keep_best(rows: Rows, bar: float, most: int) -> int:
    """Move rows that score ``bar`` or more, about the ``most`` best of them, to the front; counted."""
    if rows.shape[0] > most:
        scores = np.empty(rows.shape[0], np.float32)
        for i in range(rows.shape[0]):
            scores[i] = rows[i].score
        bar = max(bar, np.partition(scores, rows.shape[0] - most)[rows.shape[0] - most])
    kept = 0
    for i in range(rows.shape[0]):
        if rows[i].score >= bar:
            rows[kept] = rows[i]
            kept += 1
    return kept


@njit(cache=True, error_model="numpy")
def backward(
    headings: NDArray[Any], places: NDArray[Any], step: float, scales: NDArray[Any], tables: Tables, costs: Costs,
    off: OffNetwork, margin: float, survivors: Survivors, onward: NDArray[Any],
) -> NDArray[Any]:  # fmt: skip
    """How far (rows,) the best complete route through each survivor falls behind the best of all; ``NOWHERE`` beyond ``margin``.

    ``onward``: what the survivors of the last step still lead to, nats.
    """
    row_start, rows, off_rows = survivors
    times, scale_count = row_start.shape[0] - 1, scales.shape[0]
    through = np.full(rows.shape[0], NOWHERE, np.float32)
    best = NOWHERE
    for i in range(row_start[times - 1], row_start[times]):
        through[i] = rows[i].score + onward[i - row_start[times - 1]]
        best = max(best, through[i])
    slot = np.full((tables[0].shape[0] - 1) * scale_count, -1, np.int32)
    out = np.empty((MOST_SUCCESSORS, 5))
    for t in range(times - 1, 0, -1):
        begin, end = row_start[t], row_start[t + 1]
        moment = moment_at(headings, places, step, t)
        jump_from, _ = jump_bar(rows[row_start[t - 1] : begin])
        most_onward = NOWHERE
        for i in range(begin, end):
            if through[i] < best - margin:
                through[i] = NOWHERE
                continue
            most_onward = max(most_onward, through[i] - rows[i].score)
            if rows[i].bin >= 0:
                slot[rows[i].bin * scale_count + rows[i].k] = i
            else:
                through[rows[i].parent] = max(through[rows[i].parent], through[i])
        for i in range(row_start[t - 1], begin):
            score = rows[i].score
            most_cost = score + most_onward - best + margin
            if most_cost < 0.0:
                continue
            found = successors(rows[i], off_rows, moment, scales, tables, costs, off, score >= jump_from, most_cost, out)
            for c in range(found):
                at = slot[int(out[c, 0]) * scale_count + int(out[c, 1])]
                if at >= 0:
                    through[i] = max(through[i], score + out[c, 2] + (through[at] - rows[at].score))
        for i in range(begin, end):
            if rows[i].bin >= 0:
                slot[rows[i].bin * scale_count + rows[i].k] = -1
    for i in range(rows.shape[0]):
        through[i] = through[i] - best if through[i] >= best - margin else NOWHERE
    return through


@njit(cache=True, error_model="numpy")
def alternatives(
    survivors: Survivors, through: NDArray[Any], points: NDArray[Any], cell: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Of the survivors that lead somewhere, the best one in each cell (N,) of the lanes at each step, and all off the network.

    Returns row_start (t + 1,), points (rows, 2) and through (rows,).
    """
    row_start, rows, off_rows = survivors
    times, count = row_start.shape[0] - 1, 0
    for i in range(rows.shape[0]):
        count += through[i] > NOWHERE
    kept_start, kept = np.zeros(times + 1, np.int64), np.empty(count, np.int32)
    slot = np.full(cell.max() + 1, -1, np.int32)
    size = 0
    for t in range(times):
        for i in range(row_start[t], row_start[t + 1]):
            if through[i] == NOWHERE:
                continue
            at = slot[cell[rows[i].bin]] if rows[i].bin >= 0 else -1
            if at < 0:
                at, size = size, size + 1
                if rows[i].bin >= 0:
                    slot[cell[rows[i].bin]] = at
            elif through[i] <= through[kept[at]]:
                continue
            kept[at] = i
        for j in range(kept_start[t], size):
            if rows[kept[j]].bin >= 0:
                slot[cell[rows[kept[j]].bin]] = -1
        kept_start[t + 1] = size
    places, values = np.empty((size, 2), np.float32), np.empty(size, np.float32)
    for j in range(size):
        row = rows[kept[j]]
        values[j] = through[kept[j]]
        if row.bin >= 0:
            places[j, 0], places[j, 1] = points[row.bin, 0], points[row.bin, 1]
        else:
            places[j, 0], places[j, 1] = off_rows[-1 - row.bin].x, off_rows[-1 - row.bin].y
    return kept_start, places, values
