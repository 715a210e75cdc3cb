"""Paint along a lane's borders: where a border has dashes, their ends tell how far along the road one frame is from another.

Along a road most that is seen changes slowly. The ends of dashes do not: they lie on the road's surface, within the metres that a
frame shows best. Nothing is assumed of how long dashes are, nor that they are alike: two frames are compared, and what moved past
between them is the shift at which their borders agree best. A border that is painted all along, or not at all, tells nothing.
"""

from __future__ import annotations

import math
from typing import Final

import numba
import numpy as np

from hippodrome.core.reading.traits import mean_between, y_on_line
from hippodrome.core.types import PAINT_PLACES, Float32Array, FloatArray, UInt8Array

FIRST_M: Final = 3.6  # ahead of the rear axle: nearer, the frame does not reach aside to the borders
STEP_M: Final = 0.2
PLACES: Final = PAINT_PLACES  # up to 12.4 m: farther away a row of pixels spans more than half a metre of road
LINE_REACH_M: Final = 0.25  # about where a border is expected: as far off as it is read wrong, with half of a line
FLANK_M: Final = (0.35, 0.65)  # from the border: what lies there is road, or whatever lies beyond the road
LEAST_LEVELS: Final = 15.0  # contrast of paint
PAINTED: Final = (0.15, 0.65)  # share of the strongest contrast from which on there may be paint, and from which on there is
WHOLE: Final = 250.0  # what paint counts, of 255
MARGIN_PX: Final = 1.5  # nearer to the frame's side, a line is cut
LEAST_OVERLAP: Final = 14  # places that both frames see: 2.8 m
LEAST_SPREAD: Final = 75.0  # standard deviation of the paint along a border in which a dash ends: a tenth is painted
LEAST_AGREEMENT: Final = 0.9  # correlation at the best shift
CLEARER: Final = 0.08  # by which it beats all those that are not beside it
BESIDE: Final = 4  # steps
SIGMA_M: Final = 0.15  # of a comparison: .1 m to .2 m over three towns
SAME_LANE_M: Final = 1.0  # across, within which two vehicles are in one lane
NEXT_LANE_M: Final = (2.2, 4.4)  # across, within which one is in the lane beside the other's
SAME_WAY_RAD: Final = math.radians(12.0)
LEFT, RIGHT = 0, 1
SHARPEST_1PM: Final = 0.05  # in sharper bends the borders are not where the middle of the lane has them
NO_PAINT: Final[UInt8Array] = np.zeros((2, PLACES), dtype=np.uint8)
NO_PAINT.setflags(write=False)


@numba.njit(cache=True)
def paint_along_borders(
    grey: Float32Array, x_m: Float32Array, y_m: Float32Array, arc: FloatArray, middle_m: float, width_m: float
) -> UInt8Array:
    """Paint (2, PLACES) along the left and the right border of a lane: 0 where there is none, ``WHOLE`` where there is.

    Args:
        grey: (R, W) brightness of the rows that show the road, the nearest first.
        x_m: (R, W) ahead of the rear axle, of each pixel.
        y_m: (R, W) to the left.
        arc: (3,) direction, curvature and change of curvature of the lane at the rear axle.
        middle_m: of the lane, to the left of the rear axle.
        width_m: of the lane.
    """
    rows, columns = grey.shape
    paint = np.zeros((2, PLACES), np.uint8)
    along, contrast = np.empty(rows), np.empty(rows)
    level = np.empty(PLACES)
    for border in range(2):
        side = 1.0 - 2.0 * border
        place = middle_m + side * 0.5 * width_m
        stretch = 1.0 - arc[1] * (place - middle_m)  # of the border against the middle of the lane, in a bend
        count = 0
        for row in range(rows):
            x = 0.5 * (x_m[row, 0] + x_m[row, columns - 1])
            metres = (y_m[row, 0] - y_m[row, columns - 1]) / (columns - 1)
            u = (y_m[row, 0] - y_on_line(x, place, arc)) / metres
            if not MARGIN_PX < u < columns - 1 - MARGIN_PX:
                continue
            top = 0.0
            for k in range(
                max(int(u - LINE_REACH_M / metres + 0.5), 0), min(int(u + LINE_REACH_M / metres + 0.5), columns - 1) + 1
            ):
                top = max(top, grey[row, k])
            beside = max(
                mean_between(grey[row], u - FLANK_M[1] / metres, u - FLANK_M[0] / metres, 0.0),
                mean_between(grey[row], u + FLANK_M[0] / metres, u + FLANK_M[1] / metres, 0.0),
            )
            along[count], contrast[count] = x / stretch, top - beside
            count += 1
        if count < 2 or along[0] > FIRST_M + 1.0 or along[count - 1] < FIRST_M + STEP_M * (PLACES - 1) - 1.0:
            continue
        k = 0
        strongest = 0.0
        for i in range(PLACES):
            at = FIRST_M + STEP_M * i
            while k < count - 2 and along[k + 1] < at:
                k += 1
            share = min(max((at - along[k]) / max(along[k + 1] - along[k], 1e-3), 0.0), 1.0)
            level[i] = (1.0 - share) * contrast[k] + share * contrast[k + 1]
            strongest = max(strongest, level[i])
        if strongest < LEAST_LEVELS:
            continue
        for i in range(PLACES):
            share = (level[i] / strongest - PAINTED[0]) / (PAINTED[1] - PAINTED[0])
            paint[border, i] = np.uint8(WHOLE * min(max(share, 0.0), 1.0) + 0.5)
    return paint


