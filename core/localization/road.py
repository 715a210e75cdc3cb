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
from hippodrome.core.reading.borders import CONTRADICTS, FITS, fit_of_borders
from hippodrome.core.reading.dashes import NO_PAINT
from hippodrome.core.roads.geometry import RoadGeometry, poses_on_segments, project
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray, Frame, IntArray, UInt8Array
from hippodrome.core.views.config import CameraGeometry

REACH_M = 9.0  # two lanes aside and what lies beside the second: lanes farther from the believed position tell nothing
SAME_WAY_RAD = math.radians(30.0)  # lanes whose direction differs less from the believed heading lead the same way
ACROSS_M = 1.4  # a larger disagreement is another lane's
CLEARER_M = 1.2  # by which the next lane must disagree more, or it is unknown which of them is driven
ALONG_M = 5.0  # a larger disagreement about the lane's end is another line's
SIGMAS = 3.0  # of disagreement within which a reading is believed
APART_M = 2.0  # way between two readings of the lane that are taken: closer ones err together
CHORD_M = 2.0  # half the length of the chord that gives the direction of a lane drawn in straight pieces
BEFORE_END_M = 0.9  # from the near edge of a stop line to the end of its lane
LANE_SIGMA_M, LANE_SIGMA_RAD = 0.06, 0.015  # errors that readings of one street share
ACROSS = (0.0, 1.0, 0.0)  # what the place in the lane tells of (along, across, turned)
OWN_M = 5.0  # lanes farther aside are not the vehicle's
BESIDE_M = 0.3  # by which the nearest place of a lane lies ahead of or behind a vehicle that is beside it
TIMES = 6  # that the borders must contradict the believed lane, one after the other, until it is another
LOOK_M, LOOK_SIGMA_M = 8.0, 0.15  # ahead, where the place of the lane is compared, too: in bends it tells how far along
END_APART_M = 1.0  # way between two readings of the end
END_WORTH, END_WORTH_M = 2.5, 35.0  # what the end of a lane is worth against views, and the way over which that fades
END_SIGMA_M = {LaneEnd.STOP_LINE: 0.2, LaneEnd.MOUTH: 0.3}
UNREAD_M, UNREAD_RAD = 100.0, 1.0  # standard deviations of what was not read


@dataclass(frozen=True, slots=True)
class _Lane:
    """The lane that was read, at the foot of the believed position, and how what was read differs from what was believed."""

    heading_rad: float
    across_m: float  # by how far the vehicle is farther left than believed
    turned_rad: float  # by how much it is turned farther left
    curvature_1pm: float
    to_end_m: float
    ahead_m: float  # by how far the lane ``LOOK_M`` ahead lies farther right than believed; nan where the lane does not reach
    slope: float  # of the lane there against the believed heading
    changed: bool  # whether it is another lane than the one that the vehicle was believed on


