"""Hypotheses off the network, compiled: who may leave it, and where those that left may come back.

They move by dead reckoning, from where the route was well known to near where a lane is taken up again.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

# What the callers of a compiled function must keep in order; numba takes tuples, not dataclasses.
Tables: TypeAlias = tuple[Any, ...]  # reach_start, reach_bin, reach_m, reach_changes, bin heading, bin lane, bin points
Costs: TypeAlias = tuple[float, ...]  # heading sigma, its limit, gain, half a bin, length sigma, scale step and jump, lane change
OffNetwork: TypeAlias = tuple[Any, ...]  # see ``expand_off``; then leave (nats), per step (nats), spread (nats)

_KNOWN_LANES = 30  # good hypotheses on more lanes than this: the route is not known, so nothing can be said to leave the network


@njit(cache=True, inline="always")
def wrap(angle: float) -> float:
    """An angle into [-pi, pi]; the callers' sums lie within a few turns, where this is far quicker than a modulo."""
    while angle > math.pi:
        angle -= 2.0 * math.pi
    while angle < -math.pi:
        angle += 2.0 * math.pi
    return angle


@njit(cache=True)
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
            turn = wrap(bin_heading[bin_] - heading - offset)
            if gap_sq > radius * radius or abs(turn) > turn_limit:
                continue
            if count == out.shape[0]:
                return count
            out[count, 0] = bin_
            out[count, 1] = k
            out[count, 2] = -(enter + 0.5 * gap_sq / spread**2 + min(0.5 * (turn / sigma) ** 2, limit))
            out[count, 3] = wrap(offset + gain * min(max(turn, -3.0 * sigma), 3.0 * sigma))
            out[count, 4] = 0.0
            count += 1
    return count


@njit(cache=True)
def leavers(
    begin: int, end: int, bin_: NDArray[Any], score: NDArray[Any], spread: float, lane: NDArray[Any], slot: NDArray[Any]
) -> NDArray[Any]:
    """The best survivor on each lane, among those within ``spread`` of the best; none if these are on too many lanes."""
    best = -math.inf
    for i in range(begin, end):
        best = max(best, score[i])
    rows, count = np.empty(_KNOWN_LANES, np.int64), 0
    known = True
    for i in range(begin, end):
        if bin_[i] < 0 or score[i] < best - spread:
            continue
        at = slot[lane[bin_[i]]]
        if at >= 0:
            if score[i] > score[rows[at]]:
                rows[at] = i
        elif count == _KNOWN_LANES:
            known = False
            break
        else:
            slot[lane[bin_[i]]] = count
            rows[count] = i
            count += 1
    for c in range(count):
        slot[lane[bin_[rows[c]]]] = -1
    return rows[:count] if known else rows[:0]
