"""The pose that is steered by: the localizer's pose, corrected by the lane and by what is seen across it.

An extended Kalman filter on x, y, heading in the network frame and the error of the metres, in standard deviations. The
localizer's pose is a measurement of little weight, since its error changes slowly: what it says again and again is the same
error. The lane read from a frame corrects the pose across the lane and its heading; a stop line or a junction's mouth corrects it
along the lane, and so does the ground about the vehicle (``ground_fit``). Metres since the last such correction are all wrong by
about the same share, and each correction along the way tells of it: so it belongs to the state, as a first-order Gauss-Markov
process of variance 1. How large a share that is changes with what tells the metres, dashes or the odometry's scale, and is told
with each step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hippodrome.core.reading.types import LaneEnd, RoadReading
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray, LocalizationEstimate

ALONG_PER_M = 0.005  # variance along the way that each metre adds
SCALE_SIGMA = 0.025  # and the share of the way that it is wrong by, where nothing better is told
SCALE_MEMORY_M = 100.0  # over which that share forgets itself, as dashes and views tell the metres anew
HEADING_RAD_PER_SQRT_M = 0.003  # random walk of the heading
SIDE_RAD = 0.005  # drift across per metre
LOCALIZED_M, LOCALIZED_RAD = (
    (1.5, 3.0),
    0.15,
)  # of the localizer's pose, each time: its errors repeat, across longer than along
LANE_FLOOR_M, LANE_FLOOR_RAD = 0.08, 0.02  # a lane read from a frame is not better than that
END_FLOOR_M = {LaneEnd.STOP_LINE: 0.4, LaneEnd.MOUTH: 0.4}  # nor where a stop line or a mouth lies
STOP_LINE_BEFORE_END_M = 0.9  # the near edge of a stop line, before the end of the lane
UNHEARD_M = 30.0  # of a place by the road network, where it is not heard along the way
LOOSE_M, LOOSE_RAD = 1.0, 0.1  # how wrong a pose may be that the lanes contradict
GATE = 9.0  # squared standard deviations that a measurement of the lane may be off
APART_M, APART_SIGMAS, APART_RAD = 4.0, 3.5, 0.5  # the localizer is elsewhere: so far off
ASIDE_M = 2.2  # or so far to a side, which is another lane: there the lane that is read is the wrong one
END_GATE_M = 4.0  # and metres that an end of the lane may be off: there is another junction beyond


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A pose (3,) in the network frame, the error of the metres, and the covariance (4, 4) of x, y, heading and that error.

    ``metres_off`` is by how many of its standard deviations ln of the metres that are told falls short of those that are driven.
    """

    pose: FloatArray
    covariance: FloatArray
    metres_off: float = 0.0

    @property
    def sigma_m(self) -> float:
        """Standard deviation of the position, as the root mean square over both axes."""
        return math.sqrt(max(0.5 * float(self.covariance[0, 0] + self.covariance[1, 1]), 0.0))

    @property
    def along_sigma_m(self) -> float:
        """Standard deviation along the heading."""
        along = np.array([math.cos(self.pose[2]), math.sin(self.pose[2])])
        return math.sqrt(along_variance_m2(self, along))

    def worst_axis(self) -> tuple[FloatArray, float]:
        """The axis (2,) on which the position is known worst, ahead rather than behind, and the standard deviation on it."""
        values, vectors = np.linalg.eigh(self.covariance[:2, :2])
        axis: FloatArray = vectors[:, 1]
        ahead = axis @ (math.cos(self.pose[2]), math.sin(self.pose[2]))
        return axis if ahead >= 0.0 else -axis, math.sqrt(max(float(values[1]), 0.0))


def along_variance_m2(track: Track, along: FloatArray) -> float:
    """Variance of the position along a direction (2,)."""
    return max(float(along @ track.covariance[:2, :2] @ along), 0.0)


def begun(pose: FloatArray, covariance: FloatArray) -> Track:
    """A track that begins at the localizer's pose, with a covariance (3, 3)."""
    whole = np.zeros((4, 4))
    whole[:3, :3], whole[3, 3] = covariance, 1.0
    return Track(np.array(pose, dtype=np.float64), whole)


def widened(covariance: FloatArray, pose: FloatArray, along_m: float, across_m: float, heading_rad: float) -> FloatArray:
    """The covariance (3, 3) of a pose (3,) that has errors of these standard deviations beside."""
    wider: FloatArray = covariance + _turned(float(pose[2]), along_m**2, across_m**2, heading_rad**2)
    return wider


