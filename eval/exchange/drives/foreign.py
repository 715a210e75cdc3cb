"""A drive that somebody else recorded, as the readers hand it over: nothing is decoded, resampled or believed yet."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hippodrome.core import se2
from hippodrome.core.types import FloatArray, Trajectory
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.poses import Axes, rotations
from hippodrome.eval.files.spatial import SpatialPoses, axes_driven, believed, flatten
from hippodrome.eval.metrics.association import MAX_GAP_S

MIN_NORM, MAX_NORM = 0.5, 1.5  # limits of a unit quaternion's norm: writers round


@dataclass(frozen=True, slots=True, eq=False)
class ForeignFrame:
    """A frame that is not read yet."""

    t_s: float
    name: str  # how errors name it
    load: Callable[[], bytes]  # reads the encoded image


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Self-motion: row ``i`` holds over ``(t_s[i - 1], t_s[i]]``. Speed in any unit of length, the same throughout."""

    t_s: FloatArray  # (N,)
    speed: FloatArray  # (N,)
    yaw_rate_radps: FloatArray  # (N,)


@dataclass(frozen=True, slots=True, eq=False)
class ForeignDrive:
    """What a reader found in a foreign drive; None where the layout has nothing of the kind."""

    frames: Sequence[ForeignFrame]  # in order of time
    motion: Motion | None
    truth: Trajectory | None
    focal_px: float | None  # focal length, in pixels of the frames as recorded
    pose_t_s: FloatArray | None = None  # (N,) times that poses without times of their own have; None: those of the frames
    truth_lat_lon: FloatArray | None = None  # (N, 3) seconds, latitude, longitude in degrees, where the layout has fixes


def trajectory_of(
    t_s: FloatArray, positions: FloatArray, quaternions_xyzw: FloatArray, axes: Axes, name: str, other_axes: bool = False
) -> Trajectory:
    """Planar poses of poses in space.

    Args:
        t_s: Times (N,).
        positions: Positions (N, 3), metres or map units.
        quaternions_xyzw: Attitudes (N, 4), each of a norm near 1.
        axes: What the attitude turns: the vehicle's axes (x forward) or a camera's (z forward).
        name: How errors name the poses.
        other_axes: As of ``level_trajectory``.

    Raises:
        ExchangeError: A quaternion is far from a unit one, or the times do not increase.
    """
    norm = np.linalg.norm(quaternions_xyzw, axis=1)
    if not ((norm > MIN_NORM) & (norm < MAX_NORM)).all():
        bad = int(np.flatnonzero(~((norm > MIN_NORM) & (norm < MAX_NORM)))[0])
        raise ExchangeError(f"{name}: pose {bad} has no unit quaternion")
    return level_trajectory(t_s, positions, rotations(quaternions_xyzw), axes, name, other_axes)


def level_trajectory(
    t_s: FloatArray, positions: FloatArray, rotation: FloatArray, axes: Axes, name: str, other_axes: bool = False
) -> Trajectory:
    """Planar poses of poses in space: turned so that the ground is level, then height, roll and pitch are dropped.

    Rows that repeat the time of the one before are left out. That and what else was done to them is printed.

    Args:
        t_s: Times (N,).
        positions: Positions (N, 3) in a world whose z is up but for a tilt.
        rotation: Attitudes (N, 3, 3).
        axes: What the attitude turns.
        name: How errors name the poses.
        other_axes: Whether poses whose motion contradicts ``axes`` are taken for those of the other ones: of a layout's truth
            where ``axes`` was said of another file.

    Raises:
        HippodromeError: The poses are not finite, not in order of time, or contradict themselves.
    """
    given = SpatialPoses(t_s, positions, rotation, axes)
    if other_axes and (driven := axes_driven(given)) not in (None, axes):
        print(f"note: {name}: the motion says that its poses are of {driven} axes, not of {axes} axes; they are taken so")
        given = SpatialPoses(t_s, positions, rotation, driven or axes)
    poses = believed(name, given)
    for note in poses.notes:
        print(f"note: {note}")
    return flatten(poses)


def require_increasing(t_s: FloatArray, name: str) -> None:
    """Raise ExchangeError, naming the first row at fault, unless the times (N,) increase from row to row."""
    if (np.diff(t_s) <= 0.0).any():
        bad = int(np.flatnonzero(np.diff(t_s) <= 0.0)[0]) + 1
        raise ExchangeError(f"{name}: time {t_s[bad]:.6f} of row {bad} does not increase; sort the rows, drop duplicates")


def motion_table(t_s: FloatArray, speed: FloatArray, yaw_rate: FloatArray, name: str) -> Motion:
    """Self-motion of times (N,), speeds (N,) and yaw rates (N,). Raises ExchangeError on times that do not increase."""
    if len(t_s) < 2:
        raise ExchangeError(f"{name}: {len(t_s)} row(s) of self-motion, at least 2 are needed")
    require_increasing(t_s, name)
    return Motion(t_s, speed, yaw_rate)


def motion_of(trajectory: Trajectory, name: str) -> Motion:
    """Self-motion by differentiating poses: between two of them the vehicle drives an arc of a circle.

    It drives backwards if the second pose lies behind the first. Raises ExchangeError if there are fewer than three poses.
    """
    if len(trajectory.t_s) < 3:
        raise ExchangeError(
            f"{name}: {len(trajectory.t_s)} pose(s), at least 3 are needed to tell self-motion; give the whole drive"
        )
    dt_s = np.diff(trajectory.t_s)
    steps = se2.between(trajectory.poses[:-1], trajectory.poses[1:])
    half_turn = steps[:, 2] / 2.0
    arc = np.hypot(steps[:, 0], steps[:, 1]) / np.sinc(half_turn / np.pi)  # chord of a circle to its arc
    ahead = steps[:, 0] * np.cos(half_turn) + steps[:, 1] * np.sin(half_turn)
    return Motion(trajectory.t_s[1:], np.copysign(arc, ahead) / dt_s, steps[:, 2] / dt_s)


def truth_at(truth: Trajectory, t_s: FloatArray) -> FloatArray:
    """True poses (N, 3) at times (N,), interpolated; NaN where the truth has a gap, has not begun, or has ended."""
    poses = se2.interpolate(truth.t_s, truth.poses, t_s)
    after = np.clip(np.searchsorted(truth.t_s, t_s), 1, max(len(truth.t_s) - 1, 1))
    gap_s = truth.t_s[np.minimum(after, len(truth.t_s) - 1)] - truth.t_s[after - 1]
    near = np.abs(truth.t_s[np.minimum(after, len(truth.t_s) - 1)] - t_s) < 1e-6
    near |= np.abs(truth.t_s[after - 1] - t_s) < 1e-6
    inside = (t_s >= truth.t_s[0]) & (t_s <= truth.t_s[-1]) & (gap_s <= MAX_GAP_S)
    poses[~(inside | near)] = np.nan
    return poses
