"""The metres that were driven, seen on the dashes of the road's centre line: before any view tells the scale of the odometry.

The centre line is sampled along the ground in two frames. What moved past between them is the shift at which the two rows of
levels agree best. Dashes are 3 m and more long and farther apart than that, so a shift of a few metres is told without doubt;
where the line has no dash, or the road no line, nothing is told.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from hippodrome.core.reading.config import ReaderConfig
from hippodrome.core.types import FloatArray, Frame
from hippodrome.core.views.config import CameraGeometry

NEAR_M, FAR_M, STEP_M = 3.7, 12.5, 0.1  # ahead of the rear axle; beyond it a pixel spans more than a metre
LEAST_DEPTH_M = 1.0  # nearer than that the camera sees no ground
ASIDE_M = np.linspace(-0.3, 0.3, 7)  # about where the line is expected
PAINT_M = ReaderConfig().paint_m  # height of the paint above the ground that the camera's height is measured from
LINE_M = 1.6  # from the middle of a lane to the line
LEAST_LEVELS = 12.0  # standard deviation of the levels along a line with an end of a dash in view
LEAST_AGREEMENT, CLEARER = 0.9, 0.06  # correlation of the best shift, and by how much it beats those that are not beside it
BESIDE_M = 0.5
LEAST_OVERLAP = 30  # of the levels of both frames
SHARE_RANGE = (0.35, 2.8)  # of the distance that is expected
LEAST_M, MOST_M = 0.7, 4.0  # distance between two frames that are compared
SHORT = 0.008  # share by which the shift of the levels falls short of the metres: measured over 3 km in two towns


@dataclass(frozen=True, slots=True, eq=False)
class LineView:
    """The levels (n,) along the centre line in a frame, and the units of odometry and the metres driven since."""

    levels: FloatArray
    units: float
    metres: float = 0.0


def line_levels(
    frame: Frame, camera: CameraGeometry, offset_m: float, heading_rad: float, curvature_1pm: float, line_side: float
) -> FloatArray:
    """Brightest level (n,) about the line at each distance ahead; offset, heading and curvature as in ``RoadReading``.

    Between two rows of pixels the levels are interpolated: a row spans half a metre of the ground.
    """
    height, width = frame.shape[:2]
    focal = camera.focal_px(width)
    along = np.arange(NEAR_M, FAR_M, STEP_M)  # the middle of the lane: the line itself is longer or shorter in a bend
    turned = curvature_1pm * along
    east = along * np.sinc(turned / np.pi) - line_side * LINE_M * np.sin(turned)
    north = along * np.sinc(turned / (2.0 * np.pi)) * np.sin(0.5 * turned) + line_side * LINE_M * np.cos(turned) - offset_m
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    ahead, middle = cos * east + sin * north, cos * north - sin * east
    depth = np.maximum(ahead - camera.forward_m, LEAST_DEPTH_M)
    row = np.clip(0.5 * (height - 1) + focal * (camera.height_m - PAINT_M) / depth, 0.0, height - 1.001)
    above = np.floor(row).astype(np.int64)
    share = (row - above)[:, None]
    aside = middle[:, None] + ASIDE_M[None, :]
    column = np.clip(np.rint(0.5 * (width - 1) - focal * aside / depth[:, None]), 0, width - 1).astype(np.int64)
    level, below = (frame[(above + k)[:, None], column].astype(np.float64) for k in (0, 1))
    if level.ndim == 3:
        level, below = level.mean(axis=2), below.mean(axis=2)
    brightest: FloatArray = ((1.0 - share) * level + share * below).max(axis=1)
    return brightest


def driven_m(before: FloatArray, after: FloatArray, expected_m: float, sigma: float = math.inf) -> float:
    """The distance between two frames of which the levels are ``before`` and ``after``; nan where they do not tell.

    It is looked for about the expected one, of whose logarithm ``sigma`` is the standard deviation.

    Between shifts of ``STEP_M`` it is the peak of the parabola through the best one and its neighbours.
    """
    least, most = max(SHARE_RANGE[0], math.exp(-3.0 * sigma)), min(SHARE_RANGE[1], math.exp(min(3.0 * sigma, 3.0)))
    low, high = (max(int(share * expected_m / STEP_M), 1) for share in (least, most))
    return float(_best_shift(before, after, low, min(high, len(before) - LEAST_OVERLAP))) / (1.0 - SHORT)


@njit(cache=True)
def _best_shift(before: FloatArray, after: FloatArray, low: int, high: int) -> float:
    if high <= low:
        return math.nan
    scores = np.full(high + 2, -1.0)
    best = low
    for shift in range(low, high + 1):
        a, b = before[shift:], after[: len(after) - shift]
        sigma_a, sigma_b = a.std(), b.std()
        if sigma_a > LEAST_LEVELS and sigma_b > LEAST_LEVELS:
            scores[shift] = np.mean((a - a.mean()) * (b - b.mean())) / (sigma_a * sigma_b)
        if scores[shift] > scores[best]:
            best = shift
    if scores[best] < LEAST_AGREEMENT:
        return math.nan
    for shift in range(low, high + 1):
        if abs(shift - best) > BESIDE_M / STEP_M and scores[shift] > scores[best] - CLEARER:
            return math.nan
    left, right = scores[best - 1], scores[best + 1]
    bow = left - 2.0 * scores[best] + right
    inner = low < best < high and bow < 0.0 and left > 0.0 and right > 0.0
    return STEP_M * (best + (0.5 * (left - right) / bow if inner else 0.0))
