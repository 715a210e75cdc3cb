"""The images of a foreign drive: where they lie, and how they become frames. None is trusted to be what it says it is."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from PIL import Image, UnidentifiedImageError

from hippodrome._files import read_bounded, why_unreadable
from hippodrome._native import unheard
from hippodrome.core.types import Frame
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import ForeignFrame
from hippodrome.sim.recording_checks import PNG_SIGNATURE, require_png_chunks

MAX_IMAGE_BYTES: Final = 64 << 20
MAX_PIXELS: Final = 64_000_000  # a hostile image can claim any size in a few bytes
ORIENTATION: Final = 0x0112  # Exif: how the camera was held
QUARTER_TURNS: Final = (5, 6, 7, 8)  # its values that exchange width and height


def decode(frame: ForeignFrame) -> Frame:
    """The frame as RGB (H, W, 3), 8 bits: grey is repeated, alpha dropped, 16 bits are scaled. Raises ExchangeError."""
    blob = frame.load()
    if len(blob) > MAX_IMAGE_BYTES:
        raise ExchangeError(f"{frame.name}: {len(blob)} bytes, the limit is {MAX_IMAGE_BYTES}")
    try:
        with Image.open(io.BytesIO(blob)) as header:  # reads no pixel
            width, height = header.size
            turned = header.getexif().get(ORIENTATION, 1) in QUARTER_TURNS
    except UnidentifiedImageError:
        raise ExchangeError(f"{frame.name}: not an image of a known kind ({len(blob)} bytes)") from None
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise ExchangeError(f"{frame.name}: not an image ({' '.join(str(error).split())[:80]})") from None
    if width * height > MAX_PIXELS or min(width, height) < 16:
        raise ExchangeError(f"{frame.name}: {width} x {height} pixels; at least 16 a side, at most {MAX_PIXELS} in all")
    try:
        if blob.startswith(PNG_SIGNATURE):
            require_png_chunks(blob)
    except ValueError as error:
        raise ExchangeError(f"{frame.name}: {error}") from None
    with unheard():
        image: Any = cv2.imdecode(np.frombuffer(blob, np.uint8), cv2.IMREAD_COLOR)  # turns it as the camera was held
    if image is None or image.shape[:2] not in ((height, width), (width, height) if turned else (height, width)):
        raise ExchangeError(f"{frame.name}: a damaged image")
    return np.ascontiguousarray(image[:, :, ::-1])


def file_frame(t_s: float, path: Path) -> ForeignFrame:
    """A frame in an image file of its own. Nothing is read before it is loaded."""

    def load() -> bytes:
        try:
            if (size := path.stat().st_size) > MAX_IMAGE_BYTES:
                raise ExchangeError(f"{path}: {size} bytes, the limit is {MAX_IMAGE_BYTES}")
            return read_bounded(path, MAX_IMAGE_BYTES)
        except OSError as error:
            raise ExchangeError(f"{path}: cannot be read: {why_unreadable(error)}") from None

    return ForeignFrame(t_s, str(path), load)
