"""What is known of a camera on a vehicle, at the size of its frames at which motion is estimated."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import cv2
import numpy as np

from hippodrome.core.types import FloatArray, Frame
from hippodrome.core.views.egomotion.tracks import Grey

WIDEST_PX: Final = 640  # wider frames are made smaller: corners are found to a tenth of a pixel anyway


@dataclass(frozen=True, slots=True, eq=False)
class RoadCamera:
    """A pinhole camera that looks ahead from a vehicle."""

    matrix: FloatArray  # (3, 3) pinhole matrix in pixels of the frames, pixel centres at whole numbers
    height_m: float  # above the road; it gives the distances their unit
    forward_m: float = 1.6  # ahead of the rear axle
    heading: FloatArray = field(default_factory=lambda: np.zeros(2))  # (2,) tangents, right and down, of where it is driven to
    heading_sigma: float = 0.1  # standard deviation of each at first: 6 degrees, a camera that was put up by hand
    heading_pairs: float = 0.0  # pairs of frames that it is known from


def working_scale(width_px: int) -> float:
    """By how much frames of this width are made smaller before motion is estimated from them."""
    return min(1.0, WIDEST_PX / width_px)


def working_image(frame: Frame) -> Grey:
    """The frame in grey, at the size at which motion is estimated."""
    scale = working_scale(frame.shape[1])
    if scale < 1.0:
        size = round(frame.shape[1] * scale), round(frame.shape[0] * scale)
        frame = np.asarray(cv2.resize(frame, size, interpolation=cv2.INTER_AREA), np.uint8)
    return frame if frame.ndim == 2 else cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY)


def working_matrix(matrix: FloatArray, width_px: int) -> FloatArray:
    """The pinhole matrix (3, 3) of frames made smaller; the middle of the first pixel is 0, 0 before and after."""
    scale = working_scale(width_px)
    shift = 0.5 * (scale - 1.0)
    return np.array([[scale, 0.0, shift], [0.0, scale, shift], [0.0, 0.0, 1.0]]) @ matrix
