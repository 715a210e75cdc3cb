"""Poses in space, of six degrees of freedom, and the way from them to the plane in which everything here is scored.

Trackers answer in a frame of their own: that of their first camera, pitched as the camera was, or with y down. To drop a
coordinate of such a frame bends the drive. So the ground is found first: the way up is told by the attitudes (less the camera's
mounting, which is told by the direction of motion), refined by the plane of the positions where they span one, or by the truth.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, TypeAlias

import numpy as np
from scipy.spatial.transform import Rotation

from hippodrome.core.types import FloatArray, Trajectory
from hippodrome.eval.files.directions import angle_deg, chords, turn_up
from hippodrome.eval.files.number_words import first_that_is_none, no_number, with_commas
from hippodrome.eval.files.rows import row_of_numbers, text_lines
from hippodrome.eval.files.trajectories import HEAD
from hippodrome.eval.metrics.alignment import DegenerateAlignment, umeyama
from hippodrome.eval.metrics.association import TrajectoryError

Axes: TypeAlias = Literal["body", "camera"]

LEVEL_FROM_DEG: Final = (
    3.0  # a frame whose up is nearer than this to z stays: roads climb, and KITTI's first camera is pitched by 1
)
AGREE_DEG: Final = 25.0  # a plane farther than this from what the attitudes call up is not the ground
MIN_WIDTH: Final = 0.1  # least width of a drive, as a share of its length, at which a plane can be laid on it
FARTHEST: Final = 1e9  # a position in any unit of length; the equator has 4e7 m
BENT: Final = 0.05  # how far a rotation's columns may be from orthonormal ones: writers round
SURE: Final = 0.9  # length of the mean direction of motion, from 0 (all ways) to 1, from which one may speak of one


@dataclass(frozen=True, slots=True, eq=False)
class SpatialPoses:
    """N poses in space."""

    t_s: FloatArray  # (N,)
    positions: FloatArray  # (N, 3)
    rotations: FloatArray  # (N, 3, 3) from the moving frame to the world's
    axes: Axes  # of the moving frame; body: x forward, z up; camera: z forward, y down
    own: bool = False  # whether hippodrome wrote the file: then its clock is the recording's
    notes: tuple[str, ...] = ()


def read_poses(path: Path, axes: Axes | None = None, times: Path | None = None) -> SpatialPoses:
    """Read TUM poses (8 columns), or KITTI's (12 columns: then ``times`` has a time a line).

    ``axes`` says what the attitudes turn; None: the vehicle's axes for TUM, the camera's for KITTI. Rows that
    repeat the time of the one before are left out, and counted in the notes.

    Raises:
        TrajectoryError: The file is not such poses, or contradicts itself; the message names file, line and cure.
    """
    lines = text_lines(path)
    rows = [(n, line.split()) for n, line in enumerate(lines, start=1) if line.strip() and not line.lstrip().startswith("#")]
    if not rows:
        raise TrajectoryError(f"{path}: no poses")
    width = len(rows[0][1])
    if width not in (8, 12):
        raise TrajectoryError(
            f"{path}: line {rows[0][0]}: {width} columns, expected 8 (TUM: t x y z qx qy qz qw) or 12 (KITTI, with --times)"
            f"{with_commas(' '.join(rows[0][1]), 8)}"
        )
    table = np.array([row_of_numbers(path, number, words, width) for number, words in rows])
    if width == 12:
        found = _kitti(path, table, axes or "camera", times)
    else:
        found = _tum(path, table, axes or "body", bool(lines) and lines[0].startswith(HEAD))
    return believed(str(path), found)


def is_own(path: Path) -> bool:
    """Whether hippodrome wrote this file of poses; its poses are the rear axle's. Raises TrajectoryError if it cannot be read."""
    lines = text_lines(path)
    return bool(lines) and lines[0].startswith(HEAD)


