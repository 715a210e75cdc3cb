"""What the lines of a road are: dashed or solid, and whether the road goes on beyond them."""

from __future__ import annotations

from typing import Final

import numba
import numpy as np

from hippodrome.core.types import Float32Array, FloatArray

LOOK_M: Final = 13.0  # ahead of the rear axle, up to which a line's gaps are looked at
BAND_M: Final = (0.26, 0.9)  # from a line's middle: what lies inside and outside of it
LONGEST_ROW_M: Final = 1.0  # of road that a row shows: far ones show more, of which a line need not fill all
MARGIN_PX: Final = 2.5  # a line nearer to the frame's side is cut by it


@numba.njit(cache=True)
def y_on_line(x: float, place: float, arc: FloatArray) -> float:
    """Where the line at the lateral place ``place`` of the rear axle lies, x metres ahead of it."""
    sin, cos = np.sin(arc[0]), np.cos(arc[0])
    y = (place + sin * x) / cos
    for _ in range(4):
        c = place + arc[2] * (cos * x + sin * y) ** 3 / 6.0
        y = (c + 0.5 * arc[1] * (x * x + y * y - c * c) + sin * x) / cos
    return float(y)


@numba.njit(cache=True)
def mean_between(levels: Float32Array, first: float, last: float, least_share: float) -> float:
    """Mean brightness between two columns; 0 where less than ``least_share`` of the way between them lies within the frame."""
    low, high = max(int(first + 0.5), 0), min(int(last + 0.5), len(levels) - 1)
    if high < low or high - low < least_share * (last - first):
        return 0.0
    total = 0.0
    for k in range(low, high + 1):
        total += levels[k]
    return total / (high - low + 1)


@numba.njit(cache=True)
def line_traits(
    grey: Float32Array,
    x_m: Float32Array,
    y_m: Float32Array,
    ridges: FloatArray,
    owner: FloatArray,
    arc: FloatArray,
    places: FloatArray,
) -> FloatArray:
    """Of each line (K, 6): rows in which it would be seen, rows in which it is, the length (m) that they cover, the
    nearest and farthest x (m) where it is seen, and the brightness on its left as a share of that on its right.
    """
    count, width = grey.shape
    lines = len(places)
    traits = np.zeros((lines, 6))
    hit = np.zeros((lines, count), np.bool_)
    for i in range(len(ridges)):
        if owner[i] >= 0 and ridges[i, 4] >= 0:
            hit[int(owner[i]), int(ridges[i, 4])] = True
    for k in range(lines):
        traits[k, 3], traits[k, 5] = np.inf, 1.0
        ratio, compared = 0.0, 0
        for row in range(count):
            x = 0.5 * (x_m[row, 0] + x_m[row, width - 1])
            y = y_on_line(x, places[k], arc)
            metres = (y_m[row, 0] - y_m[row, width - 1]) / (width - 1)
            u = (y_m[row, 0] - y) / metres
            if not MARGIN_PX < u < width - 1 - MARGIN_PX:
                continue
            if x > LOOK_M:
                break
            spacing = abs(x - 0.5 * (x_m[max(row - 1, 0), 0] + x_m[max(row - 1, 0), width - 1]))
            traits[k, 0] += 1.0
            if hit[k, row]:
                traits[k, 1] += 1.0
                traits[k, 3] = min(traits[k, 3], x)
                traits[k, 4] = max(traits[k, 4], x)
                traits[k, 2] += min(spacing, LONGEST_ROW_M)
                left = mean_between(grey[row], u - BAND_M[1] / metres, u - BAND_M[0] / metres, 0.5)
                right = mean_between(grey[row], u + BAND_M[0] / metres, u + BAND_M[1] / metres, 0.5)
                if left > 0.0 and right > 0.0:
                    ratio += np.log(left / right)
                    compared += 1
        if compared > 0:
            traits[k, 5] = np.exp(ratio / compared)
    return traits
