"""Images that messages carry as bare pixels, as PNG: what comes after needs no second way."""

from __future__ import annotations

import cv2
import numpy as np

from hippodrome.eval.exchange.drives.exported import ExchangeError

CHANNELS = {"rgb8": 3, "bgr8": 3, "mono8": 1}


def png_of(data: bytes, encoding: str, width: int, height: int, step: int, name: str) -> bytes:
    """PNG of ``height`` rows of ``step`` bytes each. Raises ExchangeError if the bytes do not hold them."""
    channels = CHANNELS.get(encoding)
    if channels is None:
        raise ExchangeError(f"{name}: encoding '{encoding}', known are {', '.join(CHANNELS)}")
    if width < 1 or height < 1 or step < channels * width or len(data) < step * height:
        raise ExchangeError(f"{name}: {len(data)} bytes do not hold {width} x {height} pixels of {encoding}")
    rows = np.frombuffer(data, np.uint8, step * height).reshape(height, step)
    image = rows[:, : channels * width].reshape(height, width, channels)
    return cv2.imencode(".png", image[:, :, ::-1] if encoding == "rgb8" else image)[1].tobytes()
