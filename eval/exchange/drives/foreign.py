"""A drive that somebody else recorded, as the readers hand it over: nothing is decoded, resampled or believed yet."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image, UnidentifiedImageError

from hippodrome.core import se2
from hippodrome.core.types import FloatArray, Frame, Trajectory
from hippodrome.eval.exchange.drives.exported import ExchangeError
from hippodrome.eval.exchange.drives.poses import Axes, planar, rotations
from hippodrome.eval.metrics.association import MAX_GAP_S

MAX_IMAGE_BYTES = 64 << 20
MAX_PIXELS = 64_000_000  # a hostile image can claim any size in a few bytes
MAX_TABLE_BYTES = 512 << 20
MIN_NORM, MAX_NORM = 0.5, 1.5  # of a quaternion: writers round


@dataclass(frozen=True, slots=True, eq=False)
class ForeignFrame:
    """A frame where it lies."""

    t_s: float
    name: str  # for errors
    load: Callable[[], bytes]  # an encoded image


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Self-motion: row ``i`` holds over ``(t_s[i - 1], t_s[i]]``. Speed in any unit of length, the same throughout."""

    t_s: FloatArray  # (N,)
    speed: FloatArray  # (N,)
    yaw_rate_radps: FloatArray  # (N,)


@dataclass(frozen=True, slots=True, eq=False)
class ForeignDrive:
    """Frames in order of time, and what else was found."""

    frames: Sequence[ForeignFrame]
    motion: Motion | None
    truth: Trajectory | None
    focal_px: float | None


def read_table(path: Path, columns: int, separator: str | None = None, exactly: bool = False) -> FloatArray:
    """Numbers (N, columns or more) of a text file; lines that begin with # are comments. Raises ExchangeError with the line."""
    rows = []
    for number, line in enumerate(read_lines(path), start=1):
        if not line.strip() or line.startswith("#"):
            continue
        words = line.strip().split(separator)
        if len(words) < columns or (exactly and len(words) != columns):
            raise ExchangeError(f"{path}: line {number}: {len(words)} columns, expected {columns}")
        try:
            rows.append([float(word) for word in words[:columns]])
        except ValueError:
            raise ExchangeError(f"{path}: line {number}: not a number in '{line.strip()[:60]}'") from None
    if not rows:
        raise ExchangeError(f"{path}: no data")
    table = np.array(rows)
    if not np.isfinite(table).all():
        raise ExchangeError(f"{path}: data row {int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0]) + 1} is not finite")
    return table


def read_lines(path: Path) -> list[str]:
    """Lines of a text file of bounded size."""
    try:
        if (size := path.stat().st_size) > MAX_TABLE_BYTES:
            raise ExchangeError(f"{path}: {size} bytes, the limit is {MAX_TABLE_BYTES}")
        return path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ExchangeError(f"{path}: cannot be read as text: {error}") from None


def trajectory_of(t_s: FloatArray, positions: FloatArray, quaternions_xyzw: FloatArray, axes: Axes, name: str) -> Trajectory:
    """Planar poses of 3-D ones, checked."""
    norm = np.linalg.norm(quaternions_xyzw, axis=1)
    if not ((norm > MIN_NORM) & (norm < MAX_NORM)).all():
        bad = int(np.flatnonzero(~((norm > MIN_NORM) & (norm < MAX_NORM)))[0])
        raise ExchangeError(f"{name}: pose {bad} has no unit quaternion")
    return increasing(Trajectory(t_s, planar(positions, rotations(quaternions_xyzw), axes)), name)


def increasing(trajectory: Trajectory, name: str) -> Trajectory:
    """The trajectory itself. Raises ExchangeError if its times do not increase."""
    require_increasing(trajectory.t_s, name)
    return trajectory


def require_increasing(t_s: FloatArray, name: str) -> None:
    if (np.diff(t_s) <= 0.0).any():
        bad = int(np.flatnonzero(np.diff(t_s) <= 0.0)[0]) + 1
        raise ExchangeError(f"{name}: time {t_s[bad]:.6f} of row {bad} does not increase; sort the rows, drop duplicates")


