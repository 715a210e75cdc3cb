"""Trajectories as TUM text, which evo and most SLAM systems read: ``t x y z qx qy qz qw`` per line, with z = 0 and yaw only."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hippodrome._files import write_atomically
from hippodrome.core.types import FloatArray, Trajectory
from hippodrome.eval.metrics.association import TrajectoryError, check_trajectory

MAX_BYTES = 256 << 20  # about two million poses
COLUMNS = 8
HEAD = "# t_s x y z qx qy qz qw"  # the first line of what we write: its times are the recording's, not those of a foreign drive


def write_tum(path: Path, trajectory: Trajectory) -> None:
    """Write a trajectory. Every number is read back exactly, except that the heading is rounded by way of a quaternion.

    Raises:
        TrajectoryError: It is no trajectory.
    """
    check_trajectory(trajectory, str(path))
    half = trajectory.poses[:, 2] / 2.0
    rows = zip(trajectory.t_s, trajectory.poses[:, 0], trajectory.poses[:, 1], np.sin(half), np.cos(half), strict=True)
    lines = [f"{t_s!r} {x!r} {y!r} 0 0 0 {qz!r} {qw!r}" for t_s, x, y, qz, qw in (map(float, row) for row in rows)]
    write_atomically(path, (HEAD + "\n" + "\n".join(lines) + "\n").encode())


def read_tum(path: Path) -> Trajectory:
    """Read a trajectory; z, roll and pitch are dropped. Raises TrajectoryError, which names the file and the line."""
    try:
        if (size := path.stat().st_size) > MAX_BYTES:
            raise TrajectoryError(f"{path}: {size} bytes, the limit is {MAX_BYTES}")
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise TrajectoryError(f"{path}: cannot be read as text: {error}") from error
    rows = [
        _row(path, number, line)
        for number, line in enumerate(lines, start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not rows:
        raise TrajectoryError(f"{path}: no poses")
    table = np.array(rows)
    trajectory = Trajectory(table[:, 0], np.column_stack([table[:, 1:3], _heading(table[:, 4:])]))
    check_trajectory(trajectory, str(path))
    return trajectory


def _row(path: Path, number: int, line: str) -> list[float]:
    words = line.split()
    if len(words) != COLUMNS:
        raise TrajectoryError(f"{path}: line {number}: {len(words)} columns, expected {COLUMNS} (t x y z qx qy qz qw)")
    try:
        values = [float(word) for word in words]
    except ValueError as error:
        raise TrajectoryError(f"{path}: line {number}: {error}") from error
    if not 0.5 < sum(value * value for value in values[4:]) < 2.0:  # a unit quaternion, loosely: writers round
        raise TrajectoryError(f"{path}: line {number}: qx qy qz qw is not a unit quaternion")
    return values


def _heading(quaternions: FloatArray) -> FloatArray:
    """Yaw (N,) of quaternions (N, 4) in x, y, z, w order, of any norm."""
    x, y, z, w = quaternions.T
    yaw: FloatArray = np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return yaw
