"""What is sensed, put together: the own motion in metres, the lane and its lines, the ground about the vehicle."""

from __future__ import annotations

import math

import numpy as np

from hippodrome.core.navigation import footing as footings
from hippodrome.core.navigation import motion as motions
from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.dashes import LEAST_M, MOST_M, LineView, driven_m, line_levels
from hippodrome.core.navigation.searching import LaneMemory, remembered
from hippodrome.core.navigation.sight import Ground
from hippodrome.core.navigation.types import Radar
from hippodrome.core.reading.reader import RoadReader
from hippodrome.core.reading.types import RoadReading
from hippodrome.core.types import Observation

SURE_SIGMA, OFF_SHARE, OFF_M = 0.03, 0.1, 0.1  # a scale so sure is not wrong by more than that: dashes that say so are miscounted
COUNTED_SIGMA, UNCOUNTED_SIGMA, MOST_SIGMA = (
    0.002,
    0.015,
    0.05,
)  # of ln(metres): where dashes that pass tell them, and where the scale alone does
COUNTED_M = 15.0  # over which it is averaged how much of the way dashes have told
SHARPEST_1PM = 0.02  # in sharper bends the line of dashes is not where the lane that was read has it


class Senses:
    """What the vehicle knows without a map.

    Args:
        config: all parameters.
        side: 1 where traffic keeps left, -1 where it keeps right.
        expected_scale: metres per unit of the odometry, before anything was sensed.
    """

    def __init__(self, config: NavigatorConfig, side: float, expected_scale: float) -> None:
        self._config, self._side, self._expected_scale = config, side, expected_scale
        self._reader: RoadReader | None = None
        self._line: LineView | None = None
        self._since_frame = np.zeros(2)  # metres and rad
        self.ground = Ground(config.camera)
        self.motion = motions.Motion()
        self.reading: RoadReading | None = None  # of this step's frame
        self.memory = LaneMemory()
        self.footing = footings.Footing()
        self._counted, self._untold_m = 0.0, 0.0  # share of the last metres that passing dashes told, and metres since they did

    @property
    def drift_sigma(self) -> float:
        """Standard deviation of the share by which the metres are wrong that ``step`` tells."""
        return self._counted * COUNTED_SIGMA + (1.0 - self._counted) * max(UNCOUNTED_SIGMA, min(self.scale_sigma, MOST_SIGMA))

    @property
    def metres_per_unit(self) -> float:
        """The scale of the odometry."""
        return self.motion.metres_per_unit(self._expected_scale)

    @property
    def scale_sigma(self) -> float:
        """Standard deviation of ln(metres per unit)."""
        return self.motion.scale_sigma(self._expected_scale)

    def step(self, observation: Observation, radar: Radar, told_scale: float | None) -> float:
        """Take an observation in: the metres that were driven. ``told_scale`` is the localizer's, where it knows the place."""
        distance_m = self._move(observation, radar, told_scale)
        return distance_m + self._read(observation, distance_m)

    def _move(self, observation: Observation, radar: Radar, told_scale: float | None) -> float:
        """Take the self-motion in: the metres that were driven."""
        if told_scale is not None:
            self.motion = motions.told(self.motion, told_scale, self.motion.speed_mps * observation.dt_s)
        scale = self.motion.metres_per_unit(self._expected_scale)
        self.motion = motions.sensed(self.motion, observation, scale, self._config.vehicle)
        distance_m = scale * observation.speed * observation.dt_s
        self.ground.move(distance_m, observation.yaw_rate_radps * observation.dt_s)
        if observation.frame is not None:
            self.ground.see(observation.frame, radar.gap_m, self.footing.is_on_road)
        self.footing = footings.stepped(self.footing, self.ground, distance_m)
        return distance_m

    def _read(self, observation: Observation, distance_m: float) -> float:
        """Read the lane in a new frame; between frames there is no reading. What was driven more than the scale told (m)."""
        self.reading = None
        self._since_frame = self._since_frame + np.array([distance_m, observation.yaw_rate_radps * observation.dt_s])
        if observation.frame is not None and self._config.read_road:
            if self._reader is None:
                size_px = observation.frame.shape[1], observation.frame.shape[0]
                self._reader = RoadReader(self._config.camera.on_road(*size_px))
            self.reading = self._reader.read(observation.frame, *self._since_frame.tolist())
            self._since_frame = np.zeros(2)
        turned_rad = observation.yaw_rate_radps * observation.dt_s
        border_m = self.ground.border_m(self._side)
        self.memory = remembered(self.memory, self.reading, distance_m, turned_rad, border_m, self._side)
        return self._see_dashes(observation, distance_m)

    def _see_dashes(self, observation: Observation, distance_m: float) -> float:
        """Let the dashes of the centre line tell the scale, and by how many metres it was wrong since the frame before."""
        units = observation.speed * observation.dt_s
        if self._line is not None:
            self._line = LineView(self._line.levels, self._line.units + units, self._line.metres + distance_m)
        memory = self.memory
        self._untold_m += abs(distance_m)
        if self._untold_m > MOST_M:
            self._count(abs(distance_m), 0.0)
        if observation.frame is None or not memory.is_fresh:
            return 0.0
        if abs(memory.curvature_1pm) > SHARPEST_1PM:
            self._line = None
            return 0.0
        levels = line_levels(
            observation.frame, self._config.camera, memory.offset_m, memory.heading_rad, memory.curvature_1pm, -self._side
        )
        if not self.motion.dashes_fit(self._expected_scale) and self.motion.seen_m > motions.LEAST_SEEN_M:
            self.motion = motions.unseen(self.motion)
        scale, (_, sigma) = (
            self.motion.metres_per_unit(self._expected_scale),
            self.motion.scale_without_dashes(self._expected_scale),
        )
        line = self._line
        if line is not None and scale * line.units < LEAST_M:
            return 0.0
        more_m = 0.0
        if line is not None and scale * line.units < MOST_M:
            metres = driven_m(line.levels, levels, scale * line.units, sigma)
            if math.isfinite(metres):
                self.motion = motions.seen(self.motion, metres, line.units)
                more_m = self._told_by_dashes(metres, line.metres)
            else:
                self._count(line.metres, 0.0)
        self._line = LineView(levels, 0.0)
        return more_m

    def _told_by_dashes(self, metres: float, believed_m: float) -> float:
        """What was driven more than was believed by the scale, where that is sure enough to tell dashes that are miscounted."""
        if self.scale_sigma > SURE_SIGMA or abs(metres - believed_m) > OFF_SHARE * believed_m + OFF_M:
            return 0.0
        self._count(believed_m, 1.0)
        self._untold_m = 0.0
        self.ground.move(metres - believed_m, 0.0)
        return metres - believed_m

    def _count(self, driven_m: float, told: float) -> None:
        """Remember which share of the way dashes have told."""
        self._counted += (1.0 - math.exp(-driven_m / COUNTED_M)) * (told - self._counted)
