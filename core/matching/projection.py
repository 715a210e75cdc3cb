"""Projection of a driven path onto its route's line, in driving order.

The nearest point alone will not do: on a road driven out and back, vertices near the U-turn would jump to the other lane, the
line's end would be skipped, and nothing would hold the path lengthwise. So the arc length must also grow as the vehicle drives.
All vertices are projected together by dynamic programming over a band of the line's samples around each vertex's present place,
as sequences are aligned by time warping within a band (H. Sakoe, S. Chiba, "Dynamic programming algorithm optimization for spoken
word recognition", 1978).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from hippodrome.core.matching.route_line import RouteLine
from hippodrome.core.types import FloatArray, IntArray

_OFF_LINE_M = 1.0  # sigma of a vertex's distance from the line
_OFF_LINE_LIMIT = 8.0  # most that this distance costs, reached at 4 sigmas (a lane and a half): the vertex is elsewhere
_STEP_SIGMA_M = 0.5  # sigma of the driven length between two vertices, for corners that are cut or swung out ...
_STEP_SHARE = 0.1  # ... and this share of that length more, for the error of its scale


def reproject(line: RouteLine, points_m: FloatArray, arc_m: FloatArray, reach_m: float) -> FloatArray:
    """Project consecutive points onto a line, in driving order.

    Args:
        line: the route's line.
        points_m: (S, 2) the points.
        arc_m: (S,) present arc length of each point on the line.
        reach_m: the projection lies within this arc length of the present one.

    Returns:
        Arc length (S,) of each projection on the line.
    """
    spacing = (line.arc_m[-1] - line.arc_m[0]) / max(len(line.arc_m) - 1, 1)
    half_band = int(np.ceil(reach_m / spacing))
    window = np.searchsorted(line.arc_m, arc_m)[:, None] + np.arange(-half_band, half_band + 1)
    band = np.clip(window, 0, len(line.arc_m) - 1)
    gap = points_m[:, None] - line.points_m[band]
    off_line = np.minimum(0.5 * np.sum(gap**2, axis=2) / _OFF_LINE_M**2, _OFF_LINE_LIMIT)
    driven = np.hypot(*np.diff(points_m, axis=0).T)
    best = band[np.arange(len(band)), _cheapest_path(off_line, line.arc_m[band], driven)]
    cos, sin = np.cos(line.heading_rad[best]), np.sin(line.heading_rad[best])
    off = points_m - line.points_m[best]
    ahead = np.clip(cos * off[:, 0] + sin * off[:, 1], -spacing, spacing)  # from the best sample to the perpendicular's foot
    nearest: FloatArray = line.arc_m[best] + ahead
    return nearest


@njit(cache=True)
def _cheapest_path(cost: FloatArray, arc: FloatArray, driven: FloatArray) -> IntArray:
    """The column (S,) of each row on the cheapest path through the band, by the Viterbi algorithm.

    Args:
        cost: (S, W) cost of each sample of the band.
        arc: (S, W) arc length of each sample.
        driven: (S - 1,) metres between consecutive rows; steps of ``arc`` that differ from them cost, too.
    """
    rows, columns = cost.shape
    total, parent = cost[0].copy(), np.zeros((rows, columns), np.int32)
    for i in range(1, rows):
        following = np.empty(columns)
        for j in range(columns):
            best, parent[i, j] = _cheapest_step(total, arc, i, j, driven[i - 1])
            following[j] = best + cost[i, j]
        total = following
    column = np.empty(rows, np.int32)
    column[-1] = np.argmin(total)
    for i in range(rows - 1, 0, -1):
        column[i - 1] = parent[i, column[i]]
    return column


@njit(cache=True, inline="always")
def _cheapest_step(total: FloatArray, arc: FloatArray, i: int, j: int, driven_m: float) -> tuple[float, int]:
    """Cheapest way to sample ``j`` of row ``i``: its cost, and the column of row ``i - 1`` that it comes from."""
    sigma = _STEP_SIGMA_M + _STEP_SHARE * driven_m
    best, column = np.inf, 0
    for k in range(arc.shape[1]):
        error = (arc[i, j] - arc[i - 1, k] - driven_m) / sigma
        candidate = total[k] + 0.5 * error * error
        if candidate < best:
            best, column = candidate, k
    return best, column
