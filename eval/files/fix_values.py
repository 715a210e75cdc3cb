"""One fix of satellite navigation, and how the values of its fields are read; ``fixes.py`` reads the files."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import numpy as np

from hippodrome._files import read_bounded, why_unreadable
from hippodrome.eval.metrics.association import TrajectoryError

MAX_FIX_BYTES: Final = 128 << 20  # a day of GPX at 10 Hz
RANGE_ERROR_M: Final = 4.0  # sigma of a position at a dilution (HDOP) of 1, single-frequency receiver under open sky


@dataclass(frozen=True, slots=True)
class Fix:
    """A place at a time; ``sigma_m`` is the standard deviation along one axis, nan where nobody says it."""

    t_s: float
    lat_deg: float
    lon_deg: float
    sigma_m: float = np.nan


def file_bytes(path: Path) -> bytes:
    """The bytes of a file of bounded size. Raises TrajectoryError."""
    try:
        if (size := path.stat().st_size) > MAX_FIX_BYTES:
            raise TrajectoryError(f"{path}: {size} bytes, the limit is {MAX_FIX_BYTES}; cut the track to the drive")
        return read_bounded(path, MAX_FIX_BYTES)
    except OSError as error:
        raise TrajectoryError(f"{path}: cannot be read: {why_unreadable(error)}") from None


def file_text(path: Path, data: bytes) -> str:
    """The text that the bytes of a file are in UTF-8. Raises TrajectoryError with the byte that is none."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise TrajectoryError(f"{path}: byte {error.start}: not UTF-8 text; save the file as UTF-8") from None


def time_s(text: str, where: str) -> float:
    """Seconds, of a number, or a date and time (UTC unless it says); milli-, micro- and nanoseconds since 1970 by their size."""
    text = text.strip()
    try:
        value = float(text)
    except ValueError:
        try:
            found = datetime.fromisoformat(text[:26] if len(text) > 26 and text[26:].isdecimal() else text)
        except (ValueError, OverflowError):
            raise TrajectoryError(
                f"{where}: '{text[:40]}' is neither seconds nor a date and time (2026-05-01T12:00:00Z)"
            ) from None
        return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()
    for above, unit_s in ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3)):
        if abs(value) > above:
            return value * unit_s
    return value


def as_number(text: Any, where: str) -> float:
    """The number that a field holds. Raises TrajectoryError, which begins with ``where``."""
    try:
        return float(text)
    except (ValueError, TypeError, OverflowError):
        cure = "; numbers have a point, as 1.5" if "," in str(text) else ""
        raise TrajectoryError(f"{where}: '{str(text)[:40]}' is not a number{cure}") from None


def hdop_note() -> str:
    """How the accuracy was told where the file has dilutions of precision only."""
    return f"accuracy: {RANGE_ERROR_M:g} m times the dilution of precision (hdop)"
