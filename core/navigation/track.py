"""The pose that is steered by: the localizer's pose, corrected by the lane and by what is seen across it.

An extended Kalman filter on (x, y, heading) in the network frame. The localizer's pose is a measurement of little weight, since
its error changes slowly: what it says again and again is the same error. The lane read from a frame corrects the pose across the
lane and its heading, a stop line or a junction's mouth corrects it along the lane.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hippodrome.core.reading.types import LaneEnd, RoadReading
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray

ALONG_PER_M = 0.005  # variance along the way that each metre adds
SCALE_SIGMA = 0.015  # and the share of the way that it is wrong by: passing dashes tell the scale so well
HEADING_RAD_PER_SQRT_M = 0.003  # random walk of the heading
SIDE_RAD = 0.005  # drift across per metre
LOCALIZED_M, LOCALIZED_RAD = (
    (1.5, 3.0),
    0.15,
)  # of the localizer's pose, each time: its errors repeat, across longer than along
LANE_FLOOR_M, LANE_FLOOR_RAD = 0.08, 0.02  # a lane read from a frame is not better than that
END_FLOOR_M = {LaneEnd.STOP_LINE: 0.4, LaneEnd.MOUTH: 0.4}  # nor where a stop line or a mouth lies
STOP_LINE_BEFORE_END_M = 0.9  # the near edge of a stop line, before the end of the lane
HUMBLE_M, UNHEARD_M = 0.25, 30.0  # each metre that the place by the road network is heard; and where it is not
LOOSE_M, LOOSE_RAD = 1.0, 0.1  # how wrong a pose may be that the lanes contradict
GATE = 9.0  # squared standard deviations that a measurement of the lane may be off
END_GATE_M = 4.0  # and metres that an end of the lane may be off: there is another junction beyond


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A pose (3,) in the network frame and its covariance (3, 3)."""

    pose: FloatArray
    covariance: FloatArray
    since_m: FloatArray  # (2,) way since the place along it was measured, on which the scale is wrong by ``SCALE_SIGMA``

    @property
    def sigma_m(self) -> float:
        """Standard deviation of the position, as the root mean square over both axes, the scale's error included."""
        whole = _with_scale(self).covariance
        return math.sqrt(max(0.5 * float(whole[0, 0] + whole[1, 1]), 0.0))

    @property
    def along_sigma_m(self) -> float:
        """Standard deviation along the heading."""
        along = np.array([math.cos(self.pose[2]), math.sin(self.pose[2])])
        return math.sqrt(along_variance_m2(self, along))


def along_variance_m2(track: Track, along: FloatArray) -> float:
    """Variance of the position along a direction (2,), the scale's error included."""
    return max(float(along @ _with_scale(track).covariance[:2, :2] @ along), 0.0)


def begun(pose: FloatArray, covariance: FloatArray) -> Track:
    """A track that begins at the localizer's pose."""
    return Track(np.array(pose, dtype=np.float64), np.array(covariance, dtype=np.float64), np.zeros(2))


def moved(track: Track, distance_m: float, turned_rad: float, scale_sigma: float = SCALE_SIGMA) -> Track:
    """The track after a short arc, of whose length the logarithm has a standard deviation ``scale_sigma``."""
    chord = track.pose[2] + 0.5 * turned_rad
    step = distance_m * math.cos(chord), distance_m * math.sin(chord)
    pose = np.array([track.pose[0] + step[0], track.pose[1] + step[1], wrap_compiled(track.pose[2] + turned_rad)])
    slope = np.eye(3)
    slope[0, 2], slope[1, 2] = -step[1], step[0]
    far = abs(distance_m)
    noise = _turned(pose[2], ALONG_PER_M * far, (SIDE_RAD * far) ** 2, HEADING_RAD_PER_SQRT_M**2 * far + (0.01 * turned_rad) ** 2)
    return Track(pose, slope @ track.covariance @ slope.T + noise, track.since_m + np.array(step) * (scale_sigma / SCALE_SIGMA))


def with_localizer(track: Track, pose: FloatArray, covariance: FloatArray) -> Track:
    """The track after the localizer's pose."""
    noise = covariance + _turned(float(pose[2]), LOCALIZED_M[0] ** 2, LOCALIZED_M[1] ** 2, LOCALIZED_RAD**2)
    return with_pose(track, pose, noise)


def with_pose(track: Track, pose: FloatArray, noise: FloatArray) -> Track:
    """The track after its pose was measured, with a covariance (3, 3)."""
    track = _with_scale(track)
    difference = pose - track.pose
    difference[2] = wrap_compiled(difference[2])
    gain = np.asarray(np.linalg.solve((track.covariance + noise).T, track.covariance.T).T, dtype=np.float64)
    return _shifted(track, gain @ difference, gain, np.eye(3), noise)


def with_found(track: Track, pose: FloatArray, noise: FloatArray, across_only: bool = False) -> Track:
    """The track after a place by the road network, which has errors of its own: it makes the track less sure than it was, too.

    Args:
        track: before.
        pose: (3,) of the place.
        noise: (3, 3) covariance of it.
        across_only: along the way nothing is told.
    """
    heading, humble_m2 = float(pose[2]), HUMBLE_M**2
    humble = replace(track, covariance=track.covariance + _turned(heading, 0.0 if across_only else humble_m2, humble_m2, 0.0))
    return with_pose(humble, pose, noise + _turned(heading, UNHEARD_M**2 if across_only else 0.0, 0.0, 0.0))


