"""What logs of messages have in common, MCAP files and ROS bags: the topics of the truth, and images of bare pixels."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from hippodrome.eval.exchange.drives.errors import ExchangeError

CHANNELS: Final = {"rgb8": 3, "bgr8": 3, "mono8": 1}  # channels of the encodings that are known
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
    image = rows[:, : channels * width].reshape(height, width, channels)
    return cv2.imencode(".png", image[:, :, ::-1] if encoding == "rgb8" else image)[1].tobytes()
