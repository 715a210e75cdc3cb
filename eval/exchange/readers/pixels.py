"""Images that a message carries as bare pixels, in ROS's and Foxglove's encodings."""

from __future__ import annotations

from typing import Any, Final

import cv2
import numpy as np

from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.images import MAX_PIXELS

# Encoding -> channels, bytes of each, and OpenCV's way to BGR (None: as it is). ROS names a Bayer pattern by its first row's
# first two pixels, OpenCV by the second row's second and third.
ENCODINGS: Final[dict[str, tuple[int, int, int | None]]] = {
    "rgb8": (3, 1, cv2.COLOR_RGB2BGR), "bgr8": (3, 1, None), "mono8": (1, 1, None),
    "rgba8": (4, 1, cv2.COLOR_RGBA2BGR), "bgra8": (4, 1, cv2.COLOR_BGRA2BGR),
    "rgb16": (3, 2, cv2.COLOR_RGB2BGR), "bgr16": (3, 2, None), "mono16": (1, 2, None),
    "rgba16": (4, 2, cv2.COLOR_RGBA2BGR), "bgra16": (4, 2, cv2.COLOR_BGRA2BGR),
    "8UC1": (1, 1, None), "8UC3": (3, 1, None), "8UC4": (4, 1, cv2.COLOR_BGRA2BGR), "16UC1": (1, 2, None),
    "bayer_rggb8": (1, 1, cv2.COLOR_BayerBG2BGR), "bayer_bggr8": (1, 1, cv2.COLOR_BayerRG2BGR),
    "bayer_gbrg8": (1, 1, cv2.COLOR_BayerGR2BGR), "bayer_grbg8": (1, 1, cv2.COLOR_BayerGB2BGR),
    "bayer_rggb16": (1, 2, cv2.COLOR_BayerBG2BGR), "bayer_bggr16": (1, 2, cv2.COLOR_BayerRG2BGR),
    "bayer_gbrg16": (1, 2, cv2.COLOR_BayerGR2BGR), "bayer_grbg16": (1, 2, cv2.COLOR_BayerGB2BGR),
    "uyvy": (2, 1, cv2.COLOR_YUV2BGR_UYVY), "yuv422": (2, 1, cv2.COLOR_YUV2BGR_UYVY),
    "yuyv": (2, 1, cv2.COLOR_YUV2BGR_YUY2), "yuv422_yuy2": (2, 1, cv2.COLOR_YUV2BGR_YUY2),
}  # fmt: skip
CHANNELS: Final = {name: channels for name, (channels, _, _) in ENCODINGS.items()}


def png_of(data: bytes, encoding: str, width: int, height: int, step: int, name: str, big_endian: bool = False) -> bytes:
    """An image that a message carries as bare pixels, encoded as PNG, so that all images can be read in one way.

    Args:
        data: The pixels, ``height`` rows of ``step`` bytes each; a row may be longer than its pixels need.
        encoding: A key of ``ENCODINGS``. Alpha is dropped, 16 bits keep their upper 8, Bayer patterns are interpolated.
        width: Pixels of a row.
        height: Rows.
        step: Bytes of a row.
        name: How errors name the image.
        big_endian: Whether the first byte of 16 bits is the upper one.

    Raises:
        ExchangeError: The encoding is not known, or the bytes do not hold so many pixels.
    """
    if encoding not in ENCODINGS:
        raise ExchangeError(f"{name}: encoding '{encoding[:40]}', known are {', '.join(ENCODINGS)}")
    channels, size, to_bgr = ENCODINGS[encoding]
    row = channels * size * width
    if width < 1 or height < 1 or step < row or len(data) < step * height:
        raise ExchangeError(f"{name}: {len(data)} bytes do not hold {width} x {height} pixels of {encoding}")
    if width * height > MAX_PIXELS or min(width, height) < 2:
        raise ExchangeError(f"{name}: {width} x {height} pixels; at least 2 a side, at most {MAX_PIXELS} in all")
    if encoding.startswith(("uyvy", "yu")) and width % 2:
        raise ExchangeError(f"{name}: {width} pixels in a row of {encoding}, which has pairs of them")
    pixels = np.frombuffer(data, np.uint8, step * height).reshape(height, step)[:, :row]
    if size == 2:
        pixels = pixels.reshape(height, -1, 2)[:, :, 0 if big_endian else 1]
    image: Any = np.ascontiguousarray(pixels).reshape(height, width, channels)
    found = image if to_bgr is None else cv2.cvtColor(image, to_bgr)
    return cv2.imencode(".png", found)[1].tobytes()
