"""The mouth of a junction: where the line at the road's edge ends, with plain road beyond."""

from __future__ import annotations

from typing import Final

import numba
import numpy as np

from hippodrome.core.reading.arcs import lateral_m
from hippodrome.core.reading.ends import row_distance
from hippodrome.core.reading.traits import y_on_line
from hippodrome.core.types import Float32Array, FloatArray

FEWEST: Final = 8  # rows in which a line is seen before it can end
BEFORE: Final = 4  # rows before its end that tell how bright it is
BEYOND, BEYOND_M = 3, 2.5  # rows beyond its end, and metres, that must be plain road: a pole hides less of a line
LATE_M: Final = 1.0  # an end is told of lines that begin where the frame does
INSIDE_M: Final = 0.4  # from the line towards the middle of the lane: the road beside it
OUTSIDE_M: Final = 0.3  # and outwards: kerbs, pavements and gravel end with the line at a mouth
PLAIN: Final = 0.3  # of the line's contrast: what road beyond its end may differ from the road beside it
LONGEST_ROW_M: Final = 0.8  # of road that a row shows where an end is still told
LEAST_LEVELS: Final = 15.0  # contrast of a line at its end: one that fades out does not end
ROW_SIGMA, PLACE_SIGMA_M = 0.25, 0.08  # error of the distance, as a share of the road that a row shows, and in metres
AROUND_M: Final = 1.0  # a line this far aside of one that ended is its continuation
RESUMED_M: Final = 0.08  # and one this far aside the same line
MARGIN_PX: Final = 2.0


@numba.njit(cache=True)
def line_end(
    grey: Float32Array,
    x_m: Float32Array,
    y_m: Float32Array,
    ridges: FloatArray,
    owner: FloatArray,
    line: int,
    arc: FloatArray,
    place_m: float,
    forward_m: float,
) -> tuple[float, float]:
    """Distance (m) ahead of the rear axle at which a line ends, and its variance: inf if it does not."""
    nothing = (np.nan, np.inf)
    count = len(grey)
    hit = np.zeros(count, np.bool_)
    for i in range(len(ridges)):
        if owner[i] == line and ridges[i, 4] >= 0:
            hit[int(ridges[i, 4])] = True
    middle = 0.5 * (x_m[:, 0].astype(np.float64) + x_m[:, -1])
    last, seen, visible = -1, 0, -1
    for row in range(count):
        if visible < 0 and abs(y_on_line(middle[row], place_m, arc)) < abs(y_m[row, 0 if place_m > 0.0 else -1]):
            visible = row
        if hit[row]:
            if last < 0 and middle[row] > middle[max(visible, 0)] + LATE_M:
                return nothing
            last, seen = row, seen + 1
        elif last >= 0 and row > last + 1:
            break
    end = last + 1
    while end < count - 1 and (middle[end] < middle[last] + BEYOND_M or end < last + BEYOND):
        end += 1
    if seen < FEWEST or end >= count - 1:
        return nothing
    sin, cos, resumed = np.sin(arc[0]), np.cos(arc[0]), 0
    for i in range(len(ridges)):
        if last < ridges[i, 4] <= end:
            t = cos * ridges[i, 0] + sin * ridges[i, 1]
            place = lateral_m(ridges[i, 0], ridges[i, 1], sin, cos, arc[1]) - arc[2] * t**3 / 6.0
            turns = abs(place - place_m) < AROUND_M and ridges[i, 4] <= last + BEYOND
            resumed += 1 if abs(place - place_m) < RESUMED_M else 0
            if turns or resumed > 2:  # it goes on round a corner, or beyond what hid it
                return nothing
    over, side = np.empty(count), np.empty(count)  # brightness on the line and of the road beside it
    for row in range(last - BEFORE, end + 1):
        metres = (y_m[row, 0] - y_m[row, -1]) / (grey.shape[1] - 1)
        u = (y_m[row, 0] - y_on_line(middle[row], place_m, arc)) / metres
        inside = u + np.sign(place_m) * INSIDE_M / metres
        if min(u, inside) < MARGIN_PX or max(u, inside) > grey.shape[1] - 1 - MARGIN_PX:
            return nothing
        over[row], side[row] = _level(grey[row], u), _level(grey[row], inside)
        if row > last + 1:
            over[row] = _brightest(grey[row], u, np.sign(place_m) * OUTSIDE_M / metres)
    contrast = np.median(over[last - BEFORE : last] - side[last - BEFORE : last])
    road = np.median(side[last - BEFORE : last])
    spacing = middle[last + 1] - middle[last]
    if contrast < LEAST_LEVELS or spacing > LONGEST_ROW_M:
        return nothing
    for row in range(last - 1, last + BEYOND + 1):
        if abs(side[row] - road) > PLAIN * contrast or (row > last + 1 and abs(over[row] - side[row]) > PLAIN * contrast):
            return nothing
    covered = 0.0
    for row in range(last, last + 2):
        covered += min(max((over[row] - side[row]) / contrast, 0.0), 1.0)
    return row_distance(middle, forward_m, last - 0.5 + covered) + forward_m, (ROW_SIGMA * spacing) ** 2 + PLACE_SIGMA_M**2


@numba.njit(cache=True)
def _level(row: Float32Array, u: float) -> float:
    """Brightness between two pixels of a row."""
    whole = int(u)
    return float(row[whole] + (u - whole) * (row[whole + 1] - row[whole]))


@numba.njit(cache=True)
def _brightest(row: Float32Array, u: float, left_px: float) -> float:
    """Highest brightness from a column to so many pixels to the left of it (to the right, if negative)."""
    low, high = min(u, u - left_px), max(u, u - left_px)
    most = 0.0
    for k in range(max(int(low), 0), min(int(high) + 1, len(row) - 1) + 1):
        most = max(most, row[k])
    return most