def moved(track: Track, distance_m: float, turned_rad: float, scale_sigma: float = SCALE_SIGMA) -> Track:
    """The track after a short arc, of whose length the logarithm has a standard deviation ``scale_sigma``."""
    chord, distance_m = track.pose[2] + 0.5 * turned_rad, distance_m * math.exp(scale_sigma * track.metres_off)
    step = distance_m * math.cos(chord), distance_m * math.sin(chord)
    pose = np.array([track.pose[0] + step[0], track.pose[1] + step[1], wrap_compiled(track.pose[2] + turned_rad)])
    far = abs(distance_m)
    kept = math.exp(-far / SCALE_MEMORY_M)
    slope = np.eye(4)
    slope[0, 2], slope[1, 2] = -step[1], step[0]
    slope[0, 3], slope[1, 3], slope[3, 3] = scale_sigma * step[0], scale_sigma * step[1], kept
    noise = np.zeros((4, 4))
    turn_noise = HEADING_RAD_PER_SQRT_M**2 * far + (0.01 * turned_rad) ** 2
    noise[:3, :3] = _turned(pose[2], ALONG_PER_M * far, (SIDE_RAD * far) ** 2, turn_noise)
    noise[3, 3] = 1.0 - kept**2
    return Track(pose, slope @ track.covariance @ slope.T + noise, kept * track.metres_off)


def with_localizer(track: Track, pose: FloatArray, covariance: FloatArray) -> Track:
    """The track after the localizer's pose."""
    noise = covariance + _turned(float(pose[2]), LOCALIZED_M[0] ** 2, LOCALIZED_M[1] ** 2, LOCALIZED_RAD**2)
    return with_pose(track, pose, noise)


def with_pose(track: Track, pose: FloatArray, noise: FloatArray) -> Track:
    """The track after its pose was measured, with a covariance (3, 3)."""
    difference = pose - track.pose
    difference[2] = wrap_compiled(difference[2])
    covariance = track.covariance
    gain = np.asarray(np.linalg.solve((covariance[:3, :3] + noise).T, covariance[:, :3].T).T, dtype=np.float64)
    return _shifted(track, gain @ difference, gain, np.eye(4)[:3], noise)


def with_found(track: Track, pose: FloatArray, noise: FloatArray, across_only: bool = False) -> Track:
    """The track after a place (3,) by the road network, with a covariance (3, 3); along the way it may tell nothing."""
    return with_pose(track, pose, noise + _turned(float(pose[2]), UNHEARD_M**2 if across_only else 0.0, 0.0, 0.0))


def sigmas_apart(track: Track, pose: FloatArray, covariance: FloatArray) -> float:
    """How far a pose with its covariance is from the track's, in standard deviations of both."""
    difference = pose - track.pose
    difference[2] = wrap_compiled(difference[2])
    whole = track.covariance[:3, :3] + covariance
    return math.sqrt(max(float(difference @ np.linalg.solve(whole, difference)), 0.0))


def is_elsewhere(track: Track, estimate: LocalizationEstimate) -> bool:
    """Whether the localizer believes in another place than the one that is steered by."""
    apart = estimate.pose[:2] - track.pose[:2]
    aside_m = abs(float(math.cos(track.pose[2]) * apart[1] - math.sin(track.pose[2]) * apart[0]))
    apart_m = float(np.hypot(*apart))
    turned = abs(math.remainder(float(estimate.pose[2] - track.pose[2]), 2.0 * math.pi))
    sigma_m = track.sigma_m + math.sqrt(max(0.5 * float(np.trace(estimate.covariance[:2, :2])), 0.0))
    is_far = apart_m > max(APART_M, APART_SIGMAS * sigma_m) or aside_m > max(ASIDE_M, APART_SIGMAS * sigma_m)
    return is_far or turned > APART_RAD


def with_lane(track: Track, reading: RoadReading, lane_point_m: FloatArray, lane_heading_rad: float) -> tuple[Track, bool]:
    """The track after the lane was read, and whether the reading fits.

    Args:
        track: the pose before.
        reading: what the frame shows.
        lane_point_m: (2,) the nearest point on the middle of the lane that the vehicle is taken to be in.
        lane_heading_rad: the lane's direction there.
    """
    fits = True
    if reading.sees_lane:
        aside = np.array([-math.sin(lane_heading_rad), math.cos(lane_heading_rad), 0.0, 0.0])
        expected = float(aside[:2] @ (track.pose[:2] - lane_point_m))
        variance = reading.offset_variance_m2 + LANE_FLOOR_M**2
        track, fits = _measured(track, aside, reading.offset_m - expected, variance)
    if fits and reading.heading_variance_rad2 < math.inf:
        turned = wrap_compiled(lane_heading_rad + reading.heading_rad - track.pose[2])
        track, _ = _measured(
            track, np.array([0.0, 0.0, 1.0, 0.0]), float(turned), reading.heading_variance_rad2 + LANE_FLOOR_RAD**2
        )
    return track, fits


