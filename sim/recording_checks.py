"""What is checked of a recording's arrays and images before they are believed, or take memory."""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Mapping
from typing import Any, Final

import cv2
import numpy as np

from hippodrome._native import unheard
from hippodrome.core.types import Frame

MAX_FRAME_BYTES: Final = 64 << 20  # of one image in its file; 12 megapixels of noise take 36 MB
MAX_PIXELS: Final = 64_000_000  # of one image: some bytes can claim any size
PNG_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
PNG_CHUNK: Final = struct.Struct(">I4s")  # length and kind, before what it holds and its checksum
PNG_CRC_BYTES: Final = 4
PNG_HEAD: Final = struct.Struct(">8s4x4sII")  # signature, length and name of the first chunk, width, height
# Largest absolute values of what a drive is made of. Speeds are in map units, whose length is unknown: from millimetres up.
MOST: Final = {
    "t_s": 1e11, "dt_s": 3600.0, "speed": 1e6, "yaw_rate_radps": 1e4, "poses_m": 1e9, "speed_mps": 1e4, "lane_position_m": 1e7,
}  # fmt: skip
LEAST_SPEED: Final = 1e-9  # the fastest of a drive that moves; in kilometres a second, a walk is a thousand times as fast
TIMES_AGREE_S: Final = 0.5  # and half of a step: what a step lasts and when it ends are told twice, and only one may be believed
CHECKSUM: Final = "manifest_sha256"  # of all else in a manifest; recordings of before it was written have none
TRUTH: Final = ("poses_m", "speed_mps", "lane_position_m")  # nan where it is unknown


def check_samples(arrays: Mapping[str, np.ndarray[Any, Any]], most_steps: int) -> None:
    """Raise ValueError, with the array and the row, unless the arrays of a sample file make a drive."""
    if arrays["t_s"].ndim != 1:
        raise ValueError("t_s is no list of times")
    count = len(arrays["t_s"])
    if not 0 < count <= most_steps:
        raise ValueError(f"{count} steps, it may be 1 to {most_steps}")
    for name, array in arrays.items():
        if name == "lane_ids":
            if array.ndim != 1 or (array.dtype.kind not in "US" and array.size):
                raise ValueError("lane_ids is no list of names")
            continue
        shape = (count, 3) if name == "poses_m" else (count,)
        if array.shape != shape or array.dtype.kind not in ("f" if name in MOST else "iu"):
            raise ValueError(f"{name} is {array.dtype} {array.shape}, a recording of {count} steps has {shape}")
    for name, most in MOST.items():
        unknown = np.isnan(arrays[name]) if name in TRUTH else False
        _require((np.abs(arrays[name].astype(np.float64)) <= most) | unknown, name, f"not finite, or beyond {most:g}")
    fastest = float(np.max(np.abs(arrays["speed"].astype(np.float64))))
    if 0.0 < fastest < LEAST_SPEED:
        raise ValueError(f"speed is {fastest:g} at most, which no sensor tells from zero")
    _require(arrays["dt_s"] > 0.0, "dt_s", "not above zero")
    _require(np.diff(arrays["t_s"]) > 0.0, "t_s", "followed by an earlier or the same one")
    between_s, lasts_s = np.diff(arrays["t_s"].astype(np.float64)), arrays["dt_s"][1:].astype(np.float64)
    _require(np.abs(between_s - lasts_s) <= TIMES_AGREE_S + 0.5 * lasts_s, "dt_s", "not the time since the step before", 1)
    lanes = len(arrays["lane_ids"])
    _require((arrays["lane"] >= -1) & (arrays["lane"] < max(lanes, 1)), "lane", f"none of {lanes} lanes")
    numbers = arrays["frame"]
    if not np.array_equal(numbers[numbers >= 0], np.arange(np.count_nonzero(numbers >= 0))):
        raise ValueError("frame does not count the frames from 0 up")


