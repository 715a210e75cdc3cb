"""Self-motion in a table with or without a header: the documented three columns, or a logger's many."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.eval.exchange.drives.clock import TimeUnit, in_seconds
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import Motion, motion_table
from hippodrome.eval.exchange.readers.text import read_lines
from hippodrome.eval.files.number_words import first_that_is_none, no_number

# What a column may be called, best first; case, blanks, dots, slashes and hyphens do not count, nor does a unit behind the name.
TIMES: Final = ("t", "time", "timestamp", "seconds_elapsed", "elapsed", "stamp", "epoch", "time_stamp", "loggingtime", "unixtime")
SPEEDS: Final = (
    "speed",
    "v",
    "velocity",
    "vf",
    "vel",
    "forward_speed",
    "speed_gps",
    "gps_speed",
    "linear_x",
    "vx",
    "locationspeed",
)
YAW_RATES: Final = ("yaw_rate", "yawrate", "gyro_z", "gyroscope_z", "wz", "wu", "angular_z", "omega", "omega_z", "gyr_z",
                    "rotation_rate_z", "gyrorotationz", "motionrotationratez", "w", "yaw_velocity", "turn_rate")  # fmt: skip
FARTHEST_S: Final = 1e11  # since 1970, in the year 5138: stamps that are called seconds and are larger are milliseconds or less
TIME_UNITS: Final[dict[str, TimeUnit]] = {
    "s": "s", "sec": "s", "secs": "s", "seconds": "s", "ms": "ms", "msec": "ms", "millis": "ms", "milliseconds": "ms",
    "us": "us", "µs": "us", "usec": "us", "microseconds": "us", "ns": "ns", "nsec": "ns", "nanos": "ns", "nanoseconds": "ns",
}  # fmt: skip
SPEED_UNITS: Final = {"ms": 1.0, "mps": 1.0, "m_s": 1.0, "kmh": 1 / 3.6, "km_h": 1 / 3.6, "kph": 1 / 3.6, "mph": 0.44704,
                      "knots": 0.514444, "kn": 0.514444}  # fmt: skip
RADIANS: Final = {"rad": 1.0, "rads": 1.0, "radian": 1.0, "radians": 1.0, "1": 1.0}
DEGREES: Final = dict.fromkeys(("deg", "degs", "degree", "degrees", "°"), np.pi / 180)
YAW_UNITS: Final = {
    **{f"{angle}_{time}": size for angle, size in {**RADIANS, **DEGREES}.items() for time in ("s", "sec", "second")},
    "rad": 1.0, "radps": 1.0, "rads": 1.0, "deg": np.pi / 180, "degps": np.pi / 180, "degs": np.pi / 180, "dps": np.pi / 180,
}  # fmt: skip
OWN_UNIT: Final = "map_units_s"  # of our own exports
MAX_COLUMNS: Final = 1000  # of a hostile table


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a table, as its header names it."""

    index: int
    name: str
    unit: str  # what stands behind the name, in brackets or after an underscore; "" where nothing does


@dataclass(frozen=True, slots=True)
class MotionColumns:
    """The columns that self-motion is read from."""

    time: Column
    speed: Column
    yaw_rate: Column


PLAIN: Final = MotionColumns(Column(0, "t", ""), Column(1, "speed", ""), Column(2, "yaw_rate", ""))