def sigmas_apart(track: Track, pose: FloatArray, covariance: FloatArray) -> float:
    """How far a pose with its covariance is from the track's, in standard deviations of both."""
    difference = pose - track.pose
    difference[2] = wrap_compiled(difference[2])
    whole = _with_scale(track).covariance + covariance
    return math.sqrt(max(float(difference @ np.linalg.solve(whole, difference)), 0.0))


def with_lane(track: Track, reading: RoadReading, lane_point_m: FloatArray, lane_heading_rad: float) -> tuple[Track, bool]:
    """The track after the lane was read, and whether the reading fits.

    Args:
        track: the pose before.
        reading: what the frame shows.
        lane_point_m: (2,) the nearest point on the middle of the lane that the vehicle is taken to be in.
        lane_heading_rad: the lane's direction there.
    """
    fits = True
    track = _with_scale_across(track, lane_heading_rad)
    if reading.sees_lane:
        aside = np.array([-math.sin(lane_heading_rad), math.cos(lane_heading_rad), 0.0])
        expected = float(aside[:2] @ (track.pose[:2] - lane_point_m))
        variance = reading.offset_variance_m2 + LANE_FLOOR_M**2
        track, fits = _measured(track, aside, reading.offset_m - expected, variance)
    if fits and reading.heading_variance_rad2 < math.inf:
        turned = wrap_compiled(lane_heading_rad + reading.heading_rad - track.pose[2])
        track, _ = _measured(track, np.array([0.0, 0.0, 1.0]), float(turned), reading.heading_variance_rad2 + LANE_FLOOR_RAD**2)
    return track, fits


def with_end(track: Track, reading: RoadReading, to_end_m: float, lane_heading_rad: float) -> tuple[Track, bool]:
    """The track after an end of the lane was seen ahead, and whether it fits; ``to_end_m`` is where the track expects it."""
    nearer_m = end_off_m(reading, to_end_m)
    if math.isnan(nearer_m):
        return track, True
    if abs(nearer_m) > END_GATE_M:
        return track, False
    along = np.array([math.cos(lane_heading_rad), math.sin(lane_heading_rad), 0.0])
    return _measured(_with_scale(track), along, nearer_m, reading.end_variance_m2 + END_FLOOR_M[reading.end] ** 2)


def end_off_m(reading: RoadReading, to_end_m: float) -> float:
    """By how much the vehicle is farther along than believed, by an end of the lane that is seen; nan where none is."""
    if reading.end is LaneEnd.NOTHING or not math.isfinite(reading.end_variance_m2):
        return math.nan
    return to_end_m - reading.end_m - (STOP_LINE_BEFORE_END_M if reading.end is LaneEnd.STOP_LINE else 0.0)


def loosened(track: Track, heading_rad: float) -> Track:
    """The track as it is where lanes that are read again and again tell that it is wrong across."""
    return replace(track, covariance=track.covariance + _turned(heading_rad, 0.0, LOOSE_M**2, LOOSE_RAD**2))


def farther_on(track: Track, ahead_m: float, sigma_m: float) -> tuple[Track, bool]:
    """The track after the ground told that the vehicle is ``ahead_m`` farther along its heading than believed."""
    along = np.array([math.cos(track.pose[2]), math.sin(track.pose[2]), 0.0])
    return _measured(_with_scale(track), along, ahead_m, sigma_m**2)


def beside_border(track: Track, offset_m: float, heading_rad: float, sigma_m: float) -> tuple[Track, bool]:
    """The track after the border beside the path told that the vehicle is ``offset_m`` to the left of where it is believed."""
    aside = np.array([-math.sin(heading_rad), math.cos(heading_rad), 0.0])
    return _measured(track, aside, offset_m, sigma_m**2)


def _measured(track: Track, row: FloatArray, innovation: float, variance: float) -> tuple[Track, bool]:
    """A scalar update, and whether the measurement lies within the gate; one that does not is left out."""
    cross = track.covariance @ row
    total = float(row @ cross) + variance
    if innovation**2 > GATE * total:
        return track, False
    gain = cross / total
    return _shifted(track, gain * innovation, gain[:, None], row[None, :], np.array([[variance]])), True


def _shifted(track: Track, shift: FloatArray, gain: FloatArray, rows: FloatArray, noise: FloatArray) -> Track:
    """Joseph's form (I - K H) P (I - K H)^T + K R K^T, which stays symmetric."""
    pose = track.pose + shift
    pose[2] = wrap_compiled(pose[2])
    rest = np.eye(3) - gain @ rows
    return Track(pose, rest @ track.covariance @ rest.T + gain @ noise @ gain.T, track.since_m)


def _with_scale(track: Track) -> Track:
    """The track with the scale's error in its covariance, which then begins to grow anew."""
    if not track.since_m.any():
        return track
    covariance = track.covariance.copy()
    covariance[:2, :2] += SCALE_SIGMA**2 * np.outer(track.since_m, track.since_m)
    return Track(track.pose, covariance, np.zeros(2))


def _with_scale_across(track: Track, heading_rad: float) -> Track:
    """The same for the part across a heading only: what a lane tells. After a turn that is what was along the way before."""
    along = np.array([math.cos(heading_rad), math.sin(heading_rad)])
    kept = float(along @ track.since_m) * along
    across = _with_scale(replace(track, since_m=track.since_m - kept))
    return replace(across, since_m=kept)


def _turned(heading_rad: float, sq_along: float, sq_across: float, sq_heading: float) -> FloatArray:
    """A covariance (3, 3) given along and across a heading."""
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    rotated: FloatArray = turn @ np.diag([sq_along, sq_across, sq_heading]) @ turn.T
    return rotated
