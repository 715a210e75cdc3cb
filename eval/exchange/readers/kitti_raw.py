"""The layout of KITTI's raw data: images, their time stamps, and the OXTS unit's motion and position."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import ForeignDrive, Motion, motion_table
from hippodrome.eval.exchange.drives.images import file_frame
from hippodrome.eval.exchange.drives.poses import Axes
from hippodrome.eval.exchange.readers.pictures import image_files
from hippodrome.eval.exchange.readers.text import focal_length, read_lines

CAMERAS: Final = ("image_02", "image_00", "image_03", "image_01")  # colour left, grey left, colour right, grey right
LATITUDE, LONGITUDE, SPEED_FORWARD, YAW_RATE_UP = 0, 1, 8, 22  # columns of a file of oxts/data: lat, lon, vf, wu
OXTS_COLUMNS: Final = 30


def read_kitti_raw(folder: Path, _axes: Axes) -> ForeignDrive:
    """Read a folder ``DATE_drive_NNNN_sync``; self-motion is OXTS's forward speed and yaw rate about the vehicle's up.

    Frames or OXTS files that are missing are counted and printed. Raises ExchangeError.
    """
    camera = next((name for name in CAMERAS if (folder / name / "data").is_dir()), None)
    if camera is None:
        raise ExchangeError(f"{folder}: no image_00/data to image_03/data in it; give a folder DATE_drive_NNNN_sync")
    t_s = _stamps_s(folder / camera / "timestamps.txt")
    numbered = {int(path.stem): path for path in image_files(folder / camera / "data") if path.stem.isdecimal()}
    frames = [file_frame(float(t), numbered[number]) for number, t in enumerate(t_s) if number in numbered]
    if len(frames) < len(t_s):
        print(f"{folder / camera}: {len(t_s) - len(frames)} of {len(t_s)} frames are missing; the drive goes on without them")
    motion, fixes = _oxts(folder / "oxts") if (folder / "oxts" / "data").is_dir() else (None, None)
    return ForeignDrive(frames, motion, None, _focal_px(folder, camera), truth_lat_lon=fixes)


def _oxts(folder: Path) -> tuple[Motion, FloatArray]:
    """Self-motion, and rows (N, 3) of time in seconds, latitude and longitude in degrees.

    OXTS measures at an instant; a row of ours holds since the one before it and is the mean of both.
    """
    t_s = _stamps_s(folder / "timestamps.txt")
    rows: list[list[float]] = []
    kept: list[int] = []
    for number in range(len(t_s)):
        path = folder / "data" / f"{number:010d}.txt"
        if not path.exists() or (kept and t_s[number] <= t_s[kept[-1]]):
            continue
        words = " ".join(read_lines(path)).split()
        try:
            rows.append([float(words[column]) for column in (LATITUDE, LONGITUDE, SPEED_FORWARD, YAW_RATE_UP)])
        except (ValueError, IndexError):
            raise ExchangeError(f"{path}: not the {OXTS_COLUMNS} numbers of an OXTS packet") from None
        kept.append(number)
    if (lost := len(t_s) - len(kept)) > 0:
        print(f"{folder}: {lost} of {len(t_s)} packets are missing or repeat a time and are left out")
    if len(rows) < 3:
        raise ExchangeError(f"{folder}: {len(rows)} packet(s), at least 3 are needed to tell self-motion; give the whole drive")
    table, times_s = np.array(rows), t_s[kept]
    if not np.isfinite(table).all():
        raise ExchangeError(f"{folder}: packet {kept[int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0])]} is not finite")
    mean = (table[1:, 2:] + table[:-1, 2:]) / 2.0
    return motion_table(times_s[1:], mean[:, 0], mean[:, 1], str(folder)), np.column_stack([times_s, table[:, :2]])


def _stamps_s(path: Path) -> FloatArray:
    """Seconds since 1970 (N,) of lines like ``2011-09-26 13:02:25.964389445``. Raises ExchangeError, naming the line."""
    found = []
    for number, line in enumerate(read_lines(path), start=1):
        if not line.strip():
            continue
        whole, _, fraction = line.strip().partition(".")
        try:
            begun = datetime.strptime(whole, "%Y-%m-%d %H:%M:%S").replace(tzinfo=UTC)
            found.append(begun.timestamp() + (int(fraction) / 10 ** len(fraction) if fraction else 0.0))
        except ValueError:
            raise ExchangeError(f"{path}: line {number}: not a time like 2011-09-26 13:02:25.964389445") from None
    if not found:
        raise ExchangeError(f"{path}: no time stamps in it")
    return np.array(found)


def _focal_px(folder: Path, camera: str) -> float | None:
    """Focal length from ``calib_cam_to_cam.txt`` in the folder or above it; None if there is none."""
    path = next((place / "calib_cam_to_cam.txt" for place in (folder, folder.parent)
                 if (place / "calib_cam_to_cam.txt").exists()), None)  # fmt: skip
    if path is None:
        return None
    words = next((line.split()[1:] for line in read_lines(path) if line.startswith(f"P_rect_{camera[-2:]}:")), [])
    try:
        return focal_length(words[0], path) if words else None
    except ValueError:
        raise ExchangeError(f"{path}: P_rect_{camera[-2:]} does not begin with a number") from None
