"""Hypotheses off the network, compiled: who may leave it, and where those that left may come back.

They move by dead reckoning, from where the route was well known to near where a lane is taken up again.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.matching.search.hypotheses import (
    NOWHERE,
    Costs,
    Moment,
    OffNetwork,
    OffRows,
    Rows,
    Tables,
    put,
)
from hippodrome.core.se2 import wrap_near_zero

Place: TypeAlias = tuple[float, float, float]

MOST_OFF = 192  # hypotheses off the network in one step; beyond this the worst gives way
_SAME_PLACE_M = 4.0  # closer than this, two hypotheses off the network count as one
_SAME_OFFSET_RAD = 0.3
_KNOWN_LANES = 30  # good hypotheses on more lanes than this: the route is not known, so nothing can be said to leave the network


@njit(cache=True, error_model="numpy")
def expand_off(
    x: float,
    y: float,
    away: float,
    k: int,
    offset: float,
    heading: float,
    tables: Tables,
    costs: Costs,
    off: OffNetwork,
    out: NDArray[Any],
) -> int:
    """Bins on which a hypothesis at (x, y) may come back to the network, counted; rows of ``out`` as in ``expand``."""
    bin_heading, sigma, limit, gain = tables[4], costs[0], costs[1], costs[2]
    points, cell_start, cell_bin, origin_x, origin_y, cell_m, columns, rows, enter, drift, turn_limit = off[:11]
    spread = 2.0 + drift * away
    radius = 2.5 * spread
    count = 0
    column_0 = max(int((x - radius - origin_x) / cell_m), 0)
    column_1 = min(int((x + radius - origin_x) / cell_m), columns - 1)
    if column_0 > column_1:
        return 0
    row_0 = max(int((y - radius - origin_y) / cell_m), 0)
    row_1 = min(int((y + radius - origin_y) / cell_m), rows - 1)
    for row in range(row_0, row_1 + 1):
        for c in range(cell_start[row * columns + column_0], cell_start[row * columns + column_1 + 1]):
            bin_ = cell_bin[c]
            gap_sq = (points[bin_, 0] - x) ** 2 + (points[bin_, 1] - y) ** 2
            turn = wrap_near_zero(bin_heading[bin_] - heading - offset)
            if gap_sq > radius * radius or abs(turn) > turn_limit:
                continue
            if count == out.shape[0]:
                return count
            out[count, 0] = bin_
            out[count, 1] = k
            out[count, 2] = -(enter + 0.5 * gap_sq / spread**2 + min(0.5 * (turn / sigma) ** 2, limit))
            out[count, 3] = wrap_near_zero(offset + gain * min(max(turn, -3.0 * sigma), 3.0 * sigma))
            out[count, 4] = 0.0
            count += 1
    return count


@njit(cache=True, error_model="numpy")
def move_off(row: Any, off_rows: OffRows, moment: Moment, scales: NDArray[Any], points: NDArray[Any]) -> Place:
    """Where dead reckoning takes a hypothesis over one step: x, y, metres driven since it left the network."""
    _, course, step, _, _, _ = moment
    far = step * scales[row.k]
    x, y = far * math.cos(course + row.offset), far * math.sin(course + row.offset)
    if row.bin >= 0:
        return x + points[row.bin, 0], y + points[row.bin, 1], far
    left = off_rows[-1 - row.bin]
    return x + left.x, y + left.y, far + left.away


@njit(cache=True, error_model="numpy")
def drive_off(
    rows: Rows, off_rows: OffRows, span: tuple[int, int, int, int], best: float, beam: float, moment: Moment,
    scales: NDArray[Any], tables: Tables, off: OffNetwork, lane_slot: NDArray[Any],
) -> tuple[int, int, float]:  # fmt: skip
    """Add the hypotheses that are off the network after a step: those that were before it, and those that leave now.

    ``span``: rows before the step (begin, end), rows in all, rows off the network; both arrays have room for ``MOST_OFF`` more.
    Returns the new counts and the best score.
    """
    begin, end, size, off_size = span
    first, points, lane, leave_cost, step_cost, spread = size, off[0], tables[5], off[11], off[12], off[13]
    going = leavers(rows[begin:end], spread, lane, lane_slot)
    for n in range(begin, end + going.shape[0]):
        i = n if n < end else begin + going[n - end]
        row = rows[i]
        if n < end and row.bin >= 0:
            continue
        total = row.score - step_cost - (0.0 if row.bin < 0 else leave_cost)
        if total < best - beam:
            continue
        best = max(best, total)
        x, y, away = move_off(row, off_rows, moment, scales, points)
        at, worst = -1, first
        for other in range(first, size):
            there = off_rows[-1 - rows[other].bin]
            if (
                abs(there.x - x) + abs(there.y - y) < _SAME_PLACE_M
                and abs(wrap_near_zero(rows[other].offset - row.offset)) < _SAME_OFFSET_RAD
            ):
                at = other
            worst = other if rows[other].score < rows[worst].score else worst
        if at < 0 and size - first == MOST_OFF:
            at = worst
        if at < 0:
            at, size, off_size = size, size + 1, off_size + 1
            rows[at].bin = -off_size
        elif total <= rows[at].score:
            continue
        j = -1 - rows[at].bin
        off_rows[j].x, off_rows[j].y, off_rows[j].away = x, y, away
        put(rows, at, -1 - j, row.k, i, total, row.offset, 0.0)
    return size, off_size, best


@njit(cache=True, error_model="numpy")
def leavers(rows: Rows, spread: float, lane: NDArray[Any], slot: NDArray[Any]) -> NDArray[Any]:
    """The best row on each lane, among those within ``spread`` of the best; none if these are on too many lanes."""
    best = NOWHERE
    for i in range(rows.shape[0]):
        best = max(best, rows[i].score)
    found, count = np.empty(_KNOWN_LANES, np.int64), 0
    known = True
    for i in range(rows.shape[0]):
        if rows[i].bin < 0 or rows[i].score < best - spread:
            continue
        at = slot[lane[rows[i].bin]]
        if at >= 0:
            if rows[i].score > rows[found[at]].score:
                found[at] = i
        elif count == _KNOWN_LANES:
            known = False
            break
        else:
            slot[lane[rows[i].bin]] = count
            found[count] = i
            count += 1
    for c in range(count):
        slot[lane[rows[found[c]].bin]] = -1
    return found[:count] if known else found[:0]
