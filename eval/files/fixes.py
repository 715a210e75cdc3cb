"""Fixes of satellite navigation, as people have them: GPX, CSV, NMEA 0183, GeoJSON, OXTS (KITTI raw). WGS84 degrees, seconds."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np

from hippodrome._files import open_regular
from hippodrome._json import parse_json
from hippodrome.core.types import FloatArray
from hippodrome.eval.files.fix_values import RANGE_ERROR_M, Fix, as_number, file_bytes, file_text, hdop_note, time_s
from hippodrome.eval.files.nmea import nmea_fixes
from hippodrome.eval.metrics.association import TrajectoryError

TIME_NAMES: Final = ("t_s", "t", "time", "timestamp", "time_s", "epoch", "utc", "datetime", "date_time")
LAT_NAMES: Final = ("lat", "latitude", "lat_deg", "latitude_deg")
LON_NAMES: Final = ("lon", "lng", "long", "longitude", "lon_deg", "longitude_deg")
SIGMA_NAMES: Final = ("sigma_m", "sigma", "accuracy", "accuracy_m", "horizontal_accuracy", "h_acc", "hacc", "pos_accuracy")
HDOP_NAMES: Final = ("hdop",)
WORST_SIGMA_M: Final = 1e7  # a quarter of the way round the Earth
OXTS_ACCURACY: Final = 23  # column of pos_accuracy, metres


@dataclass(frozen=True, slots=True, eq=False)
class Fixes:
    """N fixes in order of time."""

    t_s: FloatArray  # (N,) seconds, since 1970 where the file says the date
    lat_deg: FloatArray  # (N,)
    lon_deg: FloatArray  # (N,)
    sigma_m: FloatArray | None  # (N,) standard deviation of a position along one axis; None: the file does not say
    notes: tuple[str, ...]  # what was left out, and how the accuracy was told


def is_fix_file(path: Path) -> bool:
    """Whether a file or folder holds fixes in latitude and longitude, by its kind, or the names of its columns."""
    if path.is_dir():
        return _oxts_folder(path) is not None
    if path.suffix.lower() in (".gpx", ".nmea", ".geojson"):
        return True
    try:
        with open_regular(path) as stream:
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
    data = file_bytes(path)
    text = file_text(path, data)
    start = text.lstrip()
    notes: list[str] = []
    if start.startswith("<"):
        rows = list(_gpx(path, data, notes))
    elif start.startswith("{"):
        rows = list(_geojson(path, text))
    elif start.startswith(("$", "!")):
        rows = nmea_fixes(path, text, notes)
    else:
        rows = list(_csv(path, text, notes))
    return _checked(path, rows, notes)


def _checked(path: Path, rows: Sequence[Fix], notes: list[str]) -> Fixes:
    if not rows:
        raise TrajectoryError(f"{path}: no fixes with a time in it{' (' + '; '.join(notes) + ')' if notes else ''}")
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
    none = (table[:, 3] <= 0.0) | (table[:, 3] > WORST_SIGMA_M)
    if none.any():
        first = int(np.flatnonzero(none)[0])
        notes.append(f"{int(none.sum())} fix(es) have an accuracy that is none ({table[first, 3]:g} m): taken as not known")
        table[none, 3] = np.nan
    sigma_m = table[:, 3] if np.isfinite(table[:, 3]).any() else None
    return Fixes(table[:, 0], table[:, 1], table[:, 2], sigma_m, tuple(notes))


def _gpx(path: Path, data: bytes, notes: list[str]) -> Iterator[Fix]:
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
        sigma_m = RANGE_ERROR_M * as_number(inner["hdop"], where) if inner.get("hdop") else np.nan
        yield Fix(
            time_s(inner["time"], where), as_number(point.get("lat", ""), where), as_number(point.get("lon", ""), where), sigma_m
        )
    if untimed:
        notes.append(f"{untimed} track point(s) without a time are left out")
    if by_hdop:
        notes.append(hdop_note())


def _csv(path: Path, text: str, notes: list[str]) -> Iterator[Fix]:
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
        notes.append(hdop_note())
    for number, line in lines[1:]:
        if line.startswith("#"):
            continue
        where = f"{path}: line {number}"
        try:
            words = next(csv.reader([line], delimiter=separator))
        except csv.Error as error:
            raise TrajectoryError(f"{where}: {error}") from None
        if len(words) < len(names):
            raise TrajectoryError(f"{where}: {len(words)} columns, the first line names {len(names)}")
        accuracy = np.nan
        if sigma is not None:
            accuracy = as_number(words[sigma], where) if words[sigma].strip() else np.nan
        elif hdop is not None:
            accuracy = RANGE_ERROR_M * as_number(words[hdop], where) if words[hdop].strip() else np.nan
        yield Fix(time_s(words[t], where), as_number(words[lat], where), as_number(words[lon], where), accuracy)


def _geojson(path: Path, text: str) -> Iterator[Fix]:
    try:
        content: Any = parse_json(text)
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
            yield Fix(time_s(str(time), where), as_number(at[1], where), as_number(at[0], where))
    if not lines:
        raise TrajectoryError(f"{path}: no Feature with a LineString in it")


def _oxts_folder(path: Path) -> Path | None:
    return next((folder for folder in (path / "oxts", path) if (folder / "timestamps.txt").exists() and (folder / "data").is_dir()
                 and next((folder / "data").glob("*.txt"), None) is not None), None)  # fmt: skip


def _oxts(path: Path) -> Iterator[Fix]:
    if (folder := _oxts_folder(path)) is None:
        raise TrajectoryError(f"{path}: no OXTS data in it (oxts/timestamps.txt, oxts/data/*.txt)")
    times = file_text(folder / "timestamps.txt", file_bytes(folder / "timestamps.txt")).split("\n")
    for file in sorted((folder / "data").glob("*.txt")):
        where, number = str(file), int(file.stem) if file.stem.isdecimal() else -1
        if not 0 <= number < len(times):
            raise TrajectoryError(f"{where}: no line {number + 1} in timestamps.txt")
        words = file_text(file, file_bytes(file)).split()
        if len(words) < 2:
            raise TrajectoryError(f"{where}: {len(words)} columns, expected latitude, longitude and more")
        accuracy = as_number(words[OXTS_ACCURACY], where) if len(words) > OXTS_ACCURACY else np.nan
        yield Fix(time_s(times[number], where), as_number(words[0], where), as_number(words[1], where), accuracy)


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
