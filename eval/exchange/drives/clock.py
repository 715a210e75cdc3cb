"""The clocks of foreign drives: units of time, and ranges that do not meet."""

from __future__ import annotations

from typing import Final, Literal, TypeAlias

import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.eval.exchange.drives.errors import ExchangeError

TimeUnit: TypeAlias = Literal["s", "ms", "us", "ns"]
UNIT_S: Final[dict[TimeUnit, float]] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
UNIT_NAMES: Final[dict[TimeUnit, str]] = {"s": "seconds", "ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}
# Stamps since 1970 tell their unit by their size: in seconds they lie between these from 2001 to 2100.
EPOCH_S: Final = (1e9, 4.2e9)
LONGEST_INTERVAL_S: Final = 2.0  # self-motion or frames that are sparser than this do not describe a drive: the unit is smaller


def unit_of(stamps: FloatArray) -> TimeUnit:
    """The unit of time stamps (N,) in order: by their size if they count from 1970, else by their median interval.

    Seconds are believed where the median interval is at most ``LONGEST_INTERVAL_S``; then the next smaller unit is tried.
    """
    middle = float(np.median(stamps))
    for unit, length_s in UNIT_S.items():
        if EPOCH_S[0] <= middle * length_s <= EPOCH_S[1] and (unit != "s" or _interval(stamps) <= LONGEST_INTERVAL_S):
            return unit
    interval = _interval(stamps)
    return next((unit for unit, length_s in UNIT_S.items() if interval * length_s <= LONGEST_INTERVAL_S), "ns")


def in_seconds(stamps: FloatArray, unit: TimeUnit | None, name: str) -> FloatArray:
    """Time stamps (N,) in seconds; ``unit`` None recognises theirs, and what is recognised and no second is printed.

    Args:
        stamps: Times in the file's own unit.
        unit: The unit that the user or the file's header names.
        name: How the printed line names the file.
    """
    found = unit or unit_of(stamps)
    if unit is None and found != "s":
        print(f"{name}: time stamps taken for {UNIT_NAMES[found]} (--time-unit says otherwise)")
    return stamps / (1.0 / UNIT_S[found])  # divided by a whole number, as everybody does, rounds as everybody does


def disjoint(source: str, frames_s: tuple[float, float], motion_s: tuple[float, float]) -> ExchangeError:
    """The error of frames and self-motion whose times (first, last) do not meet; it says what would lay them together."""
    offset_s = frames_s[0] - motion_s[0]
    return ExchangeError(
        f"{source}: no frame within the self-motion's time: frames from {frames_s[0]:.3f} to {frames_s[1]:.3f} s, self-motion "
        f"from {motion_s[0]:.3f} to {motion_s[1]:.3f} s; if both began together, --time-offset {offset_s:.3f} lays their "
        "beginnings together; else give both the same clock, or name the unit with --time-unit"
    )


def _interval(stamps: FloatArray) -> float:
    """Median interval of stamps (N,), in their own unit; 0 of fewer than two."""
    return float(np.median(np.abs(np.diff(stamps)))) if len(stamps) > 1 else 0.0