class RoadSense:
    """Reads frames and compares them with the road network."""

    def __init__(self, roads: RoadGeometry, camera: CameraGeometry) -> None:
        self._roads, self._camera = roads, camera
        self._reader: RoadReader | None = None
        self._reading = RoadReading()  # of the last frame
        self.since_m = math.inf  # driven since the lane was read last
        self._other_lane = (-1, 0)  # that the borders fit, if not the believed one, and how often they did
        self.since_end_m = math.inf  # and since its end was

    def move(self, moved_m: float) -> None:
        """Count the way driven."""
        self.since_m += abs(moved_m)
        self.since_end_m += abs(moved_m)

    def distrust(self) -> float:
        """By how much less views are to be trusted along the road: their errors, which are the map's, are alike for a street."""
        return 1.0 + END_WORTH * math.exp(-self.since_end_m / END_WORTH_M)

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
        self._reading = reading = self._reader.read(frame, moved_m, turned_rad)
        if not reading.sees_lane:
            return None
        lane = self._lane(reading, pose, covariance)
        return None if lane is None else self._measured(reading, lane, pose, covariance)

    def paint(self) -> UInt8Array:
        """The paint (2, PAINT_PLACES) along the borders of the lane in the frame that was read last."""
        return NO_PAINT if self._reader is None else self._reader.paint(self._reading)

    def _lane(self, reading: RoadReading, pose: FloatArray, covariance: FloatArray) -> _Lane | None:
        """The lane that fits the reading best, if it alone does.

        Lanes that lie side by side are told from each other by their borders: one at the road's edge has no lane beyond. If the
        borders contradict the believed lane time after time, and fit one beside it, the vehicle is on that.
        """
        network = self._roads.network
        near = project(self._roads, pose[None, :2], REACH_M)
        off_rad = wrap_compiled(near.heading_rad - pose[2])
        away = pose[:2] - near.foot_m
        left = np.cos(near.heading_rad) * away[:, 1] - np.sin(near.heading_rad) * away[:, 0]
        beside = (np.abs(left) > near.distance_m - BESIDE_M) & ~network.is_internal[near.lane]  # not before it or behind it
        rows = np.flatnonzero(beside & (np.abs(off_rad) < SAME_WAY_RAD) & (np.abs(left) < OWN_M))
        if len(rows) == 0:
            return None
        across = reading.offset_m - left[rows]
        best = int(np.argmin(np.abs(across)))
        changed = False
        if len(rows) > 1:
            road = np.flatnonzero(beside & (np.abs(np.sin(off_rad)) < math.sin(SAME_WAY_RAD)))
            aside = np.cos(pose[2]) * -away[:, 1] - np.sin(pose[2]) * -away[:, 0]  # left of the vehicle
            edges, widths_m = (reading.left_edge, reading.right_edge), network.width_m[near.lane[rows]]
            fits = np.array([fit_of_borders(*edges, aside[k], aside[road], w) for k, w in zip(rows, widths_m, strict=True)])
            chosen = self._told_apart(fits, best, near.lane[rows])
            if chosen is None:
                return None
            changed, best = chosen != best, chosen
        row, off = rows[best], float(across[best])
        normal = np.array([-math.sin(near.heading_rad[row]), math.cos(near.heading_rad[row])])
        variance = float(normal @ covariance[:2, :2] @ normal) + reading.offset_variance_m2 + network.survey_sigma_m**2
        if not changed and abs(off) > min(ACROSS_M, SIGMAS * math.sqrt(variance + LANE_SIGMA_M**2)):
            return None
        return self._compared(reading, int(near.lane[row]), float(near.position_m[row]), off, pose, changed)

    def _told_apart(self, fits: FloatArray, believed: int, lanes: IntArray) -> int | None:
        """Row of the lane that the borders tell, of lanes side by side, by the log likelihood of each; None: they do not tell."""
        fitting = np.flatnonzero(fits > FITS)
        if len(fitting) != 1 or np.sum(fits > CONTRADICTS) != 1:
            self._other_lane = (-1, 0)
            return None
        chosen = int(fitting[0])
        if chosen == believed:
            self._other_lane = (-1, 0)
            return chosen
        lane, times = self._other_lane
        self._other_lane = (int(lanes[chosen]), times + 1 if lane == lanes[chosen] else 1)
        if self._other_lane[1] < TIMES:
            return None
        self._other_lane = (-1, 0)
        return chosen

    def _compared(self, reading: RoadReading, lane: int, at_m: float, across_m: float, pose: FloatArray, changed: bool) -> _Lane:
        """How the reading differs from the lane of the network at an arc length, as seen from the believed pose."""
        length_m = float(self._roads.lane_length_m[lane])
        along = at_m + np.concatenate([[-CHORD_M, CHORD_M], np.arange(0.0, LOOK_M + 4.0, 0.5)])
        points = poses_on_segments(self._roads, np.full(len(along), lane), along)[:, :2]
        chord = points[1] - points[0]
        heading = math.atan2(chord[1], chord[0])
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        away = points[2:] - pose[:2]
        x, y = cos * away[:, 0] + sin * away[:, 1], cos * away[:, 1] - sin * away[:, 0]
        ahead, slope = math.nan, 0.0
        if length_m - at_m > LOOK_M + 2.0 and np.all(np.diff(x) > 0.0):
            near, far = (float(np.interp(LOOK_M + d, x, y)) for d in (-1.0, 1.0))
            slope = 0.5 * (far - near)
            ahead = 0.5 * (near + far) - _lane_ahead_m(reading)
        turned = float(wrap_compiled(heading + reading.heading_rad - pose[2]))
        return _Lane(heading, across_m, turned, reading.curvature_1pm, length_m - at_m, ahead, slope, changed)

    def _measured(self, reading: RoadReading, lane: _Lane, pose: FloatArray, covariance: FloatArray) -> PoseMeasurement | None:
        """The believed pose, corrected by what was read; its variances are large for what was not.

        What was read are linear functions of the error (along, across, turned) of the believed pose in the lane's axes.
        """
        survey = self._roads.network.survey_sigma_m**2
        cos, sin = math.cos(lane.heading_rad), math.sin(lane.heading_rad)
        axes = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        believed = axes.T @ covariance @ axes
        rows: list[tuple[tuple[float, float, float], float, float]] = []
        if self.since_m >= APART_M:
            rows.append((ACROSS, lane.across_m, reading.offset_variance_m2 + LANE_SIGMA_M**2 + survey))
            rows.append(((-lane.curvature_1pm, 0.0, 1.0), lane.turned_rad, reading.heading_variance_rad2 + LANE_SIGMA_RAD**2))
            if math.isfinite(lane.ahead_m):
                rows.append(((-lane.slope, 1.0, LOOK_M), lane.ahead_m, LOOK_SIGMA_M**2 + survey))
        if reading.end is not LaneEnd.NOTHING and self.since_end_m >= END_APART_M:
            off = lane.to_end_m - (BEFORE_END_M if reading.end is LaneEnd.STOP_LINE else 0.0) - reading.end_m
            if abs(off) < ALONG_M:
                rows.append(((1.0, 0.0, 0.0), off, reading.end_variance_m2 + END_SIGMA_M[reading.end] ** 2 + survey))
        kept = [row for row in rows if _agrees(row, believed) or (lane.changed and row[0] == ACROSS)]
        if not kept:
            return None
        self.since_m = 0.0 if any(row[0][1] == 1.0 for row in kept) else self.since_m
        self.since_end_m = 0.0 if any(row[0][0] == 1.0 for row in kept) else self.since_end_m
        by = np.array([row[0] for row in kept])
        weight = 1.0 / np.array([row[2] for row in kept])
        told = np.linalg.inv(by.T @ (weight[:, None] * by) + np.diag([UNREAD_M**-2, UNREAD_M**-2, UNREAD_RAD**-2]))
        off = told @ by.T @ (weight * np.array([row[1] for row in kept]))
        return PoseMeasurement(pose + axes @ off, axes @ told @ axes.T)


def _agrees(row: tuple[tuple[float, float, float], float, float], believed: FloatArray) -> bool:
    """Whether something that was read is near enough to what was believed of it."""
    by = np.array(row[0])
    return row[1] ** 2 < SIGMAS**2 * (row[2] + float(by @ believed @ by))


def _lane_ahead_m(reading: RoadReading) -> float:
    """Where the middle of the lane that was read lies ``LOOK_M`` ahead, left positive."""
    sin, cos = math.sin(-reading.heading_rad), math.cos(reading.heading_rad)
    y = -reading.offset_m
    for _ in range(4):
        along = cos * LOOK_M + sin * y
        bent = 0.5 * reading.curvature_1pm * (LOOK_M**2 + y * y) + reading.curvature_change_1pm2 * along**3 / 6.0
        y = (-reading.offset_m + bent + sin * LOOK_M) / cos
    return y
