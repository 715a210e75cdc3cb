"""Layouts made of text tables and image files: TUM RGB-D, KITTI odometry, EuRoC (ASL)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hippodrome.core.types import FloatArray, Trajectory
from hippodrome.eval.exchange.drives.camera import OPTICAL_IN_BODY
from hippodrome.eval.exchange.drives.clock import TimeUnit, in_seconds
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import (
    ForeignDrive,
    ForeignFrame,
    Motion,
    level_trajectory,
    motion_table,
    trajectory_of,
)
from hippodrome.eval.exchange.drives.images import file_frame
from hippodrome.eval.exchange.drives.poses import Axes
from hippodrome.eval.exchange.drives.tables import ODOMETRY
from hippodrome.eval.exchange.readers.motion_csv import PLAIN, TIME_UNITS, columns_named, in_units, read_motion
from hippodrome.eval.exchange.readers.pictures import image_files
from hippodrome.eval.exchange.readers.text import focal_length, inside, read_lines, read_table, read_values

KITTI_CAMERAS = ("image_2", "image_0", "image_3", "image_1")
EUROC_ODOMETRY = Path("odometry0", "data.csv")
EUROC_TRUTH = Path("state_groundtruth_estimate0", "data.csv")


def read_tum_folder(folder: Path, axes: Axes) -> ForeignDrive:
    """Read a folder of the TUM layout: ``rgb.txt`` and its images; ``groundtruth.txt`` and ``odometry.csv`` where they exist."""
    frames = _listed(folder / "rgb.txt", None, 1.0, folder)
    truth = read_tum_poses(folder / "groundtruth.txt", axes) if (folder / "groundtruth.txt").exists() else None
    return ForeignDrive(frames, _odometry(folder / ODOMETRY), truth, None)


def read_kitti_sequence(folder: Path, axes: Axes) -> ForeignDrive:
    """Read a folder ``sequences/NN``: ``times.txt``, ``image_2`` or ``image_0``; the truth is ``../../poses/NN.txt``."""
    t_s = read_table(folder / "times.txt", 1)[:, 0]
    images = next((folder / name for name in KITTI_CAMERAS if (folder / name).is_dir()), None)
    if images is None:
        raise ExchangeError(f"{folder}: no image_2 or image_0 in it; give a folder sequences/NN of the KITTI odometry layout")
    numbered = {int(path.stem): path for path in image_files(images) if path.stem.isdecimal()}
    frames = [file_frame(float(t), numbered[number]) for number, t in enumerate(t_s) if number in numbered]
    if not frames:
        raise ExchangeError(f"{images}: no file NNNNNN.png or NNNNNN.jpg in it")
    if len(frames) < len(t_s):
        print(f"{images}: {len(t_s) - len(frames)} of {len(t_s)} frames are missing; the drive goes on without them")
    poses, truth = folder.parent.parent / "poses" / f"{folder.name}.txt", None
    if poses.exists():
        partly = folder / "truth_times.txt"
        truth = kitti_poses(poses, read_table(partly, 1)[:, 0] if partly.exists() else t_s, folder / "origin.txt", axes)
    return ForeignDrive(frames, _odometry(folder / ODOMETRY), truth, _kitti_focal(folder / "calib.txt"), pose_t_s=t_s)


def read_euroc_folder(folder: Path, axes: Axes) -> ForeignDrive:
    """Read a EuRoC folder: ``mav0/cam0``; ``mav0/state_groundtruth_estimate0`` and ``mav0/odometry0`` where they exist."""
    root = folder / "mav0" if (folder / "mav0").is_dir() else folder
    frames = _listed(root / "cam0" / "data.csv", ",", 1e-9, root / "cam0" / "data")
    motion, truth = None, None
    if (root / EUROC_ODOMETRY).exists():
        motion = _euroc_motion(root / EUROC_ODOMETRY)
    if (root / EUROC_TRUTH).exists():
        table = read_table(root / EUROC_TRUTH, 8, ",")
        quaternion = np.roll(table[:, 4:8], -1, axis=1)
        truth = trajectory_of(table[:, 0] / 1e9, table[:, 1:4], quaternion, axes, str(root / EUROC_TRUTH), True)
    return ForeignDrive(frames, motion, truth, _euroc_focal(root / "cam0" / "sensor.yaml"))


def _euroc_motion(path: Path) -> Motion:
    """Self-motion in EuRoC's way: nanoseconds, speed, yaw rate, in this order or in that of the first line's names."""
    columns = columns_named(path, read_lines(path), ",") or PLAIN
    places = [columns.time.index, columns.speed.index, columns.yaw_rate.index]
    table = read_table(path, max(places) + 1, ",")[:, places]
    unit = TIME_UNITS.get(columns.time.unit, "ns")
    t_s = table[:, 0] / 1e9 if unit == "ns" else in_seconds(table[:, 0], unit, str(path))
    return motion_table(t_s, *in_units(path, columns, table), str(path))


def read_tum_poses(path: Path, axes: Axes) -> Trajectory:
    """A TUM trajectory, ``t x y z qx qy qz qw`` a line, with attitudes of any axes."""
    table = read_table(path, 8)
    return trajectory_of(table[:, 0], table[:, 1:4], table[:, 4:8], axes, str(path), True)


def read_poses(path: Path, axes: Axes, t_s: FloatArray | None, unit: TimeUnit | None) -> Trajectory:
    """Poses of a file: TUM's 8 columns, or KITTI's 12 (a 3 x 4 matrix a line, of a camera relative to its first pose).

    Args:
        path: The file.
        axes: Which way the moving frame of TUM poses points. KITTI's are a camera's.
        t_s: Times (N,) that KITTI's poses have; None: nobody knows them.
        unit: Unit of TUM's times; None recognises it.

    Raises:
        ExchangeError: It is neither, or KITTI's poses have no times, or other ones.
    """
    if is_kitti_poses(path):
        if t_s is None:
            raise ExchangeError(f"{path}: poses without times; say how many were taken a second with --fps N (KITTI: 10)")
        return kitti_poses(path, t_s, None, "camera")
    table = read_table(path, 8)
    return trajectory_of(in_seconds(table[:, 0], unit, str(path)), table[:, 1:4], table[:, 4:8], axes, str(path))


def is_kitti_poses(path: Path) -> bool:
    """Whether the first line of data has 12 columns. Raises ExchangeError if the file cannot be read."""
    first = next((line for line in read_lines(path) if line.strip() and not line.lstrip().startswith("#")), "")
    return len(first.split()) == 12


def _odometry(path: Path) -> Motion | None:
    return read_motion(path) if path.exists() else None


def _listed(table: Path, separator: str | None, unit_s: float, images: Path) -> list[ForeignFrame]:
    """The frames that a list of times and file names gives.

    ``unit_s`` is the length of the list's unit of time in seconds, ``images`` the folder that its names start from.
    """
    frames = []
    for number, line in enumerate(read_lines(table), start=1):
        if not line.strip() or line.startswith("#"):
            continue
        words = [word.strip() for word in line.split(separator)]
        try:
            # whole nanoseconds divided, as evo and everybody does: a product with 1e-9 would round differently
            t_s = int(words[0]) / 1e9 if unit_s == 1e-9 else float(words[0]) * unit_s
            name = words[1]
        except (ValueError, IndexError, OverflowError):
            raise ExchangeError(f"{table}: line {number}: not a time and a file name") from None
        if not np.isfinite(t_s):
            raise ExchangeError(f"{table}: line {number}: the time is not finite")
        frames.append(file_frame(t_s, inside(images, name, table)))
    return frames


def kitti_poses(poses: Path, t_s: FloatArray, origin_file: Path | None, axes: Axes) -> Trajectory:
    """Poses from the camera's poses relative to its first, 12 numbers a line.

    Our own exports say in ``origin_file`` where the first pose was in the road network's frame.
    """
    table = read_table(poses, 12)
    if len(table) != len(t_s):
        raise ExchangeError(f"{poses}: {len(table)} poses for {len(t_s)} times; give poses of this drive, one a time")
    found = np.tile(np.eye(4), (len(table), 1, 1))
    found[:, :3] = table.reshape(-1, 3, 4)
    if origin_file is not None and origin_file.exists():
        placed = _origin(origin_file) @ found
        return level_trajectory(t_s, placed[:, :3, 3], placed[:, :3, :3], "camera", str(poses))
    positions, rotation = found[:, :3, 3] @ OPTICAL_IN_BODY.T, OPTICAL_IN_BODY @ found[:, :3, :3]
    return level_trajectory(t_s, positions, rotation, axes, str(poses))


def _origin(path: Path) -> FloatArray:
    """The pose (4, 4) that our exports wrote. Raises ExchangeError."""
    table = read_table(path, 4)
    if len(table) != 4:
        raise ExchangeError(f"{path}: {len(table)} lines of numbers, expected a matrix of 4; export the drive anew")
    return table


def _kitti_focal(path: Path) -> float | None:
    """Focal length in pixels, from the projection matrix P2, else P0, of ``calib.txt``; None if there is no such file."""
    if not path.exists():
        return None
    rows = {line.split(":", 1)[0]: line.split(":", 1)[1].split() for line in read_lines(path) if ":" in line}
    words = rows.get("P2") or rows.get("P0")
    try:
        return focal_length(words[0], path) if words else None
    except ValueError:
        raise ExchangeError(f"{path}: P2 does not begin with a number") from None


def _euroc_focal(path: Path) -> float | None:
    """Focal length in pixels from ``sensor.yaml``; None if there is no such file, or no intrinsics in it."""
    if not path.exists():
        return None
    values = read_values(path, "\n".join(line for line in read_lines(path) if not line.startswith("%YAML")))
    try:
        return focal_length(values["intrinsics"][0], path) if isinstance(values, dict) and "intrinsics" in values else None
    except (ValueError, TypeError, IndexError, KeyError, OverflowError) as error:
        raise ExchangeError(f"{path}: not a sensor description ({' '.join(str(error).split())[:80]})") from None