def motion_table(t_s: FloatArray, speed: FloatArray, yaw_rate: FloatArray, name: str) -> Motion:
    """Self-motion, checked."""
    if len(t_s) < 2:
        raise ExchangeError(f"{name}: {len(t_s)} row(s) of self-motion, at least 2 are needed")
    require_increasing(t_s, name)
    return Motion(t_s, speed, yaw_rate)


def motion_of(trajectory: Trajectory, name: str) -> Motion:
    """Poses differentiated: between two of them the vehicle drives an arc, backwards if it lies behind."""
    if len(trajectory.t_s) < 3:
        raise ExchangeError(f"{name}: {len(trajectory.t_s)} pose(s), at least 3 are needed to tell self-motion")
    dt_s = np.diff(trajectory.t_s)
    steps = se2.between(trajectory.poses[:-1], trajectory.poses[1:])
    half_turn = steps[:, 2] / 2.0
    arc = np.hypot(steps[:, 0], steps[:, 1]) / np.sinc(half_turn / np.pi)  # chord of a circle to its arc
    ahead = steps[:, 0] * np.cos(half_turn) + steps[:, 1] * np.sin(half_turn)
    return Motion(trajectory.t_s[1:], np.copysign(arc, ahead) / dt_s, steps[:, 2] / dt_s)


def truth_at(truth: Trajectory, t_s: FloatArray) -> FloatArray:
    """Poses (N, 3), nan where the truth has a gap or has not begun."""
    poses = se2.interpolate(truth.t_s, truth.poses, t_s)
    after = np.clip(np.searchsorted(truth.t_s, t_s), 1, max(len(truth.t_s) - 1, 1))
    gap_s = truth.t_s[np.minimum(after, len(truth.t_s) - 1)] - truth.t_s[after - 1]
    near = np.abs(truth.t_s[np.minimum(after, len(truth.t_s) - 1)] - t_s) < 1e-6
    near |= np.abs(truth.t_s[after - 1] - t_s) < 1e-6
    inside = (t_s >= truth.t_s[0]) & (t_s <= truth.t_s[-1]) & (gap_s <= MAX_GAP_S)
    poses[~(inside | near)] = np.nan
    return poses


def decode(frame: ForeignFrame) -> Frame:
    """RGB (H, W, 3), 8 bits: grey is repeated, alpha dropped, 16 bits scaled. Raises ExchangeError."""
    blob = frame.load()
    if len(blob) > MAX_IMAGE_BYTES:
        raise ExchangeError(f"{frame.name}: {len(blob)} bytes, the limit is {MAX_IMAGE_BYTES}")
    try:
        with Image.open(io.BytesIO(blob)) as header:  # reads no pixel
            width, height = header.size
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise ExchangeError(f"{frame.name}: not an image ({' '.join(str(error).split())[:80]})") from None
    if width * height > MAX_PIXELS or min(width, height) < 16:
        raise ExchangeError(f"{frame.name}: {width} x {height} pixels; at least 16 a side, at most {MAX_PIXELS} in all")
    image: Any = cv2.imdecode(np.frombuffer(blob, np.uint8), cv2.IMREAD_COLOR)
    if image is None or image.shape[:2] != (height, width):
        raise ExchangeError(f"{frame.name}: a damaged image")
    return np.ascontiguousarray(image[:, :, ::-1])


def file_frame(t_s: float, path: Path) -> ForeignFrame:
    """A frame in a file of its own."""

    def load() -> bytes:
        try:
            if (size := path.stat().st_size) > MAX_IMAGE_BYTES:
                raise ExchangeError(f"{path}: {size} bytes, the limit is {MAX_IMAGE_BYTES}")
            return path.read_bytes()
        except OSError as error:
            raise ExchangeError(f"{path}: cannot be read: {error.strerror}") from None

    return ForeignFrame(t_s, str(path), load)


def inside(folder: Path, name: str, listed_in: Path) -> Path:
    """A file that a list names; a list cannot lead out of its folder."""
    if Path(name).is_absolute() or ".." in Path(name).parts:
        raise ExchangeError(f"{listed_in}: '{name}' lies outside of the folder")
    return folder / name
