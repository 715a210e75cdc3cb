"""Self-motion from the frames alone, for a level camera of known height on a vehicle whose rear wheels do not skid.

The turn: tracked corners, and the one-parameter motion along a circular arc (Scaramuzza 2011), as the least epipolar error over
turns. The distance: both frames seen from above, as if all were road, and the shift along the road that makes them agree best,
near the one before, as no vehicle changes its speed much between two frames. Lines along the road tell nothing of it and are
taken out; so is what is flat.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from hippodrome.core.types import Float32Array, FloatArray, Frame, Observation
from hippodrome.core.views.peaks import peak_in_row

Grey: TypeAlias = NDArray[Any]  # (H, W) uint8

CORNERS, CORNER_QUALITY, CORNER_PX = 200, 0.005, 4  # at most, relative to the best one, apart
ROUND_TRIP_PX = 0.5  # a corner tracked there and back ends where it began, or was lost
LEAST_CORNERS = 12  # fewer tell no turn: the last one is kept
TURN_CHANGE_RAD, STEADY_CORNERS = 0.05, 12  # from one turn to the next; as many corners as it takes to vouch for more
STILL_PX = 0.15  # median of the tracks below which the vehicle stands
OUTLIER_PX = 1.5  # epipolar error beyond which a corner moves by itself
WIDEST_RAD = 0.35  # between two frames: full lock at 7 m/s and 5 Hz
FINER = ((WIDEST_RAD, 71), (0.01, 21), (0.002, 21))  # half width and number of the turns tried, coarse to fine
NEAR_M, FAR_M, ASIDE_M, PIXEL_M = 2.4, 11.0, 4.0, 0.1  # the road seen from above: beyond 11 m a pixel of the frame is a metre
TEMPLATE_M = 4.5  # of it that is sought: what remains of 8.6 m after a step of 4 m
BESIDE_PX = 8  # sideways play of the template, of which the inner 2 pixels are looked at: the lateral error of a turn
LINE_PX = 25  # along the road: what stays the same over it is a line
SPEED_CHANGE = 1.5  # 1/m^2 loss of correlation per squared change of the step
LARGEST_CHANGE_M = 0.4  # of the step: 10 m/s^2 at 5 Hz, full braking; dashes repeat every few metres
LEAST_STEP_M, LEAST_CORRELATION = 0.25, 0.35  # a nearer or worse agreement is that of the image with itself, or chance
FIRST_STEP_M = 1.0  # expected before the first


@dataclass(frozen=True)
class CameraGeometry:
    """Where the camera is on the vehicle. It looks straight ahead and level."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    fov_deg: float = 90.0  # horizontal
    height_m: float = 1.4  # above the road: gives the distances their unit
    forward_m: float = 1.6  # from the rear axle

    def __post_init__(self) -> None:
        if not 0.0 < self.fov_deg < 180.0 or self.height_m <= 0.0:
            raise ValueError(f"camera: fov_deg must lie in (0, 180), height_m be positive, got {self.fov_deg}, {self.height_m}")


class VisualOdometry:
    """Feed it observations in order: each comes back with the speed (m/s) and yaw rate that the frames show."""

    def __init__(self, camera: CameraGeometry) -> None:
        self._camera = camera
        self._last: Grey | None = None
        self._step_m, self._turned_rad = FIRST_STEP_M, 0.0  # between the last two frames
        self._waited_s, self._given = 0.0, np.zeros(2)  # time and motion (m, rad) told since the last frame
        self._rates = np.zeros(2)  # m/s, rad/s

    def step(self, observation: Observation) -> Observation:
        """Between frames the motion goes on as before; a frame corrects what was told too much or too little."""
        self._waited_s += observation.dt_s
        told = self._rates * observation.dt_s
        if observation.frame is not None:
            grey = _grey(observation.frame)
            if self._last is not None:
                moved = np.array(self._moved(self._last, grey))
                told, self._rates = moved - self._given, moved / self._waited_s
            self._last, self._waited_s, self._given = grey, 0.0, -told
        self._given = self._given + told
        return replace(observation, speed=float(told[0]) / observation.dt_s, yaw_rate_radps=float(told[1]) / observation.dt_s)

    def _moved(self, before: Grey, after: Grey) -> tuple[float, float]:
        focal_px = 0.5 * after.shape[1] / math.tan(0.5 * math.radians(self._camera.fov_deg))
        one, other = tracks(before, after)
        if len(one) >= LEAST_CORNERS:
            if float(np.median(np.hypot(*(other - one).T))) < STILL_PX:
                return 0.0, 0.0
            centre = 0.5 * np.array(after.shape[::-1]) - 0.5
            bearings = (one - centre) / focal_px, (other - centre) / focal_px
            expected = self._step_m, self._turned_rad
            self._turned_rad = turned(*bearings, *expected, self._camera.forward_m, OUTLIER_PX / focal_px)
        self._step_m = travelled(before, after, self._turned_rad, self._step_m, focal_px, self._camera)
        return self._step_m, self._turned_rad


def _grey(frame: Frame) -> Grey:
    return frame if frame.ndim == 2 else cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY)


