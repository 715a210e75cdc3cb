"""Fixes of satellite navigation, as people have them: GPX, CSV, NMEA 0183, GeoJSON, OXTS (KITTI raw). WGS84 degrees, seconds."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.eval.metrics.association import TrajectoryError

MAX_FIX_BYTES: Final = 128 << 20  # a day of GPX at 10 Hz
RANGE_ERROR_M: Final = 4.0  # sigma of a position at a dilution (HDOP) of 1, single-frequency receiver under open sky
TIME_NAMES: Final = ("t_s", "t", "time", "timestamp", "time_s", "epoch", "utc", "datetime", "date_time")
LAT_NAMES: Final = ("lat", "latitude", "lat_deg", "latitude_deg")
LON_NAMES: Final = ("lon", "lng", "long", "longitude", "lon_deg", "longitude_deg")
SIGMA_NAMES: Final = ("sigma_m", "sigma", "accuracy", "accuracy_m", "horizontal_accuracy", "h_acc", "hacc", "pos_accuracy")
HDOP_NAMES: Final = ("hdop",)
OXTS_ACCURACY: Final = 23  # column of pos_accuracy, metres


@dataclass(frozen=True, slots=True, eq=False)
class Fixes:
    """N fixes in order of time."""

    t_s: FloatArray  # (N,) seconds, since 1970 where the file says the date
    lat_deg: FloatArray  # (N,)
    lon_deg: FloatArray  # (N,)
    sigma_m: FloatArray | None  # (N,) standard deviation of a position along one axis; None: the file does not say
    notes: tuple[str, ...]  # what was left out, and how the accuracy was told


@dataclass(frozen=True, slots=True)
class _Fix:
    t_s: float
    lat_deg: float
    lon_deg: float
    sigma_m: float = np.nan


def is_fix_file(path: Path) -> bool:
    """Whether a file or folder holds fixes in latitude and longitude, by its kind, or the names of its columns."""
    if path.is_dir():
        return _oxts_folder(path) is not None
    if path.suffix.lower() in (".gpx", ".nmea", ".geojson"):
        return True
    try:
        with path.open("rb") as stream:
            head = stream.read(4096)
    except OSError:
        return False
    text = head.decode("utf-8-sig", "replace").lstrip()
    if text.startswith(("$GP", "$GN", "$GL", "$GA", "{")) or "<gpx" in text:
        return True
    names = _names(text.splitlines()[0]) if text else []
    return _column(names, LAT_NAMES) is not None and _column(names, LON_NAMES) is not None


def read_fixes(path: Path) -> Fixes:
    """Read fixes; the kind of file is told by its content.

    Raises:
        TrajectoryError: The file cannot be read or is none of these; the message names the place and the cure.
    """
    if path.is_dir():
        return _checked(path, list(_oxts(path)), [])
    data = _bytes(path)
    text = _text(path, data)
    start = text.lstrip()
    notes: list[str] = []
    if start.startswith("<"):
        rows = list(_gpx(path, data, notes))
    elif start.startswith("{"):
        rows = list(_geojson(path, text))
    elif start.startswith(("$", "!")):
        rows = _nmea(path, text, notes)
    else:
        rows = list(_csv(path, text, notes))
    return _checked(path, rows, notes)


def _checked(path: Path, rows: Sequence[_Fix], notes: list[str]) -> Fixes:
    if not rows:
        raise TrajectoryError(f"{path}: no fixes with a time in it")
    table = np.array([(row.t_s, row.lat_deg, row.lon_deg, row.sigma_m) for row in rows])
    wrong = ~(np.isfinite(table[:, :3]).all(axis=1) & (np.abs(table[:, 1]) <= 90.0) & (np.abs(table[:, 2]) <= 180.0))
    if wrong.any():
        bad = int(np.flatnonzero(wrong)[0])
        raise TrajectoryError(
            f"{path}: fix {bad + 1}: latitude {table[bad, 1]:g}, longitude {table[bad, 2]:g} is no place on Earth; "
            "give WGS84 degrees"
        )
    earlier = np.diff(table[:, 0])
    if (earlier < 0.0).any():
        raise TrajectoryError(
            f"{path}: fix {int(np.flatnonzero(earlier < 0.0)[0]) + 2} is earlier than the one before; sort the fixes"
        )
    kept = np.concatenate([[True], earlier > 0.0])
    if (dropped := int((~kept).sum())) > 0:
        notes.append(f"{dropped} fix(es) with the time of the one before are left out")
    table = table[kept]
    sigma_m = table[:, 3] if np.isfinite(table[:, 3]).any() else None
    return Fixes(table[:, 0], table[:, 1], table[:, 2], sigma_m, tuple(notes))


def _bytes(path: Path) -> bytes:
    try:
        if (size := path.stat().st_size) > MAX_FIX_BYTES:
            raise TrajectoryError(f"{path}: {size} bytes, the limit is {MAX_FIX_BYTES}; cut the track to the drive")
        return path.read_bytes()
    except OSError as error:
        raise TrajectoryError(f"{path}: cannot be read: {error.strerror}") from None


def _text(path: Path, data: bytes) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise TrajectoryError(f"{path}: byte {error.start}: not UTF-8 text; save the file as UTF-8") from None


def _gpx(path: Path, data: bytes, notes: list[str]) -> Iterator[_Fix]:
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise TrajectoryError(f"{path}: has a DOCTYPE or entities, which no GPX file needs; remove them")
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError, RecursionError) as error:
        raise TrajectoryError(f"{path}: not a GPX file: {error}") from None
    untimed, by_hdop = 0, False
    for number, point in enumerate((e for e in root.iter() if _local(e.tag) == "trkpt"), start=1):
        inner = {_local(child.tag): (child.text or "").strip() for child in point}
        where = f"{path}: track point {number}"
        if not inner.get("time"):
            untimed += 1
            continue
        by_hdop = by_hdop or "hdop" in inner
        sigma_m = RANGE_ERROR_M * _number(inner["hdop"], where) if inner.get("hdop") else np.nan
        yield _Fix(
            _time_s(inner["time"], where), _number(point.get("lat", ""), where), _number(point.get("lon", ""), where), sigma_m
        )
    if untimed:
        notes.append(f"{untimed} track point(s) without a time are left out")
    if by_hdop:
        notes.append(_hdop_note())


def _csv(path: Path, text: str, notes: list[str]) -> Iterator[_Fix]:
    lines = [(n, line.strip()) for n, line in enumerate(text.splitlines(), start=1) if line.strip()]
    if not lines:
        raise TrajectoryError(f"{path}: empty")
    head = lines[0][1].lstrip("# ")
    separator = max(",;\t", key=head.count)
    names = _names(head)
    t, lat, lon = (_column(names, wanted) for wanted in (TIME_NAMES, LAT_NAMES, LON_NAMES))
    if t is None or lat is None or lon is None:
        raise TrajectoryError(
            f"{path}: line {lines[0][0]}: its columns are {', '.join(names)[:80]}; name a time (t_s), a latitude (lat) and a "
            "longitude (lon)"
        )
    sigma, hdop = _column(names, SIGMA_NAMES), _column(names, HDOP_NAMES)
    if sigma is None and hdop is not None:
        notes.append(_hdop_note())
    for number, line in lines[1:]:
        if line.startswith("#"):
            continue
        where = f"{path}: line {number}"
        words = next(csv.reader([line], delimiter=separator))
        if len(words) < len(names):
            raise TrajectoryError(f"{where}: {len(words)} columns, the first line names {len(names)}")
        accuracy = np.nan
        if sigma is not None:
            accuracy = _number(words[sigma], where) if words[sigma].strip() else np.nan
        elif hdop is not None:
            accuracy = RANGE_ERROR_M * _number(words[hdop], where) if words[hdop].strip() else np.nan
        yield _Fix(_time_s(words[t], where), _number(words[lat], where), _number(words[lon], where), accuracy)


def _nmea(path: Path, text: str, notes: list[str]) -> list[_Fix]:
    """Places of RMC, which says the date, with the HDOP of the GGA of the same instant; GGA alone gives seconds of the day."""
    full, of_day, accuracy_m, bad = list[tuple[str, _Fix]](), list[_Fix](), dict[str, float](), 0
    days, before_s = 0, -1.0
    for number, line in enumerate(text.splitlines(), start=1):
        words, where = line.strip().split("*")[0].split(","), f"{path}: line {number}"
        kind = words[0][-3:]
        if kind not in ("RMC", "GGA"):
            continue
        if not _checksum_holds(line.strip()):
            bad += 1
            continue
        if kind == "GGA" and len(words) > 8 and words[6] not in ("", "0"):
            clock_s = _clock_s(words[1], where)
            days += clock_s < before_s - 43200.0
            before_s = clock_s
            accuracy_m[words[1]] = RANGE_ERROR_M * _number(words[8], where) if words[8] else np.nan
            place = _nmea_deg(words[2], words[3], where), _nmea_deg(words[4], words[5], where)
            of_day.append(_Fix(clock_s + 86400.0 * days, *place, accuracy_m[words[1]]))
        elif kind == "RMC" and len(words) > 9 and words[2] == "A":
            place = _nmea_deg(words[3], words[4], where), _nmea_deg(words[5], words[6], where)
            full.append((words[1], _Fix(_date_s(words[9], where) + _clock_s(words[1], where), *place)))
    if bad:
        notes.append(f"{bad} sentence(s) with a wrong checksum are left out")
    if accuracy_m:
        notes.append(_hdop_note())
    if full:
        return [_Fix(fix.t_s, fix.lat_deg, fix.lon_deg, accuracy_m.get(clock, np.nan)) for clock, fix in full]
    if of_day:
        notes.append("the sentences say no date: times are seconds of the day")
    return of_day


def _geojson(path: Path, text: str) -> Iterator[_Fix]:
    try:
        content: Any = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise TrajectoryError(f"{path}: not a GeoJSON file: {str(error)[:80]}") from None
    features = content.get("features", [content]) if isinstance(content, dict) else []
    lines = 0
    for number, feature in enumerate(features if isinstance(features, list) else [], start=1):
        geometry = feature.get("geometry") if isinstance(feature, dict) else None
        if not isinstance(geometry, dict) or geometry.get("type") != "LineString":
            continue
        lines += 1
        about = feature.get("properties") or {}
        inner = about.get("coordinateProperties") or {} if isinstance(about, dict) else {}
        times = (
            (about.get("coordTimes") or about.get("times") or inner.get("times") or about.get("t_s"))
            if isinstance(about, dict)
            else None
        )
        places = geometry.get("coordinates")
        if not isinstance(times, list) or not isinstance(places, list) or len(times) != len(places):
            raise TrajectoryError(
                f"{path}: feature {number}: a LineString of a drive needs a time for each place ('coordTimes' in its properties)"
            )
        for place, (time, at) in enumerate(zip(times, places, strict=True), start=1):
            where = f"{path}: feature {number}: place {place}"
            if not isinstance(at, list) or len(at) < 2:
                raise TrajectoryError(f"{where}: not a longitude and a latitude")
            yield _Fix(_time_s(str(time), where), _number(at[1], where), _number(at[0], where))
    if not lines:
        raise TrajectoryError(f"{path}: no Feature with a LineString in it")


def _oxts_folder(path: Path) -> Path | None:
    return next((folder for folder in (path / "oxts", path) if (folder / "timestamps.txt").exists() and (folder / "data").is_dir()
                 and next((folder / "data").glob("*.txt"), None) is not None), None)  # fmt: skip


def _oxts(path: Path) -> Iterator[_Fix]:
    if (folder := _oxts_folder(path)) is None:
        raise TrajectoryError(f"{path}: no OXTS data in it (oxts/timestamps.txt, oxts/data/*.txt)")
    times = _text(folder / "timestamps.txt", _bytes(folder / "timestamps.txt")).split("\n")
    for file in sorted((folder / "data").glob("*.txt")):
        where, number = str(file), int(file.stem) if file.stem.isdecimal() else -1
        if not 0 <= number < len(times):
            raise TrajectoryError(f"{where}: no line {number + 1} in timestamps.txt")
        words = _text(file, _bytes(file)).split()
        if len(words) < 2:
            raise TrajectoryError(f"{where}: {len(words)} columns, expected latitude, longitude and more")
        accuracy = _number(words[OXTS_ACCURACY], where) if len(words) > OXTS_ACCURACY else np.nan
        yield _Fix(_time_s(times[number], where), _number(words[0], where), _number(words[1], where), accuracy)


def _time_s(text: str, where: str) -> float:
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


def _clock_s(word: str, where: str) -> float:
    if len(word) < 6 or not word[:6].isdecimal():
        raise TrajectoryError(f"{where}: '{word[:20]}' is no time of day (hhmmss)")
    return 3600.0 * int(word[:2]) + 60.0 * int(word[2:4]) + _number(word[4:], where)


def _date_s(word: str, where: str) -> float:
    try:
        day = date(2000 + int(word[4:6]), int(word[2:4]), int(word[:2]))
    except ValueError:
        raise TrajectoryError(f"{where}: '{word[:20]}' is no date (ddmmyy)") from None
    return (datetime(day.year, day.month, day.day, tzinfo=UTC) - datetime(1970, 1, 1, tzinfo=UTC)) / timedelta(seconds=1)


def _nmea_deg(word: str, side: str, where: str) -> float:
    digits = word.partition(".")[0]
    if len(digits) < 3 or side not in ("N", "S", "E", "W"):
        raise TrajectoryError(f"{where}: '{word[:20]},{side[:2]}' is no place (ddmm.mmmm,N)")
    degrees = _number(digits[:-2], where) + _number(word[len(digits) - 2 :], where) / 60.0
    return -degrees if side in ("S", "W") else degrees


def _checksum_holds(line: str) -> bool:
    body, star, said = line.lstrip("$!").partition("*")
    if not star:
        return True
    total = 0
    for character in body.encode():
        total ^= character
    return said[:2].upper() == f"{total:02X}"


def _number(text: Any, where: str) -> float:
    try:
        return float(text)
    except (ValueError, TypeError, OverflowError):
        raise TrajectoryError(f"{where}: '{str(text)[:40]}' is not a number") from None


def _names(head: str) -> list[str]:
    head = head.lstrip("# ")
    separator = max(",;\t", key=head.count)
    return [
        word.strip().strip('"').lower().split("[")[0].split("(")[0].strip().replace(" ", "_") for word in head.split(separator)
    ]


def _column(names: Sequence[str], wanted: Sequence[str]) -> int | None:
    return next((names.index(name) for name in wanted if name in names), None)


def _local(tag: Any) -> str:
    return str(tag).rpartition("}")[2]


def _hdop_note() -> str:
    return f"accuracy: {RANGE_ERROR_M:g} m times the dilution of precision (hdop)"