def believed(name: str, poses: SpatialPoses) -> SpatialPoses:
    """The poses without rows that repeat a time; with the direction of motion in place of attitudes that are but a filler.

    Args:
        name: How errors and notes name the poses.
        poses: As they were read. Those that hippodrome wrote are not asked whether they contradict themselves.

    Raises:
        TrajectoryError: They are not finite, not in order of time, or contradict themselves.
    """
    found = _in_order(name, poses)
    if (far := np.abs(found.positions).max(axis=1) > FARTHEST).any():
        raise TrajectoryError(f"{name}: sample {int(np.flatnonzero(far)[0])}: a position beyond {FARTHEST:g}; check the columns")
    with np.errstate(all="ignore"):
        squares = np.einsum("nji,njk->nik", found.rotations, found.rotations) - np.eye(3)
        bent = ~(np.abs(squares).max(axis=(1, 2)) <= BENT) | ~(np.linalg.det(found.rotations) > 0.0)
    if bent.any():
        raise TrajectoryError(f"{name}: sample {int(np.flatnonzero(bent)[0])}: its attitude is no rotation; check the columns")
    if found.own:
        return found
    found = _with_course(name, found)
    _check(name, found)
    return found


def axes_driven(poses: SpatialPoses) -> Axes | None:
    """Whose axes the attitudes turn, by the way they move: "body" along x, "camera" along z; None where that does not tell."""
    forward = motion_in_body(poses)
    found: dict[int, Axes] = {0: "body", 2: "camera"}
    return found.get(int(np.argmax(np.abs(forward)))) if np.linalg.norm(forward) > SURE else None


def flatten(poses: SpatialPoses, truth: SpatialPoses | None = None) -> Trajectory:
    """Planar poses: turned so that the ground is level, then height, roll and pitch are dropped.

    Args:
        poses: Poses in any frame.
        truth: Poses of other times whose z is up: the poses are turned as their best rigid or similarity fit to these in space
            (Umeyama) says, where that is well determined, else by themselves.
    """
    turn = level(poses) if truth is None else level_to(poses, truth)
    positions = poses.positions @ turn.T
    forward = poses.rotations[:, :, 0 if poses.axes == "body" else 2] @ turn.T
    return Trajectory(poses.t_s, np.column_stack([positions[:, :2], np.arctan2(forward[:, 1], forward[:, 0])]))


def level(poses: SpatialPoses) -> FloatArray:
    """The rotation (3, 3) that turns the ground of these poses level; the identity where z is up already."""
    up = _up(poses)
    if angle_deg(up, np.array([0.0, 0.0, 1.0])) < LEVEL_FROM_DEG:
        return np.eye(3)
    centred = poses.positions - poses.positions.mean(axis=0)
    _, spread, directions = np.linalg.svd(centred, full_matrices=False)
    if len(spread) == 3 and spread[1] > MIN_WIDTH * spread[0] and spread[2] < 0.5 * spread[1]:
        normal = directions[2] if directions[2] @ up > 0.0 else -directions[2]
        up = normal if angle_deg(normal, up) < AGREE_DEG else up
    return turn_up(up)


def level_to(poses: SpatialPoses, truth: SpatialPoses) -> FloatArray:
    """The rotation (3, 3) of the best similarity fit of the poses to the truth in space.

    That of ``level`` where the drive is too straight to tell, or where the fit would turn the vehicle over or on its side.
    """
    own = level(poses)
    inside = (poses.t_s >= truth.t_s[0]) & (poses.t_s <= truth.t_s[-1])
    if inside.sum() < 3 or _is_planar(poses):
        return own
    target = np.column_stack([np.interp(poses.t_s[inside], truth.t_s, truth.positions[:, k]) for k in range(3)])
    spread = np.linalg.svd(target - target.mean(axis=0), compute_uv=False)
    if spread[1] <= MIN_WIDTH * spread[0]:
        return own
    try:
        turn = umeyama(poses.positions[inside], target, with_scale=True).rotation
    except DegenerateAlignment:
        return own
    return turn if angle_deg(turn @ _up(poses), np.array([0.0, 0.0, 1.0])) < AGREE_DEG else own


