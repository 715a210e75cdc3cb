"""Projection of a driven path onto its route's line, in driving order.

The nearest point alone will not do: on a road driven out and back, vertices near the U-turn would jump to the other lane, the
line's end would be skipped, and nothing would hold the path lengthwise. So the arc length must also grow as the vehicle drives.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from hippodrome.core.matching.route_line import RouteLine
from hippodrome.core.types import FloatArray, IntArray

_OFF_LINE_M = 1.0  # sigma of the distance from the line, beyond which ..
_OFF_LINE_LIMIT = 8.0  # .. at 4 sigmas (a lane and a half) it no longer counts: the vehicle is elsewhere
_STEP_SIGMA_M = 0.5  # of the driven length between neighbours: corners cut or swung out ..
_STEP_SHARE = 0.1  # .. and the error of its scale


def reproject(line: RouteLine, points_m: FloatArray, arc_m: FloatArray, reach_m: float) -> FloatArray:
    """Arc length (S,) on the line of each point (S, 2), at most ``reach_m`` from the present one ``arc_m``."""
    spacing = (line.arc_m[-1] - line.arc_m[0]) / max(len(line.arc_m) - 1, 1)
    half = int(np.ceil(reach_m / spacing))
    window = np.searchsorted(line.arc_m, arc_m)[:, None] + np.arange(-half, half + 1)
    index = np.clip(window, 0, len(line.arc_m) - 1)
    gap = points_m[:, None] - line.points_m[index]
    off_line = np.minimum(0.5 * np.sum(gap**2, axis=2) / _OFF_LINE_M**2, _OFF_LINE_LIMIT)
    driven = np.hypot(*np.diff(points_m, axis=0).T)
    best = index[np.arange(len(index)), _in_order(off_line, line.arc_m[index], driven)]
    cos, sin = np.cos(line.heading_rad[best]), np.sin(line.heading_rad[best])
    off = points_m - line.points_m[best]
    ahead = np.clip(cos * off[:, 0] + sin * off[:, 1], -spacing, spacing)
    nearest: FloatArray = line.arc_m[best] + ahead
    return nearest


@njit(cache=True)
def _in_order(cost: FloatArray, arc: FloatArray, driven: FloatArray) -> IntArray:
    """The cheapest column (S,) for each row, steps of ``arc`` being held to the ``driven`` (S - 1,) metres (Viterbi)."""
    rows, columns = cost.shape
    total, parent = cost[0].copy(), np.zeros((rows, columns), np.int32)
    for i in range(1, rows):
        sigma = _STEP_SIGMA_M + _STEP_SHARE * driven[i - 1]
        following = np.empty(columns)
        for j in range(columns):
            best, at = np.inf, 0
            for k in range(columns):
                error = (arc[i, j] - arc[i - 1, k] - driven[i - 1]) / sigma
                candidate = total[k] + 0.5 * error * error
                if candidate < best:
                    best, at = candidate, k
            following[j], parent[i, j] = best + cost[i, j], at
        total = following
    column = np.empty(rows, np.int32)
    column[-1] = np.argmin(total)
    for i in range(rows - 1, 0, -1):
        column[i - 1] = parent[i, column[i]]
    return column
