"""The stop line: a bar of paint across the lane, as deep as stop lines are, with road before and behind it."""

from __future__ import annotations

from typing import Final

import numba
import numpy as np

from hippodrome.core.reading.traits import y_on_line
from hippodrome.core.types import Float32Array, FloatArray

STRIP: Final = 0.4  # half the width of the strip that is looked at, as a share of the lane's
DARKEST: Final = 0.25  # share of the strip's pixels that may be darker: a bar has no gaps, zebra crossings and arrows have
PLAIN_ROWS: Final = 3  # rows of plain road around a bar
LEAST_COVER: Final = 0.25  # of one row by paint
SHALLOWEST, DEEPEST = 0.5, 1.7  # of what is taken for a stop line, as shares of its usual depth
AGREES: Final = 0.5  # of the paint's contrast: plain road before and behind differs no more, also in fog
PLAIN: Final = 0.2  # of the paint's contrast: the rows before a bar differ no more among each other
DARK: Final = 0.7  # of the road's brightness: what is darker is a vehicle ahead or its shadow
THINNEST: Final = 0.38  # share of a row that a stop line fills at least: far ones look like any line across the road
FULL: Final = 0.6  # of the paint's contrast, at least, in the row that a bar fills best
ROW_SIGMA, PLACE_SIGMA_M = 0.2, 0.04  # error of the distance, as a share of the road that a row shows, and in metres
LEAST_LEVELS: Final = 12.0  # contrast of paint below which nothing across the road is told


@numba.njit(cache=True)
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


@numba.njit(cache=True)
def stop_line(
    levels: FloatArray, along_m: FloatArray, forward_m: float, paint_levels: float, depth_m: float
) -> tuple[float, float]:
    """Distance (m) of the stop line's near edge ahead of the rear axle, and its variance: inf where there is none.

    ``paint_levels`` is how much brighter paint is than the road. A bar that reaches to the last row is none.
    """
    nothing = (np.nan, np.inf)
    count = len(levels)
    if not paint_levels > LEAST_LEVELS or not np.any(np.isfinite(levels[: count // 2])):
        return nothing
    road = np.nanmedian(levels[: count // 2])
    row = PLAIN_ROWS
    while row < count - 1:
        before = np.nanmedian(levels[row - PLAIN_ROWS : row])
        top = before + LEAST_COVER * paint_levels
        if not levels[row] > top or not before > DARK * road:
            row += 1
            continue
        last = row
        while last + 1 < count and levels[last + 1] > top:
            last += 1
        if last + 1 == count:  # whether it ends is not seen
            return nothing
        middle, deep = _bar(levels, along_m, forward_m, row, last, before, paint_levels)
        if SHALLOWEST * depth_m < deep < DEEPEST * depth_m:
            spacing = abs(along_m[min(last + 1, count - 1)] - along_m[row - 1]) / (last - row + 2)
            if depth_m < THINNEST * spacing:
                return nothing
            return middle - 0.5 * depth_m, (ROW_SIGMA * spacing) ** 2 + PLACE_SIGMA_M**2
        row = last + 1
    return nothing


@numba.njit(cache=True)
def _bar(
    levels: FloatArray, along_m: FloatArray, forward_m: float, first: int, last: int, before: float, paint_levels: float
) -> tuple[float, float]:
    """Distance ahead of the rear axle of the middle of what is bright in the rows, and its depth (inf: it is no bar)."""
    near = levels[first - PLAIN_ROWS : first - 1]
    beyond = np.nanmedian(levels[min(last + 2, len(levels) - 1) : last + 2 + PLAIN_ROWS])
    if not abs(beyond - before) < AGREES * paint_levels or not np.nanmax(near) - np.nanmin(near) < PLAIN * paint_levels:
        return np.nan, np.inf
    total = centre = peak = 0.0
    for row in range(first - 1, last + 2):
        share = (row - first + 1.0) / (last - first + 2.0)
        cover = (levels[row] - (1.0 - share) * before - share * beyond) / paint_levels
        if cover > 0.0:
            total += min(cover, 1.0)
            centre += min(cover, 1.0) * row
            peak = max(peak, cover)
    if peak < FULL * min(total, 1.0):
        return np.nan, np.inf
    centre /= total
    near_m, far_m = row_distance(along_m, forward_m, centre - 0.5 * total), row_distance(along_m, forward_m, centre + 0.5 * total)
    return 2.0 / (1.0 / near_m + 1.0 / far_m) + forward_m, far_m - near_m


@numba.njit(cache=True)
def row_distance(along_m: FloatArray, forward_m: float, row: float) -> float:
    """Distance ahead of the camera at a place between two rows: its inverse grows evenly."""
    whole = min(max(int(row), 0), len(along_m) - 2)
    share = row - whole
    return float(1.0 / ((1.0 - share) / (along_m[whole] - forward_m) + share / (along_m[whole + 1] - forward_m)))