def motion_in_body(poses: SpatialPoses) -> FloatArray:
    """The mean direction of motion (3,) in the axes of the moving frame: of length 1 where it is always the same."""
    first, second = chords(poses.positions)
    if len(first) == 0:
        return np.zeros(3)
    along = poses.positions[second] - poses.positions[first]
    directions = along / np.linalg.norm(along, axis=1, keepdims=True)
    before = np.einsum("nji,nj->ni", poses.rotations[first], directions)
    after = np.einsum("nji,nj->ni", poses.rotations[second], directions)
    mean: FloatArray = ((before + after) / 2.0).mean(axis=0)
    return mean


def lifted(trajectory: Trajectory) -> SpatialPoses:
    """Planar poses in space, at z = 0."""
    zeros = np.zeros(len(trajectory.t_s))
    positions = np.column_stack([trajectory.poses[:, :2], zeros])
    rotations: FloatArray = Rotation.from_euler("z", trajectory.poses[:, 2:]).as_matrix()
    return SpatialPoses(trajectory.t_s, positions, rotations, "body")


def _up(poses: SpatialPoses) -> FloatArray:
    """The way up (3,) in the world of the poses: the mean of the vehicle's own, whose pitch against its camera is taken out."""
    nominal_up = np.array([0.0, 0.0, 1.0]) if poses.axes == "body" else np.array([0.0, -1.0, 0.0])
    forward = motion_in_body(poses)
    if (size := float(np.linalg.norm(forward))) > SURE:
        forward = forward / size
        nominal_up = nominal_up - (nominal_up @ forward) * forward
    up = (poses.rotations @ nominal_up).mean(axis=0)
    length = float(np.linalg.norm(up))
    return up / length if length > 0.1 else np.array([0.0, 0.0, 1.0])


def _is_planar(poses: SpatialPoses) -> bool:
    """Whether these are poses of a plane, written as poses in space: z is one height, and only the heading turns."""
    return bool(np.ptp(poses.positions[:, 2]) == 0.0 and np.abs(poses.rotations[:, 2, :2]).max() < 1e-9)


def _with_course(name: str, poses: SpatialPoses) -> SpatialPoses:
    """The poses themselves; or, where all attitudes are one that the motion contradicts, with the direction of motion as heading.

    Many write positions alone as TUM, with 0 0 0 1 in the place of the attitude.
    """
    constant = len(poses.t_s) > 2 and float(np.ptp(poses.rotations, axis=0).max()) < 1e-9
    if not constant or poses.axes != "body" or abs(motion_in_body(poses)[0]) > 0.99:
        return poses
    steps = np.gradient(poses.positions[:, :2], axis=0)
    moving = np.flatnonzero(np.hypot(steps[:, 0], steps[:, 1]) > 0.0)
    if len(moving) == 0:
        return poses
    last = moving[np.clip(np.searchsorted(moving, np.arange(len(steps)), side="right") - 1, 0, None)]
    course = np.arctan2(steps[last, 1], steps[last, 0])
    note = f"{name}: its attitudes never change, so headings are taken from the direction of motion"
    return SpatialPoses(poses.t_s, poses.positions, Rotation.from_euler("z", course[:, None]).as_matrix(), "body", False,
                        (*poses.notes, note))  # fmt: skip


