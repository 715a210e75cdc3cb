"""The road as it is read at each keyframe, kept with the map: refinement later compares it with the road network.

The reader is better if it knows how many metres were driven since the frame before, to a tenth or two; a map knows units only.
How many metres a unit has is seen on the ground that passes between two frames: the median over many, as single ones are often
wrong.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

import numpy as np

from hippodrome.core.reading import RoadReader, RoadReading
from hippodrome.core.types import PAINT_PLACES, UNSEEN_PERCENT, Frame, LaneReadings, Observation, UInt8Array
from hippodrome.core.views.config import CameraGeometry
from hippodrome.core.views.odometry import grey_image, seen_step

SCALES: Final = 31  # of which the median is taken: about 150 m of road
ENOUGH: Final = 7  # of them, before the scale is believed
SELDOM: Final = 4  # keyframes between two looks at the scale, once it is known
LEAST_AGREEMENT: Final = 0.6  # of the ground in two frames: below it, steps are often wrong
STEP_M: Final = (0.5, 3.5)  # steps that two frames can tell


class RoadLog:
    """Reads the road in the keyframes of a drive.

    Args:
        camera: where it sits on the vehicle.
    """

    def __init__(self, camera: CameraGeometry) -> None:
        self._camera = camera
        self._reader: RoadReader | None = None
        self._readings: list[RoadReading] = []
        self._paint: list[UInt8Array] = []
        self._scales: deque[float] = deque(maxlen=SCALES)  # metres per unit
        self._before: Frame | None = None  # the last frame, and units and rad since
        self._since_frame = np.zeros(2)
        self._keyframes = 0

    @property
    def metres_per_unit(self) -> float:
        """As the passing ground tells; nan as long as it does not."""
        return float(np.median(self._scales)) if len(self._scales) >= ENOUGH else math.nan

    def move(self, observation: Observation) -> None:
        """Count what was driven since the last frame."""
        self._since_frame = self._since_frame + observation.dt_s * np.array([observation.speed, observation.yaw_rate_radps])

    def see(self, frame: Frame) -> None:
        """Keep a frame, after it was read if it is that of a keyframe, to be compared with the next."""
        self._before, self._since_frame = frame, np.zeros(2)

    def read(self, frame: Frame, travelled: float, turned_rad: float) -> None:
        """Read the road in the frame of a new keyframe, ``travelled`` units and ``turned_rad`` after the one before."""
        if self._keyframes % SELDOM == 0 or len(self._scales) < SCALES:
            self._look_at_scale(frame)
        self._keyframes += 1
        if self._reader is None:
            self._reader = RoadReader(self._camera.on_road(frame.shape[1], frame.shape[0]))
        self._readings.append(self._reader.read(frame, travelled * self.metres_per_unit, turned_rad))
        self._paint.append(self._reader.paint(self._readings[-1]))

    def _look_at_scale(self, frame: Frame) -> None:
        units, turned_rad = self._since_frame.tolist()
        before, seen = self._before, self._camera.sees_road_ahead(frame.shape[1], frame.shape[0])
        if before is None or before.shape != frame.shape or not units > 0.0 or not seen:
            return
        step_m, agreement = seen_step(grey_image(before), grey_image(frame), turned_rad, self._camera)
        if agreement > LEAST_AGREEMENT and STEP_M[0] < step_m < STEP_M[1]:
            self._scales.append(step_m / units)

    def finish(self) -> LaneReadings:
        """What was read at all keyframes so far."""
        return lane_readings(self._readings, self._paint)


def lane_readings(readings: list[RoadReading], paint: list[UInt8Array]) -> LaneReadings:
    """Readings, one of each visit, as arrays, with the paint (2, PAINT_PLACES) along the borders at each."""

    def column(name: str) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
        return np.array([getattr(reading, name) for reading in readings], dtype=np.float32)

    edges = np.array([[reading.left_edge, reading.right_edge] for reading in readings], dtype=np.float64).reshape(-1, 2)
    return LaneReadings(
        offset_m=column("offset_m"),
        offset_variance_m2=column("offset_variance_m2"),
        heading_rad=column("heading_rad"),
        heading_variance_rad2=column("heading_variance_rad2"),
        curvature_1pm=column("curvature_1pm"),
        curvature_change_1pm2=column("curvature_change_1pm2"),
        end_m=column("end_m"),
        end_variance_m2=column("end_variance_m2"),
        end=np.array([int(reading.end) for reading in readings], dtype=np.uint8),
        edge_percent=np.where(np.isfinite(edges), np.rint(100.0 * np.nan_to_num(edges)), UNSEEN_PERCENT).astype(np.uint8),
        paint=np.array(paint, dtype=np.uint8).reshape(-1, 2, PAINT_PLACES),
    )
