"""Corners that are spread over a frame and followed into the next one."""

from __future__ import annotations

from typing import Any, Final, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from hippodrome.core.types import FloatArray

Grey: TypeAlias = NDArray[Any]  # (H, W) uint8
Bools: TypeAlias = NDArray[np.bool_]

CORNERS: Final = 300  # most corners of a frame
QUALITY: Final = 0.002  # of a corner relative to the best one: a dark half of the road under trees has corners, too
WINDOW_PX, LEVELS, ROUNDS = 13, 3, 20  # of the Lucas-Kanade tracker: it follows corners that move up to some 50 pixels
ROUND_TRIP_PX: Final = 0.5  # a corner that is tracked there and back ends this close to where it began, or it was lost
EDGE_PX: Final = 2.0  # a corner that leaves the picture but for so much is lost: half of what it is known by lies outside


def spacing_px(shape: tuple[int, ...]) -> int:
    """Pixels between two corners, so that about twice as many corners as are wanted would fill the frame."""
    return max(3, round(float(np.sqrt(0.35 * shape[0] * shape[1] / CORNERS))))


def new_corners(image: Grey, known_px: FloatArray, static: Grey) -> FloatArray:
    """Corners (N, 2) of the frame, column and row, with those known already (K, 2) at the front.

    None lies closer to another one, or to a known one, than ``spacing_px``, nor where ``static`` is 255.
    """
    apart_px = spacing_px(image.shape)
    free = cv2.bitwise_not(static)
    for column, row in np.rint(known_px).astype(int):
        cv2.circle(free, (int(column), int(row)), apart_px, 0, -1)
    wanted = CORNERS - len(known_px)
    if wanted <= 0:
        return known_px
    found = cv2.goodFeaturesToTrack(image, wanted, QUALITY, apart_px, mask=free)
    return known_px if found is None else np.vstack([known_px, found.reshape(-1, 2).astype(np.float64)])


def follow(before: Grey, after: Grey, corners_px: FloatArray, guess_px: FloatArray) -> tuple[FloatArray, Bools]:
    """Where corners (N, 2) of one frame are in another (N, 2), and which were really found there (N,).

    A corner that is not found again where it began, when it is tracked back, was lost.
    """
    if not len(corners_px):
        return corners_px, np.zeros(0, dtype=bool)
    size = np.array(after.shape[::-1]) - 1.0
    options: dict[str, Any] = {
        "winSize": (WINDOW_PX, WINDOW_PX),
        "maxLevel": LEVELS,
        "criteria": (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, ROUNDS, 0.02),
        "flags": cv2.OPTFLOW_USE_INITIAL_FLOW,
    }
    begin = np.ascontiguousarray(corners_px, np.float32).reshape(-1, 1, 2)
    tracked, found, _ = cv2.calcOpticalFlowPyrLK(
        before, after, begin, np.ascontiguousarray(guess_px, np.float32).reshape(-1, 1, 2), **options
    )
    back, found_back, _ = cv2.calcOpticalFlowPyrLK(after, before, tracked, begin.copy(), **options)
    away_px = np.hypot(*(back - begin).reshape(-1, 2).T)
    ends_px = tracked.reshape(-1, 2).astype(np.float64)
    inside = ((ends_px > EDGE_PX) & (ends_px < size - EDGE_PX)).all(axis=1)
    return ends_px, (found.ravel() > 0) & (found_back.ravel() > 0) & (away_px < ROUND_TRIP_PX) & inside
