"""Calibrations in the formats that people have: KITTI's calib.txt, nine numbers, OpenCV's YAML, ROS's camera_info."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.eval.exchange.drives.calibration import Calibration
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.readers.text import read_lines, read_values

MAX_SIDE_PX: Final = 100_000  # of an image
NUMBER: Final = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
MATRICES: Final = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "K", "k", "intrinsic_matrix", "M1")
DISTORTIONS: Final = ("distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "dist_coeffs", "D", "d", "dist", "D1")
KNOWN: Final = ("KITTI's calib.txt (P2: or P0: and 12 numbers), 9 numbers of a matrix row by row, OpenCV's YAML (camera_matrix, "
                "distortion_coefficients), ROS's camera_info YAML")  # fmt: skip


def read_calibration(path: Path) -> Calibration:
    """A camera's calibration, told by the file's content. Raises ExchangeError, which lists the formats."""
    lines = read_lines(path)
    text = "\n".join(lines)
    projections = {found.group(1): found.group(2) for line in lines if (found := re.match(r"^(P\d|P_rect_\d\d):(.*)$", line))}
    for name in ("P2", "P0", "P_rect_02", "P_rect_00", *projections):
        if name in projections:
            numbers = _numbers(path, projections[name], 12)
            return _calibration(path, numbers.reshape(3, 4)[:, :3], np.zeros(0), None)
    if re.search(r"^\s*[\w%]+\s*:", text, re.MULTILINE):
        return _of_yaml(path, text)
    return _calibration(
        path, _numbers(path, re.sub(r"(?m)#.*$|^[A-Za-z].*height.*$", "", text), 9).reshape(3, 3), np.zeros(0), None
    )


def _of_yaml(path: Path, text: str) -> Calibration:
    """A calibration in YAML, also of OpenCV's kind, whose head and tags YAML itself does not know."""
    plain = re.sub(r"!!?opencv-[\w-]+", "", re.sub(r"(?m)^%YAML.*$", "", text))
    values = read_values(path, plain)
    if not isinstance(values, dict):
        raise ExchangeError(f"{path}: not a calibration; known are {KNOWN}")
    matrix = _array(path, values, MATRICES, 9)
    if matrix is None and isinstance(values.get("intrinsics"), list) and len(values["intrinsics"]) == 4:  # EuRoC, Kalibr
        fx, fy, cx, cy = _floats(path, values["intrinsics"])
        matrix = np.array([fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0])
    if matrix is None:
        raise ExchangeError(f"{path}: no camera_matrix in it; known are {KNOWN}")
    distortion = _array(path, values, (*DISTORTIONS, "distortion_coeffs"), None)
    model = str(values.get("distortion_model", values.get("model", ""))).lower()
    fisheye = model in ("fisheye", "equidistant", "kannala_brandt")
    size = _size(values.get("image_width", values.get("width")), values.get("image_height", values.get("height")))
    if size is None and isinstance(values.get("resolution"), list) and len(values["resolution"]) == 2:
        size = _size(*values["resolution"])
    found = np.zeros(0) if distortion is None else distortion
    if len(found) not in (0, 4, 5, 8, 12, 14) or (fisheye and len(found) not in (0, 4)):
        raise ExchangeError(f"{path}: {len(found)} distortion coefficients; OpenCV's models have 4, 5, 8, 12 or 14 (fisheye: 4)")
    return _calibration(path, matrix.reshape(3, 3), found, size, fisheye)


def _size(width: Any, height: Any) -> tuple[int, int] | None:
    """Width and height in pixels; None of what is none."""
    known = [one for one in (width, height) if isinstance(one, int) and 0 < one <= MAX_SIDE_PX]
    return (known[0], known[1]) if len(known) == 2 else None


def _array(path: Path, values: dict[str, Any], names: tuple[str, ...], count: int | None) -> FloatArray | None:
    """The numbers below the first of these names: a list, nested lists or OpenCV's {rows, cols, data}; None without any."""
    value = next((values[name] for name in names if name in values), None)
    if value is None:
        return None
    found = _floats(path, value.get("data") if isinstance(value, dict) else value)
    if count is not None and len(found) != count:
        raise ExchangeError(f"{path}: {len(found)} numbers in a matrix of {count}")
    return found


def _floats(path: Path, value: Any) -> FloatArray:
    try:
        return np.asarray(value, dtype=np.float64).ravel()
    except (ValueError, TypeError, OverflowError):
        raise ExchangeError(f"{path}: not numbers: {str(value)[:60]}") from None


def _numbers(path: Path, text: str, count: int) -> FloatArray:
    words = NUMBER.findall(text)
    if len(words) != count:
        raise ExchangeError(f"{path}: {len(words)} numbers, expected {count}; known are {KNOWN}")
    return np.array([float(word) for word in words])


def _calibration(
    path: Path, matrix: FloatArray, distortion: FloatArray, size_px: tuple[int, int] | None, fisheye: bool = False
) -> Calibration:
    with np.errstate(all="ignore"):  # what is no number then is refused below
        pinhole = matrix / matrix[2, 2] if matrix[2, 2] else matrix
    values = np.concatenate([pinhole.ravel(), distortion])
    if not np.isfinite(values).all() or min(pinhole[0, 0], pinhole[1, 1]) <= 1.0 or np.abs(pinhole[2, :2]).max() > 1e-9:
        raise ExchangeError(f"{path}: not a camera matrix (fx 0 cx, 0 fy cy, 0 0 1 in pixels)")
    return Calibration(pinhole, distortion, size_px, fisheye)
