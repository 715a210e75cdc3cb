"""The stop line: a bar of paint across the lane, as deep as stop lines are, with road before and behind it."""

from __future__ import annotations

from typing import Final

import numba
import numpy as np

from hippodrome.core.reading.traits import y_on_line
from hippodrome.core.types import Float32Array, FloatArray

STRIP: Final = 0.36  # half the width of the strip that is looked at, as a share of the lane's
DARKEST: Final = 0.25  # share of the strip's pixels that may be darker: a bar has no gaps, zebra crossings and arrows have
PLAIN_ROWS: Final = 3  # rows of plain road around a bar
LEAST_COVER: Final = 0.25  # of one row by paint
SHALLOWEST, DEEPEST = 0.5, 1.7  # of what is taken for a stop line, as shares of its usual depth
AGREES: Final = 0.2  # of the paint's contrast: plain road before and behind differs no more
LEAST_LEVELS: Final = 12.0  # contrast of paint below which nothing across the road is told


@numba.njit(cache=True)  # type: ignore[misc]  # numba is untyped
def strip_levels(
    grey: Float32Array, x_m: Float32Array, y_m: Float32Array, arc: FloatArray, middle_m: float, width_m: float
) -> tuple[FloatArray, FloatArray]:
    """Brightness (R,) of the lane row by row, that which ``DARKEST`` of its pixels fall short of, and the rows' x (R,).

    Rows in which the strip is not wholly seen have nan.
    """
    count, width = grey.shape
    levels, along = np.full(count, np.nan), np.empty(count)
    for row in range(count):
        metres = (y_m[row, 0] - y_m[row, width - 1]) / (width - 1)
        x = 0.5 * (x_m[row, 0] + x_m[row, width - 1])
        y = y_on_line(x, middle_m, arc)
        centre, half = (y_m[row, 0] - y) / metres, STRIP * width_m / metres
        low, high = int(np.ceil(centre - half)), int(np.floor(centre + half))
        at = min(max(int(centre), 0), width - 1)
        along[row] = x_m[row, at]
        if low < 0 or high > width - 1 or high - low < 3:
            continue
        levels[row] = np.sort(grey[row, low : high + 1])[int(DARKEST * (high - low))]
    return levels, along


def stop_line(
    levels: FloatArray, along_m: FloatArray, forward_m: float, paint_levels: float, depth_m: float
) -> tuple[float, float] | None:
    """Distance (m) of the stop line's near edge ahead of the rear axle, and its variance; None where there is none.

    ``paint_levels`` is how much brighter paint is than the road.
    """
    if not paint_levels > LEAST_LEVELS:
        return None
    count = len(levels)
    row = PLAIN_ROWS
    seen = np.isfinite(levels)
    inverse = 1.0 / (along_m - forward_m)
    while row < count - 1:
        if not seen[row] or not np.any(seen[row - PLAIN_ROWS : row]):
            row += 1
            continue
        before = float(np.nanmedian(levels[row - PLAIN_ROWS : row]))
        if levels[row] < before + LEAST_COVER * paint_levels:
            row += 1
            continue
        last = row
        while last + 1 < count and seen[last + 1] and levels[last + 1] > before + LEAST_COVER * paint_levels:
            last += 1
        found = _bar(levels, inverse, row, last, before, paint_levels)
        if found is not None:
            middle, deep = found
            if SHALLOWEST * depth_m < deep < DEEPEST * depth_m:
                distance = middle - 0.5 * depth_m + forward_m
                spacing = abs(along_m[min(last + 1, count - 1)] - along_m[row - 1]) / (last - row + 2)
                return distance, (0.25 * spacing) ** 2 + 0.05**2
        row = last + 1
    return None


def _bar(
    levels: FloatArray, inverse: FloatArray, first: int, last: int, before: float, paint_levels: float
) -> tuple[float, float] | None:
    """Distance ahead of the camera of the middle of what is bright in the rows, and its depth."""
    beyond = levels[last + 2 : last + 2 + PLAIN_ROWS]
    beyond = beyond[np.isfinite(beyond)]
    if len(beyond) == 0 or abs(float(np.median(beyond)) - before) > AGREES * paint_levels:
        return None
    rows = np.arange(first - 1, last + 2)
    cover = np.clip((levels[rows] - before) / paint_levels, 0.0, 1.0)
    cover = np.where(np.isfinite(cover), cover, 0.0)
    total = float(np.sum(cover))
    centre = float(np.sum(cover * rows)) / total
    places = np.arange(len(inverse))
    near, far = (float(np.interp(centre + side * 0.5 * total, places, inverse)) for side in (-1.0, 1.0))
    return 2.0 / (near + far), 1.0 / far - 1.0 / near
