"""What the road right ahead tells the localizer: where in its lane the vehicle is, and how far the lane's end is.

Views tell the place to about a metre along the road, and across it no better than two drivers stay in one lane. The reader
(``core.reading``) measures the place in the lane to centimetres and the stop line to decimetres. With the lane of the network on
which the vehicle is believed to be, either becomes a measured pose, which says nothing of what was not read.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hippodrome.core.localization.beliefs.motion import PoseMeasurement
from hippodrome.core.reading import LaneEnd, RoadReader, RoadReading
from hippodrome.core.roads.geometry import RoadGeometry, poses_on_segments, project
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray, Frame
from hippodrome.core.views.odometry import CameraGeometry

REACH_M = 6.0  # lanes farther than this from the believed position are not the vehicle's
SAME_WAY_RAD = math.radians(30.0)  # lanes whose direction differs less from the believed heading lead the same way
ACROSS_M = 1.4  # a larger disagreement is another lane's
CLEARER_M = 1.2  # by which the next lane must disagree more, or it is unknown which of them is driven
ALONG_M = 5.0  # a larger disagreement about the lane's end is another line's
SIGMAS = 3.0  # of disagreement within which a reading is believed
APART_M = 2.0  # way between two readings of the lane that are taken: closer ones err together
CHORD_M = 2.0  # half the length of the chord that gives the direction of a lane drawn in straight pieces
BEFORE_END_M = 0.9  # from the near edge of a stop line to the end of its lane
LANE_SIGMA_M, LANE_SIGMA_RAD = 0.06, 0.015  # errors that readings of one street share
END_SIGMA_M = {LaneEnd.STOP_LINE: 0.2, LaneEnd.MOUTH: 0.3}
UNREAD_M, UNREAD_RAD = 100.0, 1.0  # standard deviations of what was not read


@dataclass(frozen=True, slots=True)
class _Lane:
    """The lane that was read, at the foot of the believed position."""

    heading_rad: float
    across_m: float  # by how far the vehicle is farther left than believed
    to_end_m: float
    heading_off_rad: float  # by how much it is turned farther left than believed


class RoadSense:
    """Reads frames and compares them with the road network."""

    def __init__(self, roads: RoadGeometry, camera: CameraGeometry) -> None:
        self._roads, self._camera = roads, camera
        self._reader: RoadReader | None = None
        self.since_m = math.inf  # driven since the lane was read last
        self._since_end_m = math.inf  # and since its end was

    def move(self, moved_m: float) -> None:
        """Count the way driven."""
        self.since_m += abs(moved_m)
        self._since_end_m += abs(moved_m)

    def measure(
        self, frame: Frame, moved_m: float, turned_rad: float, pose: FloatArray, covariance: FloatArray
    ) -> PoseMeasurement | None:
        """The pose as the road tells it; None where the frame, or the network, tells nothing.

        Args:
            frame: what the camera sees.
            moved_m: way since the frame before.
            turned_rad: turn to the left since the frame before.
            pose: (3,) as believed.
            covariance: (3, 3) of the belief.
        """
        if self._reader is None:
            self._reader = RoadReader(self._camera.on_road(frame.shape[1], frame.shape[0]))
        reading = self._reader.read(frame, moved_m, turned_rad)
        if not reading.sees_lane:
            return None
        lane = self._lane(reading, pose, covariance)
        return None if lane is None else self._measured(reading, lane, pose, covariance)

    def _lane(self, reading: RoadReading, pose: FloatArray, covariance: FloatArray) -> _Lane | None:
        """The lane that fits the reading best, if it alone does."""
        network = self._roads.network
        near = project(self._roads, pose[None, :2], REACH_M)
        off_rad = wrap_compiled(near.heading_rad - pose[2])
        rows = np.flatnonzero((np.abs(off_rad) < SAME_WAY_RAD) & ~network.is_internal[near.lane])
        away = pose[:2] - near.foot_m
        left = np.cos(near.heading_rad) * away[:, 1] - np.sin(near.heading_rad) * away[:, 0]
        rows = rows[np.abs(left[rows]) > near.distance_m[rows] - 0.3]  # the vehicle is beside the lane, not before or behind it
        if len(rows) == 0:
            return None
        across = reading.offset_m - left[rows]
        best = int(np.argmin(np.abs(across)))
        others = np.delete(np.abs(across), best)
        if len(others) > 0 and float(others.min()) < abs(across[best]) + CLEARER_M:
            return None
        row, off = rows[best], float(across[best])
        normal = np.array([-math.sin(near.heading_rad[row]), math.cos(near.heading_rad[row])])
        variance = float(normal @ covariance[:2, :2] @ normal) + reading.offset_variance_m2 + network.survey_sigma_m**2
        if abs(off) > min(ACROSS_M, SIGMAS * math.sqrt(variance + LANE_SIGMA_M**2)):
            return None
        lane, at = int(near.lane[row]), float(near.position_m[row])
        ends = poses_on_segments(self._roads, np.array([lane, lane]), np.array([at - CHORD_M, at + CHORD_M]))
        heading = math.atan2(*(ends[1, :2] - ends[0, :2])[::-1])
        turned = float(wrap_compiled(heading + reading.heading_rad - pose[2]))
        return _Lane(heading, off, float(self._roads.lane_length_m[lane]) - at, turned)

    def _measured(self, reading: RoadReading, lane: _Lane, pose: FloatArray, covariance: FloatArray) -> PoseMeasurement | None:
        """The believed pose, corrected by what was read; variances are large for what was not."""
        survey = self._roads.network.survey_sigma_m**2
        along_m, sq_along = self._along(reading, lane, covariance)
        off, sq_across, turned, sq_heading = 0.0, UNREAD_M**2, 0.0, UNREAD_RAD**2
        if self.since_m >= APART_M:
            self.since_m, off = 0.0, lane.across_m
            sq_across = reading.offset_variance_m2 + LANE_SIGMA_M**2 + survey
            sq_turned = reading.heading_variance_rad2 + LANE_SIGMA_RAD**2
            if abs(lane.heading_off_rad) < SIGMAS * math.sqrt(sq_turned + covariance[2, 2]):
                turned, sq_heading = lane.heading_off_rad, sq_turned
        elif sq_along == math.inf:
            return None
        sq_along = sq_along + survey if sq_along < math.inf else UNREAD_M**2
        cos, sin = math.cos(lane.heading_rad), math.sin(lane.heading_rad)
        axes = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        return PoseMeasurement(
            pose + axes @ np.array([along_m, off, turned]), axes @ np.diag([sq_along, sq_across, sq_heading]) @ axes.T
        )

    def _along(self, reading: RoadReading, lane: _Lane, covariance: FloatArray) -> tuple[float, float]:
        """By how much the lane's end says that the vehicle is farther along than believed, and the variance; inf: it says nothing."""
        if reading.end is LaneEnd.NOTHING or self._since_end_m < 0.5 * APART_M:
            return 0.0, math.inf
        expected = lane.to_end_m - (BEFORE_END_M if reading.end is LaneEnd.STOP_LINE else 0.0)
        off = expected - reading.end_m
        ahead = np.array([math.cos(lane.heading_rad), math.sin(lane.heading_rad)])
        variance = reading.end_variance_m2 + END_SIGMA_M[reading.end] ** 2
        believed = float(ahead @ covariance[:2, :2] @ ahead)
        if abs(off) > min(ALONG_M, SIGMAS * math.sqrt(variance + believed + self._roads.network.survey_sigma_m**2)):
            return 0.0, math.inf
        self._since_end_m = 0.0
        return off, variance
