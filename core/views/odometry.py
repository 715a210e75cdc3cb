"""Visual odometry: self-motion from the frames alone, for a level camera of known height on a vehicle that does not skid.

What follows is for a camera that sees the road right ahead of the vehicle, as the simulator's does; all others are left
to the room ``egomotion``.

The turn comes from tracked corners. A vehicle moves along circular arcs, so that one parameter, the turn, determines the epipolar
geometry of two frames (Scaramuzza 2011, "1-point-RANSAC structure from motion for vehicle-mounted cameras"); the turn of the
least epipolar error is found by trying.

The distance comes from both frames seen from above, as if all were road: the shift along the road that correlates best, near the
last one, as no vehicle changes its speed much between two frames. What stays the same along the road (lane lines, plain asphalt)
tells nothing of the shift and is taken out before.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from hippodrome.core.types import Float32Array, FloatArray, Frame, Observation
from hippodrome.core.views.config import NEAR_M, CameraGeometry
from hippodrome.core.views.egomotion.odometry import RoadOdometry
from hippodrome.core.views.peaks import peak_in_row

Grey: TypeAlias = NDArray[Any]  # (H, W) uint8

# corners
CORNERS, CORNER_QUALITY, CORNER_PX = 200, 0.005, 4  # most corners, quality relative to the best one, pixels between two
ROUND_TRIP_PX = 0.5  # a corner that is tracked there and back ends this close to where it began, or it was lost
STILL_PX = 0.15  # median length of the tracks below which the vehicle stands

# the turn
LEAST_CORNERS = 12  # with fewer corners the last turn is kept
OUTLIER_PX = 1.5  # epipolar error from which on a corner is taken to move by itself: its cost grows no further
TURN_CHANGE_RAD = 0.05  # usual change from one turn to the next
STEADY_CORNERS = 12  # a change of ``TURN_CHANGE_RAD`` and more costs as much as so many outliers
WIDEST_RAD = 0.35  # largest turn between two frames: full lock at 7 m/s and 5 Hz
SEARCHES = ((WIDEST_RAD, 71), (0.01, 21), (0.002, 21))  # half width and number of the turns tried, from coarse to fine

# the distance
FAR_M, ASIDE_M, PIXEL_M = 11.0, 4.0, 0.1  # the road seen from above; beyond 11 m a pixel of the frame spans a metre
TEMPLATE_M = 4.5  # length of the template: what both views from above share after the longest step, of 4 m
BESIDE_PX = 8  # pixels by which the template is narrower on either side ..
PLAY_PX = 2  # .. and by how many of them it may be off sideways: the lateral error of a turn
LINE_PX = 25  # length along the road over which a mean is subtracted: what is the same over it is a line or plain
SPEED_CHANGE_PER_M2 = 1.5  # loss of correlation per squared change of the step
LARGEST_CHANGE_M = 0.4  # largest change of the step: full braking, 10 m/s^2 at 5 Hz; the dashes of a lane repeat every few metres
LEAST_STEP_M = 0.25  # a shorter step shows mostly how well the image agrees with itself
LEAST_CORRELATION = 0.35  # a worse agreement is chance
FIRST_STEP_M = 1.0  # expected before the first step is known


class VisualOdometry:
    """Takes observations in order; each comes back with the speed (m/s) and yaw rate that the frames show in place of its own."""

    def __init__(self, camera: CameraGeometry) -> None:
        self._camera = camera
        self._elsewhere: RoadOdometry | None = None  # takes over where the frames do not show the road right ahead
        self._last: Grey | None = None  # the last frame
        self._step_m, self._turned_rad = FIRST_STEP_M, 0.0  # motion between the last two frames
        self._since_frame_s, self._reported = 0.0, np.zeros(2)  # time since the last frame, and motion (m, rad) reported in it
        self._rates = np.zeros(2)  # m/s and rad/s between the last two frames

    def step(self, observation: Observation) -> Observation:
        """The observation with the frames' motion.

        Without a frame the motion goes on at the last rates. With one, the true motion since the frame before is known, and this
        observation reports what of it has not been reported yet (which may be negative).
        """
        if self._last is None and self._elsewhere is None and observation.frame is not None:
            size_px = observation.frame.shape[1], observation.frame.shape[0]
            if not self._camera.sees_road_ahead(*size_px):
                self._elsewhere = RoadOdometry(self._camera.on_road(*size_px))
        if self._elsewhere is not None:
            return self._elsewhere.step(observation)
        self._since_frame_s += observation.dt_s
        step = self._rates * observation.dt_s
        if observation.frame is not None:
            grey = _grey(observation.frame)
            if self._last is not None:
                moved = np.array(self._motion_between(self._last, grey))
                step, self._rates = moved - self._reported, moved / self._since_frame_s
            self._last, self._since_frame_s, self._reported = grey, 0.0, np.zeros(2)
        else:
            self._reported = self._reported + step
        return replace(observation, speed=float(step[0]) / observation.dt_s, yaw_rate_radps=float(step[1]) / observation.dt_s)

    def _motion_between(self, before: Grey, after: Grey) -> tuple[float, float]:
        """Distance (m) and turn to the left (rad) between two frames."""
        focal_px = self._camera.focal_px(after.shape[1])
        corners_before, corners_after = track_corners(before, after)
        if len(corners_before) >= LEAST_CORNERS:
            if float(np.median(np.hypot(*(corners_after - corners_before).T))) < STILL_PX:
                return 0.0, 0.0
            centre = 0.5 * np.array(after.shape[::-1]) - 0.5
            bearings = (corners_before - centre) / focal_px, (corners_after - centre) / focal_px
            expected = self._step_m, self._turned_rad
            self._turned_rad = estimate_turn(*bearings, *expected, self._camera.forward_m, OUTLIER_PX / focal_px)
        self._step_m = estimate_step(before, after, self._turned_rad, self._step_m, focal_px, self._camera)
        return self._step_m, self._turned_rad


def _grey(frame: Frame) -> Grey:
    """The frame as a grey image."""
    return frame if frame.ndim == 2 else cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY)


def track_corners(before: Grey, after: Grey) -> tuple[FloatArray, FloatArray]:
    """Pixels (N, 2) of the same corners in the frames before and after, by Lucas-Kanade tracking.

    A corner that is not found again where it began, when it is tracked back, was lost and is left out.
    """
    corners = cv2.goodFeaturesToTrack(before, CORNERS, CORNER_QUALITY, CORNER_PX)
    if corners is None:
        return np.zeros((0, 2)), np.zeros((0, 2))
    options: dict[str, Any] = {"winSize": (11, 11), "maxLevel": 3}
    tracked, found, _ = cv2.calcOpticalFlowPyrLK(before, after, corners, np.zeros_like(corners), **options)
    back, found_back, _ = cv2.calcOpticalFlowPyrLK(after, before, tracked, np.zeros_like(corners), **options)
    away_px = np.hypot(*(back - corners).reshape(-1, 2).T)
    kept = (found.ravel() > 0) & (found_back.ravel() > 0) & (away_px < ROUND_TRIP_PX)
    return corners.reshape(-1, 2)[kept].astype(np.float64), tracked.reshape(-1, 2)[kept].astype(np.float64)


def estimate_turn(
    before: FloatArray, after: FloatArray, step_m: float, expected_rad: float, forward_m: float, outlier: float
) -> float:
    """Turn to the left (rad) of the least epipolar error, tried on ever finer grids; a change of the turn has a cost, too.

    Args:
        before: bearings of N corners in the first frame, rightwards and downwards per unit ahead, (N, 2).
        after: bearings of the same corners in the second frame, (N, 2).
        step_m: length of the arc, about.
        expected_rad: the turn before this one.
        forward_m: distance of the camera ahead of the rear axle.
        outlier: epipolar error from which on a corner's cost grows no further.
    """
    best_rad = 0.0
    for half_rad, count in SEARCHES:
        tried = best_rad + np.linspace(-half_rad, half_rad, count)
        change = np.minimum(1.0, ((tried - expected_rad) / TURN_CHANGE_RAD) ** 2)
        cost = _epipolar_cost(tried, before, after, max(step_m, LEAST_STEP_M), forward_m, outlier)
        best_rad = float(tried[np.argmin(cost + STEADY_CORNERS * outlier * change)])
    return best_rad


def _epipolar_cost(
    turn_rad: FloatArray, before: FloatArray, after: FloatArray, step_m: float, forward_m: float, outlier: float
) -> FloatArray:
    """Epipolar error of every turn tried, (K,): the sum over corners of |p . (t x R p')|, each at most ``outlier``.

    p and p' are the corner's directions in the first and second frame (axes: ahead, left, up), R the turn, and t how the camera
    has moved along an arc of ``step_m``. Each term is divided by about the length of its gradient, as in Sampson's distance,
    and so becomes an error of bearings.
    """
    ahead_m, left_m = (part[:, None] for part in _camera_shift(turn_rad, step_m, forward_m))
    cos, sin = np.cos(turn_rad)[:, None], np.sin(turn_rad)[:, None]
    left, up, left_after, up_after = -before[:, 0], -before[:, 1], -after[:, 0], -after[:, 1]
    ahead_turned, left_turned = cos - sin * left_after, sin + cos * left_after
    error = left_m * up_after - left * ahead_m * up_after + up * (ahead_m * left_turned - left_m * ahead_turned)
    length = np.hypot(ahead_m, left_m) * np.sqrt((before**2).sum(axis=1) + (after**2).sum(axis=1) + 1e-4)
    cost: FloatArray = np.minimum(np.abs(error / length), outlier).sum(axis=1)
    return cost


def _camera_shift(turn_rad: FloatArray, step_m: float, forward_m: float) -> tuple[FloatArray, FloatArray]:
    """Metres ahead and to the left that a camera ``forward_m`` ahead of the rear axle moves while the axle follows an arc.

    It is given for each of the turns; ``step_m`` is about the length of the arc.
    """
    ahead_m = step_m * np.cos(0.5 * turn_rad) + forward_m * (np.cos(turn_rad) - 1.0)
    return ahead_m, step_m * np.sin(0.5 * turn_rad) + forward_m * np.sin(turn_rad)


def estimate_step(
    before: Grey, after: Grey, turn_rad: float, expected_m: float, focal_px: float, camera: CameraGeometry
) -> float:
    """Metres along the arc between two frames: the shift at which the road seen from above agrees best.

    Args:
        before: the first frame.
        after: the second frame.
        turn_rad: turn to the left between them.
        expected_m: the step before this one; it is returned where the road tells nothing.
        focal_px: focal length of the camera in pixels.
        camera: where it sits.
    """
    agreement = _agreement(before, after, turn_rad, focal_px, camera)
    shift_m = PIXEL_M * np.arange(len(agreement))
    change_m = np.abs(shift_m - expected_m)
    possible = (shift_m >= LEAST_STEP_M) & (change_m <= LARGEST_CHANGE_M)
    likely = np.where(possible, agreement - SPEED_CHANGE_PER_M2 * change_m**2, -np.inf)
    best = int(np.argmax(likely))
    if agreement[best] < LEAST_CORRELATION or not possible[best]:
        return expected_m
    return PIXEL_M * (best + peak_in_row(agreement, best))


def seen_step(before: Grey, after: Grey, turn_rad: float, camera: CameraGeometry) -> tuple[float, float]:
    """Metres along the arc between two frames about which nothing is expected, and how well the frames agree there, up to 1.

    Arguments as of ``estimate_step``. The answer is wrong now and then, as one stretch of road looks like the next.
    """
    agreement = _agreement(before, after, turn_rad, camera.focal_px(after.shape[1]), camera)
    best = int(np.argmax(agreement))
    return PIXEL_M * (best + peak_in_row(agreement, best)), float(agreement[best])


def _agreement(before: Grey, after: Grey, turn_rad: float, focal_px: float, camera: CameraGeometry) -> Float32Array:
    """Correlation (K,) of the road in two frames, seen from above, for each shift along the road in steps of ``PIXEL_M``."""
    strip = _road_from_above(before, 0.0, focal_px, camera)
    template = _road_from_above(after, turn_rad, focal_px, camera)[: round(TEMPLATE_M / PIXEL_M), BESIDE_PX:-BESIDE_PX]
    correlation = cv2.matchTemplate(strip, template, cv2.TM_CCOEFF_NORMED)
    agreement: Float32Array = correlation[:, BESIDE_PX - PLAY_PX : BESIDE_PX + PLAY_PX + 1].max(axis=1)
    return agreement


def grey_image(frame: Frame) -> Grey:
    """The frame in grey."""
    return _grey(frame)


def _road_from_above(image: Grey, turn_rad: float, focal_px: float, camera: CameraGeometry) -> Float32Array:
    """The road ahead of the camera seen from above, rows going ahead and columns to the left, less its mean along ``LINE_PX``.

    With a turn it is laid out along the axes of the frame before the turn, about the place to which the turn alone, without any
    distance, would have taken the camera.
    """
    ahead_m, left_m = np.meshgrid(np.arange(NEAR_M, FAR_M, PIXEL_M), np.arange(-ASIDE_M, ASIDE_M, PIXEL_M), indexing="ij")
    moved_ahead_m, moved_left_m = _camera_shift(np.array(turn_rad), 0.0, camera.forward_m)
    x_m, y_m, cos, sin = ahead_m - moved_ahead_m, left_m - moved_left_m, math.cos(turn_rad), math.sin(turn_rad)
    depth_m = np.maximum(cos * x_m + sin * y_m, 0.5)
    column = 0.5 * (image.shape[1] - 1) - focal_px * (cos * y_m - sin * x_m) / depth_m
    row = 0.5 * (image.shape[0] - 1) + focal_px * camera.height_m / depth_m
    seen = cv2.remap(
        image, column.astype(np.float32), row.astype(np.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    ).astype(np.float32)
    plain: Float32Array = seen - cv2.blur(seen, (1, LINE_PX))
    return plain