def with_end(track: Track, reading: RoadReading, to_end_m: float, lane_heading_rad: float) -> tuple[Track, bool]:
    """The track after an end of the lane was seen ahead, and whether it fits; ``to_end_m`` is where the track expects it."""
    nearer_m = end_off_m(reading, to_end_m)
    if math.isnan(nearer_m):
        return track, True
    if abs(nearer_m) > END_GATE_M:
        return track, False
    along = np.array([math.cos(lane_heading_rad), math.sin(lane_heading_rad), 0.0, 0.0])
    return _measured(track, along, nearer_m, reading.end_variance_m2 + END_FLOOR_M[reading.end] ** 2)


def end_off_m(reading: RoadReading, to_end_m: float) -> float:
    """By how much the vehicle is farther along than believed, by an end of the lane that is seen; nan where none is."""
    if reading.end is LaneEnd.NOTHING or not math.isfinite(reading.end_variance_m2):
        return math.nan
    return to_end_m - reading.end_m - (STOP_LINE_BEFORE_END_M if reading.end is LaneEnd.STOP_LINE else 0.0)


def loosened(track: Track, heading_rad: float) -> Track:
    """The track as it is where lanes that are read again and again tell that it is wrong across."""
    looser = track.covariance.copy()
    looser[:3, :3] += _turned(heading_rad, 0.0, LOOSE_M**2, LOOSE_RAD**2)
    return replace(track, covariance=looser)


def known_along(track: Track, axis: FloatArray, ahead_m: float, variance_m2: float) -> Track:
    """The track of which the place on an axis (2,) is known anew: ``ahead_m`` farther than believed, with a variance.

    What is known of all else follows as far as it hangs together with that place: with a = P e / s^2 the state moves by a m and
    the covariance becomes P + a a^T (v - s^2), which is exact for Gaussians. A place that is a surprise tells that the pose was
    wrong, and nothing of the metres: so much is added to s^2 first.
    """
    row = np.array([*axis, 0.0, 0.0])
    surprise_m2 = max(ahead_m**2 + variance_m2 - float(row @ track.covariance @ row), 0.0)
    before = track.covariance + surprise_m2 * np.outer(row, row)
    cross = before @ row
    before_m2 = float(row @ cross)
    if before_m2 <= 0.0:
        return track
    share = cross / before_m2
    return _changed(track, ahead_m * share, before + (variance_m2 - before_m2) * np.outer(share, share))


def told_along_m(before: Track, after: Track) -> float:
    """Standard deviation along the heading of what made the one track of the other: infinite where it told nothing of that."""
    along = np.array([math.cos(before.pose[2]), math.sin(before.pose[2])])
    was_m2, is_m2 = along_variance_m2(before, along), along_variance_m2(after, along)
    return math.sqrt(was_m2 * is_m2 / (was_m2 - is_m2)) if is_m2 < was_m2 else math.inf


def farther_on(track: Track, ahead_m: float, sigma_m: float) -> tuple[Track, bool]:
    """The track after the ground told that the vehicle is ``ahead_m`` farther along its heading than believed."""
    along = np.array([math.cos(track.pose[2]), math.sin(track.pose[2]), 0.0, 0.0])
    return _measured(track, along, ahead_m, sigma_m**2)


def beside_border(track: Track, offset_m: float, heading_rad: float, sigma_m: float) -> tuple[Track, bool]:
    """The track after the border beside the path told that the vehicle is ``offset_m`` to the left of where it is believed."""
    aside = np.array([-math.sin(heading_rad), math.cos(heading_rad), 0.0, 0.0])
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
    rest = np.eye(4) - gain @ rows
    return _changed(track, shift, rest @ track.covariance @ rest.T + gain @ noise @ gain.T)


def _changed(track: Track, shift: FloatArray, covariance: FloatArray) -> Track:
    """The track with its state moved by (4,), and another covariance."""
    pose = track.pose + shift[:3]
    pose[2] = wrap_compiled(pose[2])
    return Track(pose, covariance, track.metres_off + float(shift[3]))


def _turned(heading_rad: float, sq_along: float, sq_across: float, sq_heading: float) -> FloatArray:
    """A covariance (3, 3) given along and across a heading."""
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    rotated: FloatArray = turn @ np.diag([sq_along, sq_across, sq_heading]) @ turn.T
    return rotated
