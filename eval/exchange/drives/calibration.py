"""What is known of a foreign camera's lens: pinhole and distortion, and frames without the distortion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from hippodrome.core.types import FloatArray, Frame
from hippodrome.eval.exchange.drives.errors import ExchangeError


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """A camera's intrinsics in pixels of the frames as recorded; the distortion is OpenCV's k1, k2, p1, p2, k3 .."""

    matrix: FloatArray  # (3, 3)
    distortion: FloatArray  # (D,) all 0 or empty: none
    size_px: tuple[int, int] | None  # width and height that it was made for; None: the file does not say
    fisheye: bool = False  # distortion is of OpenCV's fisheye model (equidistant), four numbers

    @property
    def distorted(self) -> bool:
        return bool(np.any(self.distortion != 0.0))


def scaled(calibration: Calibration, size_px: tuple[int, int], name: str) -> Calibration:
    """The calibration for frames of this width and height, which show all of what it was made for. Raises ExchangeError."""
    if calibration.size_px is None or calibration.size_px == size_px:
        return _checked(calibration, size_px, name)
    across, down = size_px[0] / calibration.size_px[0], size_px[1] / calibration.size_px[1]
    if abs(across / down - 1.0) > 0.02:
        raise ExchangeError(
            f"{name}: made for {calibration.size_px[0]} x {calibration.size_px[1]} pixels, the frames have {size_px[0]} x "
            f"{size_px[1]}, of another shape: they were cropped; calibrate the camera as it was used"
        )
    matrix = np.diag([across, down, 1.0]) @ calibration.matrix
    return _checked(Calibration(matrix, calibration.distortion, size_px, calibration.fisheye), size_px, name)


def _checked(calibration: Calibration, size_px: tuple[int, int], name: str) -> Calibration:
    centre = calibration.matrix[:2, 2] / np.array(size_px)
    if not ((centre > 0.2) & (centre < 0.8)).all():
        raise ExchangeError(
            f"{name}: principal point {calibration.matrix[0, 2]:.1f}, {calibration.matrix[1, 2]:.1f} lies far from the middle of "
            f"frames of {size_px[0]} x {size_px[1]} pixels; scale fx, fy, cx, cy to the size of the frames"
        )
    return calibration


def undistorter(calibration: Calibration, size_px: tuple[int, int]) -> Callable[[Frame], Frame]:
    """A function that makes frames (H, W, 3) of this size look as a pinhole camera with the same matrix would see them."""
    if not calibration.distorted:
        return lambda frame: frame
    make: Any = cv2.fisheye.initUndistortRectifyMap if calibration.fisheye else cv2.initUndistortRectifyMap
    across, down = make(calibration.matrix, calibration.distortion, np.eye(3), calibration.matrix, size_px, cv2.CV_32FC1)
    return lambda frame: np.asarray(cv2.remap(frame, across, down, cv2.INTER_LINEAR), np.uint8)
