"""What logs of messages have in common, MCAP files and ROS bags: the topics of the truth, and images of bare pixels."""

from __future__ import annotations

from pathlib import Path
from typing import Final, TypeVar

import cv2
import numpy as np

from hippodrome.eval.exchange.drives.errors import ExchangeError

MessageT = TypeVar("MessageT")
CHANNELS: Final = {"rgb8": 3, "bgr8": 3, "mono8": 1, "rgba8": 4, "bgra8": 4}  # channels of the encodings that are known
TRUTH_TOPICS: Final = (
    "/ground_truth",
    "/groundtruth",
    "/gt_pose",
)  # customary names of the true poses; our exports use the first


def png_of(data: bytes, encoding: str, width: int, height: int, step: int, name: str) -> bytes:
    """An image that a message carries as bare pixels, encoded as PNG, so that all images can be read in one way.

    Args:
        data: The pixels, ``height`` rows of ``step`` bytes each; a row may be longer than its pixels need.
        encoding: A key of ``CHANNELS``.
        width: Pixels of a row.
        height: Rows.
        step: Bytes of a row.
        name: How errors name the image.

    Raises:
        ExchangeError: The encoding is not known, or the bytes do not hold so many pixels.
    """
    channels = CHANNELS.get(encoding)
    if channels is None:
        raise ExchangeError(f"{name}: encoding '{encoding}', known are {', '.join(CHANNELS)}")
    if width < 1 or height < 1 or step < channels * width or len(data) < step * height:
        raise ExchangeError(f"{name}: {len(data)} bytes do not hold {width} x {height} pixels of {encoding}")
    rows = np.frombuffer(data, np.uint8, step * height).reshape(height, step)
    image = rows[:, : channels * width].reshape(height, width, channels)[:, :, :3]  # alpha is dropped
    return cv2.imencode(".png", image[:, :, ::-1] if encoding.startswith("rgb") else image)[1].tobytes()


def without_repeats(messages: list[tuple[int, MessageT]], name: str) -> list[tuple[int, MessageT]]:
    """Stamped messages without those whose stamp repeats the one before; prints how many of the topic ``name`` are left out."""
    kept = [one for number, one in enumerate(messages) if number == 0 or one[0] != messages[number - 1][0]]
    if len(kept) < len(messages):
        print(f"{name}: {len(messages) - len(kept)} message(s) that repeat the time of the one before are left out")
    return kept


def told(path: Path, images: str, others: list[str], odometry: str | None, truth: str | None) -> None:
    """Print which topics are used, where the file has several of images."""
    if others:
        print(f"{path}: images of {images} (not of {', '.join(others)[:200]}), self-motion of {odometry}, truth of {truth}")