def _check(name: str, poses: SpatialPoses) -> None:
    """Raise TrajectoryError if the poses look like degrees, like another order of columns or like other axes."""
    t_s, xy = poses.t_s, poses.positions[:, :2]
    if len(t_s) > 1 and np.median(np.diff(t_s)) > 1e4:
        raise TrajectoryError(f"{name}: its poses lie {np.median(np.diff(t_s)):.3g} s apart: the times look like nanoseconds; "
                              "divide them by 1e9")  # fmt: skip
    extent = float(np.hypot(*np.ptp(xy, axis=0)))
    away = float(np.abs(np.median(xy, axis=0)).max())
    degrees = (np.abs(xy).min(axis=1) <= 90.0).all() and (np.abs(xy) <= 180.0).all()
    if degrees and len(t_s) > 2 and 1e-5 < extent < 1.0 and away > max(1.0, 10.0 * extent):
        raise TrajectoryError(
            f"{name}: x and y look like latitude and longitude in degrees (all within {extent:.2g} of one another); give a table "
            "with named columns (t_s,lat,lon), GPX or NMEA, and --network, so that they are projected"
        )
    forward = motion_in_body(poses)
    swapped = Rotation.from_matrix(poses.rotations).as_quat()  # what was read as x y z w, in case it was w x y z
    order = Rotation.from_quat(np.roll(swapped, -1, axis=1)).as_matrix()
    other = motion_in_body(SpatialPoses(poses.t_s, poses.positions, order, poses.axes))
    lost, lost_other = 1.0 - abs(forward[_AHEAD[poses.axes]]), 1.0 - abs(other[_AHEAD[poses.axes]])
    if lost_other < 0.02 and lost > 10.0 * lost_other + 0.002:
        raise TrajectoryError(
            f"{name}: heading and direction of motion disagree, and would agree if the attitude were written qw qx qy qz; "
            "put its columns into the order qx qy qz qw"
        )
    main = int(np.argmax(np.abs(forward)))
    if np.linalg.norm(forward) > SURE and main != _AHEAD[poses.axes]:
        cure = {0: "give --axes body", 2: "give --axes camera"}.get(main, "turn the attitudes so that x points forward")
        raise TrajectoryError(f"{name}: the poses drive along their {'xyz'[main]} axis, not along {poses.axes} axes; {cure}")


_AHEAD: Final = {"body": 0, "camera": 2}


def _in_order(name: str, poses: SpatialPoses) -> SpatialPoses:
    for what, values in (("time", poses.t_s), ("position", poses.positions), ("attitude", poses.rotations)):
        if not np.isfinite(values).all():
            bad = int(np.flatnonzero(~np.isfinite(values.reshape(len(values), -1)).all(axis=1))[0])
            raise TrajectoryError(f"{name}: sample {bad}: its {what} is not finite")
    steps = np.diff(poses.t_s)
    if (steps < 0.0).any():
        bad = int(np.flatnonzero(steps < 0.0)[0]) + 1
        raise TrajectoryError(f"{name}: time {poses.t_s[bad]} of sample {bad} does not increase; sort the rows by time")
    kept = np.concatenate([[True], steps > 0.0])
    if kept.all():
        return poses
    note = f"{name}: {int((~kept).sum())} row(s) with the time of the one before are left out"
    return SpatialPoses(
        poses.t_s[kept], poses.positions[kept], poses.rotations[kept], poses.axes, poses.own, (*poses.notes, note)
    )


def _tum(path: Path, table: FloatArray, axes: Axes, own: bool) -> SpatialPoses:
    norm = np.linalg.norm(table[:, 4:], axis=1)
    if not ((norm > 0.5) & (norm < 1.5)).all():
        bad = int(np.flatnonzero(~((norm > 0.5) & (norm < 1.5)))[0])
        raise TrajectoryError(f"{path}: sample {bad}: qx qy qz qw is not a unit quaternion")
    return SpatialPoses(table[:, 0], table[:, 1:4], Rotation.from_quat(table[:, 4:]).as_matrix(), axes, own)


def _kitti(path: Path, table: FloatArray, axes: Axes, times: Path | None) -> SpatialPoses:
    if times is None:
        raise TrajectoryError(f"{path}: 12 columns, poses of KITTI, have no times; give --times FILE, a time in seconds a line")
    stamps = [line.split()[0] for line in text_lines(times) if line.strip() and not line.lstrip().startswith("#")]
    if len(stamps) != len(table):
        raise TrajectoryError(f"{times}: {len(stamps)} times for the {len(table)} poses of {path}")
    try:
        t_s = np.array([float(stamp) for stamp in stamps])
    except ValueError:
        raise TrajectoryError(f"{times}: {no_number(first_that_is_none(stamps))}") from None
    matrices = table.reshape(-1, 3, 4)
    return SpatialPoses(t_s, matrices[:, :, 3], matrices[:, :, :3], axes)
