"""Tubs of donkeycar: a manifest with catalogs of records (version 4 on), or one JSON file a record (before)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from hippodrome._json import parse_json
from hippodrome.eval.exchange.drives.clock import in_seconds
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import ForeignDrive, motion_table
from hippodrome.eval.exchange.drives.images import file_frame
from hippodrome.eval.exchange.drives.poses import Axes
from hippodrome.eval.exchange.readers.text import inside, read_lines

IMAGE: Final = "cam/image_array"
TIMES: Final = ("_timestamp_ms", "milliseconds")
SPEEDS: Final = ("enc/speed", "enc/vel_m_s", "car/speed")
YAW_RATES: Final = ("imu/gyr_z", "car/gyro_z")


def read_tub(folder: Path, _axes: Axes) -> ForeignDrive:
    """Read a tub; self-motion where its records have a speed (``enc/speed``) and a yaw rate (``imu/gyr_z``).

    Deleted records and those without an image or a time are left out, counted and printed. Raises ExchangeError.
    """
    images = folder / "images" if (folder / "images").is_dir() else folder
    rows: list[tuple[float, str, float | None, float | None]] = []
    lost = 0
    for place, record in _records(folder):
        stamp, name = _number(_first(record, TIMES)), record.get(IMAGE)
        if stamp is None or not isinstance(name, str):
            lost += 1
            continue
        if rows and stamp <= rows[-1][0]:
            lost += 1
            continue
        inside(images, name, place)
        rows.append((stamp, name, _number(_first(record, SPEEDS)), _number(_first(record, YAW_RATES))))
    if not rows:
        raise ExchangeError(f"{folder}: no record with a time and an image; is it a tub that the car's camera was part of?")
    if lost:
        print(f"{folder}: {lost} record(s) deleted, without an image or time, or out of order are left out")
    t_s = in_seconds(np.array([row[0] for row in rows]), "ms", str(folder))
    frames = [file_frame(float(t), images / row[1]) for t, row in zip(t_s, rows, strict=True)]
    speed, yaw_rate = [row[2] for row in rows if row[2] is not None], [row[3] for row in rows if row[3] is not None]
    whole = len(speed) == len(yaw_rate) == len(rows)
    motion = motion_table(t_s, np.array(speed), np.array(yaw_rate), str(folder)) if whole else None
    return ForeignDrive(frames, motion, None, None)


def _records(folder: Path) -> Iterator[tuple[Path, dict[str, Any]]]:
    """The records in order, each with the file that it stands in; a deleted one is empty."""
    manifest = folder / "manifest.json"
    if not manifest.exists():
        files = [path for path in folder.glob("record_*.json") if re.fullmatch(r"record_\d+", path.stem)]
        for path in sorted(files, key=lambda path: int(path.stem[7:])):
            yield path, _json(path, 1, "\n".join(read_lines(path)))
        return
    lines = [_json(manifest, number, line) if line.startswith("{") else {}
             for number, line in enumerate(read_lines(manifest), start=1)]  # fmt: skip
    index = next((line for line in lines if isinstance(line.get("paths"), list)), None)
    if index is None:
        raise ExchangeError(f"{manifest}: no line names the catalogs (paths)")
    listed = index.get("deleted_indexes")
    deleted = {one for one in listed if isinstance(one, int)} if isinstance(listed, list) else set()
    for name in index["paths"]:
        catalog = inside(folder, str(name), manifest)
        for number, line in enumerate(read_lines(catalog), start=1):
            if line.strip():
                record = _json(catalog, number, line)
                number_of_record = record.get("_index")
                gone = isinstance(number_of_record, int) and number_of_record in deleted
                yield catalog, {} if gone else record


def _json(path: Path, number: int, text: str) -> dict[str, Any]:
    try:
        value = parse_json(text)
    except (ValueError, RecursionError) as error:
        raise ExchangeError(f"{path}: line {number}: not a JSON record: {str(error)[:80]}") from None
    if not isinstance(value, dict):
        raise ExchangeError(f"{path}: line {number}: not a JSON record")
    return value


def _first(record: dict[str, Any], names: tuple[str, ...]) -> Any:
    return next((record[name] for name in names if name in record), None)


def _number(value: Any) -> float | None:
    """The value as a float; None of what is none, or is too large to be one."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if np.isfinite(number) else None