@numba.njit(cache=True)
def ahead_by_paint(behind: UInt8Array, ahead: UInt8Array, expected_m: float, reach_m: float) -> float:
    """By how many metres a vehicle that saw ``ahead`` (PLACES,) is farther along a lane than one that saw ``behind``.

    It is looked for within ``reach_m`` of ``expected_m``; nan where the paint does not tell. Between steps it is the peak of the
    parabola through the correlations at the best shift and its neighbours.
    """
    low = math.floor((expected_m - reach_m) / STEP_M)
    high = math.ceil((expected_m + reach_m) / STEP_M)
    scores = np.full(high - low + 1, -1.0)
    best = 0
    for k in range(len(scores)):
        shift = low + k
        first, last = max(0, -shift), min(PLACES, PLACES - shift)
        if last - first < LEAST_OVERLAP:
            continue
        sum_a = sum_b = sum_aa = sum_bb = sum_ab = 0.0
        for i in range(first, last):
            a, b = float(behind[i + shift]), float(ahead[i])
            sum_a += a
            sum_b += b
            sum_aa += a * a
            sum_bb += b * b
            sum_ab += a * b
        n = last - first
        var_a, var_b = sum_aa / n - (sum_a / n) ** 2, sum_bb / n - (sum_b / n) ** 2
        if min(var_a, var_b) > LEAST_SPREAD**2:
            scores[k] = (sum_ab / n - sum_a * sum_b / n**2) / math.sqrt(var_a * var_b)
            if scores[k] > scores[best]:
                best = k
    if scores[best] < LEAST_AGREEMENT or best == 0 or best == len(scores) - 1:
        return math.nan
    for k in range(len(scores)):
        if abs(k - best) > BESIDE and scores[k] > scores[best] - CLEARER:
            return math.nan
    left, right = scores[best - 1], scores[best + 1]
    bow = left - 2.0 * scores[best] + right
    inner = bow < 0.0 and left > 0.0 and right > 0.0
    return STEP_M * (low + best + (0.5 * (left - right) / bow if inner else 0.0))


def shared_borders(left_m: float) -> tuple[tuple[int, int], ...]:
    """Which border of one vehicle's lane is which of another's, that heads the same way and is ``left_m`` farther left."""
    if abs(left_m) < SAME_LANE_M:
        return (LEFT, LEFT), (RIGHT, RIGHT)
    if not NEXT_LANE_M[0] < abs(left_m) < NEXT_LANE_M[1]:
        return ()
    return ((LEFT, RIGHT),) if left_m > 0.0 else ((RIGHT, LEFT),)
