"""Self-motion in a file of its own: a table of speeds, or poses to be differentiated."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hippodrome.core.types import FloatArray, Trajectory
from hippodrome.eval.exchange.drives.clock import TimeUnit, unit_of
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import ForeignDrive, Motion, motion_of
from hippodrome.eval.exchange.drives.lever import Ahead, moved_to_axle
from hippodrome.eval.exchange.drives.poses import Axes
from hippodrome.eval.exchange.readers.motion_csv import is_motion, read_motion
from hippodrome.eval.exchange.readers.tables import is_kitti_poses, read_poses
from hippodrome.eval.exchange.readers.text import read_lines, read_table
from hippodrome.eval.files import spatial
from hippodrome.eval.files.spatial import flatten

CSV, POSES = "speed and yaw rate", "poses differentiated"


def read_self_motion(
    path: Path, axes: Axes, t_s: FloatArray | None, unit: TimeUnit | None, ahead: Ahead = "auto"
) -> tuple[Motion, str]:
    """The self-motion of a file, and words that say what it was made of.

    Args:
        path: A table of speeds and yaw rates, or TUM's or KITTI's poses.
        axes: Which way TUM poses point.
        t_s: Times (N,) of KITTI's poses; None: unknown.
        unit: Unit of the file's times; None recognises it.
        ahead: How far ahead of the rear axle the poses lie, in their unit; "auto" estimates it. What is used is printed.

    Raises:
        ExchangeError: It cannot be read.
    """
    if path.suffix.lower() == ".csv" or (path.suffix.lower() != ".tum" and is_motion(path)):
        return read_motion(path, unit), f"{path.name}, {CSV}"
    return motion_of(moved_to_axle(_level_poses(path, axes, t_s, unit), ahead, str(path)), str(path)), f"{path.name}, {POSES}"


def _level_poses(path: Path, axes: Axes, t_s: FloatArray | None, unit: TimeUnit | None) -> Trajectory:
    """Planar poses of a file, turned level. They are refused if attitudes and motion contradict each other."""
    if is_kitti_poses(path) or (unit or unit_of(read_table(path, 8)[:, 0])) != "s":
        return read_poses(path, axes, t_s, unit)
    return flatten(spatial.read_poses(path, axes))


def read_bare_odometry(path: Path, axes: Axes, fps: float | None, unit: TimeUnit | None, ahead: Ahead = "auto") -> ForeignDrive:
    """A drive without any frame: its self-motion alone. KITTI's poses are ``1 / fps`` seconds apart. Raises ExchangeError."""
    if not path.is_file():
        raise ExchangeError(f"{path}: no such file; give a .csv of t_s,speed,yaw_rate, a .tum of poses, or KITTI's poses")
    t_s = None if fps is None else np.arange(sum(bool(line.strip()) for line in read_lines(path))) / fps
    motion, _ = read_self_motion(path, axes, t_s, unit, ahead)
    return ForeignDrive([], motion, None, None, pose_t_s=t_s)