def tracks(before: Grey, after: Grey) -> tuple[FloatArray, FloatArray]:
    """Pixels (N, 2) of corners in both frames; those that do not come back when tracked backwards are left out."""
    corners = cv2.goodFeaturesToTrack(before, CORNERS, CORNER_QUALITY, CORNER_PX)
    if corners is None:
        return np.zeros((0, 2)), np.zeros((0, 2))
    options: dict[str, Any] = {"winSize": (11, 11), "maxLevel": 3}
    there, found, _ = cv2.calcOpticalFlowPyrLK(before, after, corners, np.zeros_like(corners), **options)
    back, found_back, _ = cv2.calcOpticalFlowPyrLK(after, before, there, np.zeros_like(corners), **options)
    away_px = np.hypot(*(back - corners).reshape(-1, 2).T)
    kept = (found.ravel() > 0) & (found_back.ravel() > 0) & (away_px < ROUND_TRIP_PX)
    return corners.reshape(-1, 2)[kept].astype(np.float64), there.reshape(-1, 2)[kept].astype(np.float64)


def turned(before: FloatArray, after: FloatArray, step_m: float, expected_rad: float, forward_m: float, outlier: float) -> float:
    """Turn to the left (rad) with the least epipolar error of bearings (N, 2), rightwards and downwards per unit ahead.

    The error counts from ``outlier`` on no further, and a change from ``expected_rad`` as that of ``STEADY_CORNERS`` corners.
    """
    best_rad = 0.0
    for half_rad, count in FINER:
        tried = best_rad + np.linspace(-half_rad, half_rad, count)
        change = np.minimum(1.0, ((tried - expected_rad) / TURN_CHANGE_RAD) ** 2)
        cost = _epipolar_cost(tried, before, after, max(step_m, LEAST_STEP_M), forward_m, outlier)
        best_rad = float(tried[np.argmin(cost + STEADY_CORNERS * outlier * change)])
    return best_rad


def _epipolar_cost(
    turn_rad: FloatArray, before: FloatArray, after: FloatArray, step_m: float, forward_m: float, outlier: float
) -> FloatArray:
    """Sum of p . (t x R p'), each bounded by ``outlier``, for turns (K,) along an arc of ``step_m``. Axes: ahead, left, up."""
    ahead_m, left_m = (part[:, None] for part in _shift(turn_rad, step_m, forward_m))
    cos, sin = np.cos(turn_rad)[:, None], np.sin(turn_rad)[:, None]
    left, up, left_after, up_after = -before[:, 0], -before[:, 1], -after[:, 0], -after[:, 1]
    ahead_turned, left_turned = cos - sin * left_after, sin + cos * left_after
    error = left_m * up_after - left * ahead_m * up_after + up * (ahead_m * left_turned - left_m * ahead_turned)
    length = np.hypot(ahead_m, left_m) * np.sqrt((before**2).sum(axis=1) + (after**2).sum(axis=1) + 1e-4)
    cost: FloatArray = np.minimum(np.abs(error / length), outlier).sum(axis=1)
    return cost


def _shift(turn_rad: FloatArray, step_m: float, forward_m: float) -> tuple[FloatArray, FloatArray]:
    """Ahead and left (m): how a camera ``forward_m`` before the rear axle moves while the axle follows an arc."""
    ahead_m = step_m * np.cos(0.5 * turn_rad) + forward_m * (np.cos(turn_rad) - 1.0)
    return ahead_m, step_m * np.sin(0.5 * turn_rad) + forward_m * np.sin(turn_rad)


def travelled(before: Grey, after: Grey, turn_rad: float, expected_m: float, focal_px: float, camera: CameraGeometry) -> float:
    """Metres along the arc between two frames; ``expected_m`` where the road tells nothing."""
    strip = _from_above(before, 0.0, focal_px, camera)
    template = _from_above(after, turn_rad, focal_px, camera)[: round(TEMPLATE_M / PIXEL_M), BESIDE_PX:-BESIDE_PX]
    agreement = cv2.matchTemplate(strip, template, cv2.TM_CCOEFF_NORMED)[:, BESIDE_PX - 2 : BESIDE_PX + 3].max(axis=1)
    shift_m = PIXEL_M * np.arange(len(agreement))
    change_m = np.abs(shift_m - expected_m)
    possible = (shift_m >= LEAST_STEP_M) & (change_m <= LARGEST_CHANGE_M)
    likely = np.where(possible, agreement - SPEED_CHANGE * change_m**2, -np.inf)
    best = int(np.argmax(likely))
    if agreement[best] < LEAST_CORRELATION or not possible[best]:
        return expected_m
    return PIXEL_M * (best + peak_in_row(agreement, best))


def _from_above(image: Grey, turn_rad: float, focal_px: float, camera: CameraGeometry) -> Float32Array:
    """The road before the camera, rows ahead and columns leftwards, without what stays the same along it.

    With ``turn_rad`` it is laid out in the directions of the frame before, from where the turn alone would have put the camera.
    """
    ahead_m, left_m = np.meshgrid(np.arange(NEAR_M, FAR_M, PIXEL_M), np.arange(-ASIDE_M, ASIDE_M, PIXEL_M), indexing="ij")
    moved_ahead_m, moved_left_m = _shift(np.array(turn_rad), 0.0, camera.forward_m)
    x_m, y_m, cos, sin = ahead_m - moved_ahead_m, left_m - moved_left_m, math.cos(turn_rad), math.sin(turn_rad)
    depth_m = np.maximum(cos * x_m + sin * y_m, 0.5)
    column = 0.5 * (image.shape[1] - 1) - focal_px * (cos * y_m - sin * x_m) / depth_m
    row = 0.5 * (image.shape[0] - 1) + focal_px * camera.height_m / depth_m
    seen = cv2.remap(
        image, column.astype(np.float32), row.astype(np.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    ).astype(np.float32)
    plain: Float32Array = seen - cv2.blur(seen, (1, LINE_PX))
    return plain
