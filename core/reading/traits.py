"""What the lines of a road are: dashed or solid, and whether the road goes on beyond them."""

from __future__ import annotations

from typing import Final

import numba
import numpy as np

from hippodrome.core.types import Float32Array, FloatArray

LOOK_M: Final = 13.0  # ahead of the rear axle, up to which a line's gaps are looked at
BAND_M: Final = (0.26, 0.9)  # from a line's middle: what lies inside and outside of it
MARGIN_PX: Final = 2.5  # a line nearer to the frame's side is cut by it


@numba.njit(cache=True)  # type: ignore[misc]  # numba is untyped
def y_on_circle(x: float, place: float, sin: float, cos: float, bend: float) -> float:
    """Where the concentric line at the lateral place ``place`` of the rear axle lies, x metres ahead of it."""
    y = (place + sin * x) / cos
    for _ in range(4):
        y = (place - 0.5 * bend * place * place + 0.5 * bend * (x * x + y * y) + sin * x) / cos
    return y


@numba.njit(cache=True)  # type: ignore[misc]  # numba is untyped
def line_traits(
    grey: Float32Array,
    x_m: Float32Array,
    y_m: Float32Array,
    ridges: FloatArray,
    owner: FloatArray,
    arc: FloatArray,
    places: FloatArray,
) -> FloatArray:
    """Of each line (K, 6): rows in which it would be seen, rows in which it is, the longest stretch (m) without a gap, the
    nearest and farthest x (m) where it is seen, and the brightness on its left as a share of that on its right.
    """
    count, width = grey.shape
    lines = len(places)
    traits = np.zeros((lines, 6))
    sin, cos = np.sin(arc[0]), np.cos(arc[0])
    hit = np.zeros((lines, count), np.bool_)
    for i in range(len(ridges)):
        if owner[i] >= 0:
            hit[int(owner[i]), int(ridges[i, 4])] = True
    for k in range(lines):
        traits[k, 3], traits[k, 5] = np.inf, 1.0
        left = right = 0.0
        begun, last, missed = -1.0, 0.0, 0
        for row in range(count):
            x = 0.5 * (x_m[row, 0] + x_m[row, width - 1])
            y = y_on_circle(x, places[k], sin, cos, arc[1])
            metres = (y_m[row, 0] - y_m[row, width - 1]) / (width - 1)
            u = (y_m[row, 0] - y) / metres
            if not MARGIN_PX < u < width - 1 - MARGIN_PX:
                continue
            if x < LOOK_M:
                traits[k, 0] += 1.0
            if hit[k, row]:
                if x < LOOK_M:
                    traits[k, 1] += 1.0
                traits[k, 3] = min(traits[k, 3], x)
                traits[k, 4] = max(traits[k, 4], x)
                if begun < 0.0:
                    begun = x
                last, missed = x, 0
                traits[k, 2] = max(traits[k, 2], last - begun)
                for side in (-1, 1):
                    near = int(u + side * BAND_M[0] / metres + 0.5)
                    far = int(u + side * BAND_M[1] / metres + 0.5)
                    value, number = 0.0, 0
                    for j in range(max(min(near, far), 0), min(max(near, far), width - 1) + 1):
                        value += grey[row, j]
                        number += 1
                    if number == 0:
                        continue
                    if side < 0:
                        left += np.log(max(value / number, 1.0))
                    else:
                        right += np.log(max(value / number, 1.0))
            else:
                missed += 1
                if missed > 1:
                    begun = -1.0
        seen = max(traits[k, 1], 1.0)
        traits[k, 5] = np.exp((left - right) / seen)
    return traits
