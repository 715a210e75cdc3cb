"""Trajectories as TUM text, which evo and most SLAM systems read: ``t x y z qx qy qz qw`` per line, with z = 0 and yaw only."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hippodrome._files import read_bounded, why_unreadable, write_atomically
from hippodrome.core.types import FloatArray, Trajectory
from hippodrome.eval.files.number_words import no_number, with_commas
from hippodrome.eval.metrics.association import TrajectoryError, check_trajectory

MAX_BYTES = 256 << 20  # about two million poses
MAX_LINES: Final = 4_000_000  # a line of one letter takes fifty times its bytes of memory
COLUMNS = 8
FLAGS: Final = {"1": True, "0": False, "true": True, "false": False, "True": True, "False": False}
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
    return _trajectory(path, [_row(path, number, line) for number, line in _lines(path)])


def read_tum_declared(path: Path) -> tuple[Trajectory, NDArray[np.bool_]] | None:
    """Read a localizer's poses with a ninth column, ``localized``: whether it stands by each. None if there is no such column.

    Lines with 0 there need no meaningful pose, and theirs is that of the line before with 1.

    Raises:
        TrajectoryError: It is no such file, or no line has 1.
    """
    lines = _lines(path)
    if not lines or len(lines[0][1].split()) != COLUMNS + 1:
        return None
    split = [(number, *line.rpartition(line.split()[-1])[::2], line.split()[-1]) for number, line in lines]
    for number, _, _, flag in split:
        if flag not in FLAGS:
            raise TrajectoryError(f"{path}: line {number}: '{flag}' in the column 'localized' is none of {', '.join(FLAGS)}")
    known = np.array([FLAGS[flag] for *_, flag in split], dtype=np.bool_)
    rows: list[list[float]] = []
    last = next((_row(path, number, line) for number, line, _, flag in split if FLAGS[flag]), None)
    if last is None:
        raise TrajectoryError(f"{path}: the column 'localized' is 0 everywhere, so there is nothing to score")
    for number, line, _, flag in split:
        last = _row(path, number, line) if FLAGS[flag] else [_time(path, number, line), *last[1:]]
        rows.append(last)
    return _trajectory(path, rows), known


def _lines(path: Path) -> list[tuple[int, str]]:
    """The lines with poses and their numbers. Raises TrajectoryError."""
    lines = read_lines(path)
    return [(number, one) for number, one in enumerate(lines, start=1) if one.strip() and not one.lstrip().startswith("#")]


def read_lines(path: Path) -> list[str]:
    """All lines of a file of poses, which is not read if it is too long. Raises TrajectoryError."""
    try:
        if (size := path.stat().st_size) > MAX_BYTES:
            raise TrajectoryError(f"{path}: {size} bytes, the limit is {MAX_BYTES}")
        data = read_bounded(path, MAX_BYTES)
        if (count := data.count(b"\n")) > MAX_LINES:
            raise TrajectoryError(f"{path}: {count} lines, the limit is {MAX_LINES}")
        return data.decode("utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise TrajectoryError(f"{path}: cannot be read as text: {why_unreadable(error)}") from error


def _time(path: Path, number: int, line: str) -> float:
    return _number(path, number, next(iter(line.split()), ""))


def _trajectory(path: Path, rows: list[list[float]]) -> Trajectory:
    if not rows:
        raise TrajectoryError(f"{path}: no poses")
    table = np.array(rows)
    trajectory = Trajectory(table[:, 0], np.column_stack([table[:, 1:3], _heading(table[:, 4:])]))
    check_trajectory(trajectory, str(path))
    return trajectory


def _row(path: Path, number: int, line: str) -> list[float]:
    words = line.split()
    if len(words) != COLUMNS:
        cure = with_commas(line, COLUMNS)
        raise TrajectoryError(f"{path}: line {number}: {len(words)} columns, expected {COLUMNS} (t x y z qx qy qz qw){cure}")
    values = [_number(path, number, word) for word in words]
    if not 0.5 < sum(value * value for value in values[4:]) < 2.0:  # a unit quaternion, loosely: writers round
        raise TrajectoryError(f"{path}: line {number}: qx qy qz qw is not a unit quaternion, whose squares add up to 1")
    return values


def _number(path: Path, number: int, word: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise TrajectoryError(f"{path}: line {number}: {no_number(word, number == 1)}") from None


def _heading(quaternions: FloatArray) -> FloatArray:
    """Yaw (N,) of quaternions (N, 4) in x, y, z, w order, of any norm."""
    x, y, z, w = quaternions.T
    yaw: FloatArray = np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return yaw