def check_truth(arrays: Mapping[str, np.ndarray[Any, Any]]) -> None:
    """Raise ValueError, with the array and the row, unless the arrays of a truth with times of its own make one."""
    shapes = {"t_s": (arrays["t_s"].size,), "has_heading": (1,), "poses_m": (arrays["t_s"].size, 3)}
    for name, array in arrays.items():
        shape = shapes.get(name, shapes["t_s"])
        if array.shape != shape or array.dtype.kind != ("b" if name == "has_heading" else "f"):
            raise ValueError(f"{name} is {array.dtype} {array.shape}, a truth of {arrays['t_s'].size} poses has {shape}")
    for name, most in (("t_s", MOST["t_s"]), ("poses_m", MOST["poses_m"]), ("height_m", MOST["poses_m"])):
        _require(np.abs(arrays[name].astype(np.float64)) <= most, name, f"not finite, or beyond {most:g}")
    _require(~(arrays["sigma_m"] < 0.0), "sigma_m", "below zero")  # nan where it is unknown
    _require(np.diff(arrays["t_s"]) > 0.0, "t_s", "followed by an earlier or the same one")


def with_checksum(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """The manifest with a checksum of its own, over all else in it, however it is laid out as text."""
    return {**manifest, CHECKSUM: _checksum(manifest)}


def require_checksum(manifest: Mapping[str, Any]) -> None:
    """Raise ValueError if a manifest has a checksum of its own that does not hold."""
    if CHECKSUM in manifest and manifest[CHECKSUM] != _checksum({key: manifest[key] for key in manifest if key != CHECKSUM}):
        raise ValueError(f"{CHECKSUM} does not hold: changed since it was written")


def _checksum(manifest: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(manifest, sort_keys=True).encode()).hexdigest()


def decoded_png(blob: bytes) -> Frame:
    """The RGB image (H, W, 3) of a PNG file. Raises ValueError if it is none, or claims to be larger than any camera's."""
    if len(blob) > MAX_FRAME_BYTES:
        raise ValueError(f"{len(blob)} bytes, the limit is {MAX_FRAME_BYTES}")
    if len(blob) < PNG_HEAD.size:
        raise ValueError("not a PNG image")
    signature, chunk, width, height = PNG_HEAD.unpack_from(blob)
    if signature != PNG_SIGNATURE or chunk != b"IHDR":
        raise ValueError("not a PNG image")
    if not 0 < width * height <= MAX_PIXELS:
        raise ValueError(f"{width} x {height} pixels, the limit is {MAX_PIXELS} in all")
    require_png_chunks(blob)
    try:
        with unheard():
            image = cv2.imdecode(np.frombuffer(blob, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error as error:
        raise ValueError(f"not a PNG image ({' '.join(str(error).split())[:100]})") from None
    if image is None:
        raise ValueError("not a whole PNG image")
    return np.ascontiguousarray(image[:, :, ::-1], dtype=np.uint8)


def require_png_chunks(blob: bytes) -> None:
    """Raise ValueError if a chunk of a PNG file is longer than the file: OpenCV takes the memory that it claims, up to 2 GiB."""
    at = len(PNG_SIGNATURE)
    while at + PNG_CHUNK.size <= len(blob):
        length, kind = PNG_CHUNK.unpack_from(blob, at)
        at += PNG_CHUNK.size + length + PNG_CRC_BYTES
        if at > len(blob):
            raise ValueError(f"not a whole PNG image: its part {ascii(kind)[2:-1]} claims {length} bytes")
        if kind == b"IEND":
            return


def _require(holds: np.ndarray[Any, Any], name: str, complaint: str, first: int = 0) -> None:
    """Raise ValueError unless all hold; ``first`` is the row of the first of them."""
    if not holds.all():
        row = int(np.argwhere(~holds)[0][0]) + first
        raise ValueError(f"{name}[{row}] is {complaint}")
