"""Arrays as bytes fields: little-endian, C order, byte-transposed (see cognitive_map.proto). Exact, bit for bit."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hippodrome.core.types import HippodromeError

Array: TypeAlias = NDArray[Any]


class FieldError(HippodromeError):
    """An array that does not have the type or shape that its field requires."""


def pack(array: Array, dtype: str, shape: tuple[int, ...], name: str) -> bytes:
    """The bytes of an array that must have this type and shape: a conversion would make the loaded map differ."""
    if array.dtype != np.dtype(dtype) or array.shape != shape:
        expected = f"{np.dtype(dtype)} {shape}"
        raise FieldError(f"{name} is {array.dtype} {array.shape}, a map holds {expected}")
    little = np.ascontiguousarray(array, dtype=np.dtype(dtype).newbyteorder("<"))
    return _transposed(little.view(np.uint8).reshape(-1, little.itemsize)).tobytes() if array.size else b""


def unpack(data: bytes, dtype: str, shape: tuple[int, ...], name: str) -> Array:
    """A new array from ``data``; its length is checked against the shape before anything is allocated."""
    item = np.dtype(dtype).itemsize
    count = 1
    for size in shape:
        count *= size
    if len(data) != count * item:
        raise FieldError(f"{name} has {len(data)} bytes, {np.dtype(dtype)} {shape} needs {count * item}")
    planes = np.frombuffer(data, dtype=np.uint8).reshape(item, count)
    little = _transposed(planes).reshape(-1).view(np.dtype(dtype).newbyteorder("<"))
    return little.astype(np.dtype(dtype), copy=False).reshape(shape)


def _transposed(planes: Array) -> Array:
    return np.ascontiguousarray(planes.T)
