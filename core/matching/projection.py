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
    """Project the vertices of a driven path onto its route's line, so that they stay in driving order.

    Each vertex may be projected onto the samples of the line around its present place. One sample for each is chosen by dynamic
    programming: vertices should lie near their samples, and steps on the line should be as long as the driven ones. From the
    sample the projection moves on to the foot of the perpendicular.

    Args:
        line: the route's line.
        points_m: (S, 2) the vertices in driving order.
        arc_m: (S,) present arc length of each vertex on the line.
        reach_m: how far along the line a projection may move from the present arc length.

    Returns:
        New arc length (S,) of each vertex on the line.
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
    """The cheapest choice of one sample for each of S vertices, by the Viterbi algorithm: its index (S,) among W samples.

    Args:
        cost: (S, W) cost of projecting each vertex onto each of its W samples of the line.
        arc: (S, W) arc length of each sample.
        driven: (S - 1,) metres driven between consecutive vertices; a step of ``arc`` that differs from them costs, too.
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
    """The cheapest step from a sample of vertex ``i - 1`` to sample ``j`` of vertex ``i``: the cost so far, and that sample."""
    sigma = _STEP_SIGMA_M + _STEP_SHARE * driven_m
    best, column = np.inf, 0
    for k in range(arc.shape[1]):
        error = (arc[i, j] - arc[i - 1, k] - driven_m) / sigma
        candidate = total[k] + 0.5 * error * error
        if candidate < best:
            best, column = candidate, k
    return best, column