def read_motion(path: Path, unit: TimeUnit | None = None) -> Motion:
    """Self-motion of a text table: time, forward speed and yaw rate, by the names of its columns or in this order.

    Columns are separated by commas, semicolons, tabulators or blanks. The header may be a comment. Units in it, in brackets or
    behind an underscore, are used. Prints which columns were taken if there are others, and which unit of time was recognised.

    Args:
        path: The file.
        unit: Unit of the time stamps; None takes the header's, or recognises it.

    Raises:
        ExchangeError: It cannot be read, a wanted column is not there, or a line has no number in it; the message says which.
    """
    lines = read_lines(path)
    separator = _separator(lines)
    first, columns = _columns(path, lines, separator)
    wanted = (columns.time, columns.speed, columns.yaw_rate)
    rows, exactly = [], columns is PLAIN
    empty = 0
    for number, line in enumerate(lines[first:], start=first + 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        words = [word.strip().strip('"') for word in line.split(separator)]
        if len(words) <= max(column.index for column in wanted) or (exactly and len(words) != 3):
            needed = 3 if exactly else max(column.index for column in wanted) + 1
            cure = "; numbers have a point, as 1.5" if separator == "," and ";" in line else ""
            raise ExchangeError(f"{path}: line {number}: {len(words)} columns, expected {needed}{cure}")
        values = [words[column.index] for column in wanted]
        if not exactly and not all(values):  # loggers leave a cell empty where a sensor had nothing new
            empty += 1
            continue
        try:
            rows.append([float(value) for value in values])
        except ValueError:
            cure = no_number(first_that_is_none(values))
            raise ExchangeError(f"{path}: line {number}: not a number in '{line.strip()[:60]}': {cure}") from None
    if not rows:
        raise ExchangeError(f"{path}: no data; expected lines of t_s,speed,yaw_rate")
    table = np.array(rows)
    if not np.isfinite(table).all():
        raise ExchangeError(f"{path}: data row {int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0]) + 1} is not finite")
    if empty:
        print(f"{path}: {empty} row(s) without a time, speed or yaw rate are left out")
    named = TIME_UNITS.get(columns.time.unit)
    if named == "s" and np.abs(table[:, 0]).min() > FARTHEST_S:
        named = None  # a header that was copied from somewhere: the size of the stamps tells better
    t_s = in_seconds(table[:, 0], unit or named, str(path))
    return motion_table(t_s, *in_units(path, columns, table), str(path))


def is_motion(path: Path) -> bool:
    """Whether a table is one of self-motion, whatever its name: its columns are named so, or are three. Raises ExchangeError."""
    lines = read_lines(path)
    separator = _separator(lines)
    head = next((line for line in lines if line.strip()), "").strip()
    data = next((line for line in lines if line.strip() and not line.lstrip().startswith("#")), "")
    return _wanted(_header(head.lstrip("#"), separator)) is not None or len(data.strip().split(separator)) == 3


def in_units(path: Path, columns: MotionColumns, table: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Speeds (N,) and yaw rates (N,) of the second and third column of ``table``, by the units that the header names.

    A speed may have any unit, as the refinement finds the metres; one that is not known is printed. Raises ExchangeError for an
    unknown unit of the yaw rate.
    """
    speed, yaw_rate = columns.speed.unit, columns.yaw_rate.unit
    if yaw_rate and yaw_rate not in YAW_UNITS:
        raise ExchangeError(
            f"{path}: column '{columns.yaw_rate.name}': its unit '{yaw_rate[:40]}' is not known; name rad/s or deg/s, or no unit "
            "for rad/s"
        )
    if speed and speed not in (*SPEED_UNITS, OWN_UNIT):
        print(f"{path}: column '{columns.speed.name}': its unit '{speed[:40]}' is not known; the numbers are taken as they are")
    return table[:, 1] * SPEED_UNITS.get(speed, 1.0), table[:, 2] * YAW_UNITS.get(yaw_rate, 1.0)


def columns_named(path: Path, lines: list[str], separator: str) -> MotionColumns | None:
    """The columns of self-motion that a comment in the first line names; None where it names none of them elsewhere than first,
    second and third. Raises ExchangeError where it names some of them elsewhere, and not all.
    """
    head = next((line for line in lines if line.strip()), "").strip()
    if not head.startswith("#"):
        return None
    header = _header(head.lstrip("#"), separator)
    if (found := _wanted(header)) is None:
        _require_in_order(path, 1, header)
    return found


def _require_in_order(path: Path, line: int, header: list[Column]) -> None:
    """Raise ExchangeError if a header names a column of self-motion where another one would be read without a header."""
    places = [next((column.index for column in header if column.name in names), place)
              for place, names in enumerate((TIMES, SPEEDS, YAW_RATES))]  # fmt: skip
    if len(header) >= len(places) and places != sorted({*places}):
        raise ExchangeError(
            f"{path}: line {line}: the header names its columns {', '.join(one.name for one in header)[:80]}; name all three of "
            "t_s, speed and yaw_rate, or leave the header out and give them in this order"
        )


def _separator(lines: list[str]) -> str | None:
    """What stands between the columns of the first line of data; None: white space."""
    first = next((line for line in lines if line.strip() and not line.lstrip().startswith("#")), "")
    return next((mark for mark in (",", ";", "\t") if mark in first), None)


def _columns(path: Path, lines: list[str], separator: str | None) -> tuple[int, MotionColumns]:
    """The number of lines to pass over, and the columns. Without a header they are time, speed, yaw rate."""
    for number, line in enumerate(lines):
        if not line.strip():
            continue
        comment = line.lstrip().startswith("#")
        header = _header(line.strip().lstrip("#"), separator or ("," if comment and "," in line else separator))
        found = _wanted(header)
        if found is not None:
            if not comment and len(header) > 3:
                print(
                    f"{path}: columns taken: " + ", ".join(f"'{one.name}'" for one in (found.time, found.speed, found.yaw_rate))
                )
            return number + 1, found
        if comment:
            if len(header) == 3:
                _require_in_order(path, number + 1, header)
            continue
        if _is_number(line.split(separator)[0].strip()):
            return number, PLAIN
        listed = ", ".join(column.name for column in header)[:200]
        raise ExchangeError(
            f"{path}: line {number + 1}: the header names no column of time, speed and yaw rate ({listed}); name them t_s, speed "
            f"and yaw_rate (also understood: {', '.join(TIMES[1:3])}; {', '.join(SPEEDS[1:3])}; {', '.join(YAW_RATES[2:5])})"
        )
    raise ExchangeError(f"{path}: no data; expected lines of t_s,speed,yaw_rate")


def _header(line: str, separator: str | None) -> list[Column]:
    """The columns that a header names."""
    return [_column(index, word) for index, word in enumerate(line.split(separator)[:MAX_COLUMNS])]


def _column(index: int, word: str) -> Column:
    """A column by its header, "speed [km/h]" or "speed_kmh": the name in lower case with underscores, and the unit."""
    name, bracket = word.strip().strip('"').strip(), ""
    if found := re.match(r"^(.*?)\s*[\[(]([^\[\]()]*)[\])]\s*$", name):
        name, bracket = found.group(1), found.group(2)
    plain = re.sub(r"[\s./\-]+", "_", name.strip().lower()).strip("_")
    unit = re.sub(r"[\s./^\-]+", "_", bracket.strip().lower()).strip("_").removesuffix("_1").rstrip("²")
    if not unit:
        for known in sorted({*TIME_UNITS, *SPEED_UNITS, *YAW_UNITS}, key=len, reverse=True):
            if plain.endswith(f"_{known}") and plain not in (*TIMES, *SPEEDS, *YAW_RATES):
                return Column(index, plain.removesuffix(f"_{known}"), known)
    return Column(index, plain, unit)


def _wanted(header: list[Column]) -> MotionColumns | None:
    """The columns of self-motion among those of a header; None if one of the three is not there."""
    found = [next((column for name in names for column in header if column.name == name), None)
             for names in (TIMES, SPEEDS, YAW_RATES)]  # fmt: skip
    time, speed, yaw_rate = found
    return MotionColumns(time, speed, yaw_rate) if time and speed and yaw_rate else None


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
