"""Frames without any list of them: a folder of images, or a video file."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from hippodrome._native import unheard
from hippodrome.core.types import FloatArray
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import ForeignDrive, ForeignFrame
from hippodrome.eval.exchange.drives.images import MAX_PIXELS, file_frame

IMAGES: Final = (".jpg", ".jpeg", ".png")
VIDEOS: Final = (".mp4", ".mov", ".avi", ".mkv", ".m4v", ".webm", ".mpg", ".mpeg", ".ts", ".3gp", ".mts", ".insv", ".360")
UNSURE_FRAMES: Final = 3  # where a header has no count of frames, it is worked out from the length
MAX_VIDEO_FRAMES: Final = 2_000_000  # 18 hours at 30 Hz


def image_files(folder: Path) -> list[Path]:
    """The JPEG and PNG files of a folder in natural order: 2.jpg comes before 10.jpg. Raises ExchangeError."""
    try:
        found = [path for path in folder.iterdir() if path.suffix.lower() in IMAGES and not path.name.startswith(".")]
    except OSError as error:
        raise ExchangeError(f"{folder}: cannot be read: {error.strerror}") from None
    return sorted(found, key=_natural)


def read_image_folder(folder: Path, fps: float | None) -> ForeignDrive:
    """Read a folder of JPEG or PNG images, one each 1 / ``fps`` seconds from time 0 on. Raises ExchangeError."""
    files = image_files(folder)
    if not files:
        raise ExchangeError(f"{folder}: no .jpg or .png file in it; give the folder that the images lie in")
    if fps is None:
        raise ExchangeError(f"{folder}: {len(files)} images and no times; say how many were taken a second with --fps N")
    return ForeignDrive([file_frame(number / fps, path) for number, path in enumerate(files)], None, None, None)


def read_video(path: Path, fps: float | None) -> ForeignDrive:
    """Read a video file with OpenCV: times by its own stamps, or by ``fps``. Frames are decoded one at a time, when needed.

    Raises ExchangeError if it cannot be read. Prints where the times come from.
    """
    video = _Video(path)
    t_s = video.times_s()
    if len(t_s) + UNSURE_FRAMES < (declared := video.declared_frames()):
        print(
            f"note: {path}: {len(t_s)} of the {declared} frames that its header names can be decoded: it was cut short or damaged"
        )
    if fps is not None:
        t_s = np.arange(len(t_s)) / fps
    elif (np.diff(t_s) <= 0.0).any():
        rate = video.rate_hz()
        if not 0.1 <= rate <= 1000.0:
            raise ExchangeError(f"{path}: neither time stamps nor a frame rate in it; say how many frames a second with --fps N")
        print(f"{path}: no increasing time stamps in it; {rate:g} frames a second taken, as its header says")
        t_s = np.arange(len(t_s)) / rate
    frames = [ForeignFrame(float(t), f"{path}: frame {number}", partial(video.load, number)) for number, t in enumerate(t_s)]
    return ForeignDrive(frames, None, None, None)


class _Video:
    """A video whose frames are read in order; going back begins anew. No frame stays in memory."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._next = 0  # number of the frame that comes next
        self._capture = self._open()

    def _open(self) -> cv2.VideoCapture:
        if not self._path.is_file():
            raise ExchangeError(f"{self._path}: no such file")
        with unheard():
            capture = cv2.VideoCapture(str(self._path), cv2.CAP_FFMPEG)
        if not capture.isOpened():
            raise ExchangeError(
                f"{self._path}: not a video that OpenCV can read; convert it: ffmpeg -i {self._path.name} drive.mp4"
            )
        width, height = capture.get(cv2.CAP_PROP_FRAME_WIDTH), capture.get(cv2.CAP_PROP_FRAME_HEIGHT)
        if width * height > MAX_PIXELS or min(width, height) < 16:
            raise ExchangeError(f"{self._path}: {width:g} x {height:g} pixels; at least 16 a side, at most {MAX_PIXELS} in all")
        return capture

    def declared_frames(self) -> int:
        """How many frames the file's header names, or its length is worth; 0 where it does not say."""
        count = float(self._capture.get(cv2.CAP_PROP_FRAME_COUNT))
        return int(count) if 0.0 < count <= MAX_VIDEO_FRAMES else 0

    def rate_hz(self) -> float:
        """Frames a second by the file's header; 0 where it does not say."""
        return float(self._capture.get(cv2.CAP_PROP_FPS))

    def times_s(self) -> FloatArray:
        """Time stamps (N,) of all frames, from 0 on. Raises ExchangeError if there is no frame, or too many."""
        capture, found = self._open(), []
        with unheard():
            while capture.grab():
                found.append(capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3)
                if len(found) > MAX_VIDEO_FRAMES:
                    raise ExchangeError(f"{self._path}: more than {MAX_VIDEO_FRAMES} frames; cut it into drives")
        if not found:
            raise ExchangeError(f"{self._path}: no frame in it can be decoded")
        return np.array(found) - found[0]

    def load(self, number: int) -> bytes:
        """Frame ``number`` as an uncompressed image file. Raises ExchangeError."""
        if number < self._next:
            self._capture, self._next = self._open(), 0
        with unheard():
            while self._next < number and self._capture.grab():
                self._next += 1
            read, image = self._capture.read()
        self._next += 1
        if not read:
            raise ExchangeError(
                f"{self._path}: frame {number} cannot be decoded; repair it: ffmpeg -i {self._path.name} drive.mp4"
            )
        return cv2.imencode(".bmp", image)[1].tobytes()


def _natural(path: Path) -> list[Any]:
    """A key by which numbers in names sort by their value."""
    words = re.split(r"(\d+)", path.name)
    return [(int(word), "") if word.isdecimal() else (-1, word) for word in words]
