"""Fixes of NMEA 0183: places of RMC with the accuracy of GGA, or of GGA alone."""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import numpy as np

from hippodrome.eval.files.fix_values import RANGE_ERROR_M, Fix, as_number, hdop_note
from hippodrome.eval.metrics.association import TrajectoryError


def nmea_fixes(path: Path, text: str, notes: list[str]) -> list[Fix]:
    """Places of RMC, which says the date, with the HDOP of the GGA of the same instant; GGA alone gives seconds of the day."""
    full, of_day, accuracy_m, bad = list[tuple[str, Fix]](), list[Fix](), dict[str, float](), 0
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
            accuracy_m[words[1]] = RANGE_ERROR_M * as_number(words[8], where) if words[8] else np.nan
            place = _nmea_deg(words[2], words[3], where), _nmea_deg(words[4], words[5], where)
            of_day.append(Fix(clock_s + 86400.0 * days, *place, accuracy_m[words[1]]))
        elif kind == "RMC" and len(words) > 9 and words[2] == "A":
            place = _nmea_deg(words[3], words[4], where), _nmea_deg(words[5], words[6], where)
            full.append((words[1], Fix(_date_s(words[9], where) + _clock_s(words[1], where), *place)))
    if bad:
        notes.append(f"{bad} sentence(s) with a wrong checksum are left out")
    if accuracy_m:
        notes.append(hdop_note())
    if full:
        return [Fix(fix.t_s, fix.lat_deg, fix.lon_deg, accuracy_m.get(clock, np.nan)) for clock, fix in full]
    if of_day:
        notes.append("the sentences say no date: times are seconds of the day")
    return of_day


def _clock_s(word: str, where: str) -> float:
    if len(word) < 6 or not word[:6].isdecimal():
        raise TrajectoryError(f"{where}: '{word[:20]}' is no time of day (hhmmss)")
    return 3600.0 * int(word[:2]) + 60.0 * int(word[2:4]) + as_number(word[4:], where)


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
    minutes = as_number(word[len(digits) - 2 :], where)
    if not 0.0 <= minutes < 60.0:
        raise TrajectoryError(f"{where}: '{word[:20]}' has {minutes:g} minutes of arc, a degree has 60")
    degrees = as_number(digits[:-2], where) + minutes / 60.0
    return -degrees if side in ("S", "W") else degrees


def _checksum_holds(line: str) -> bool:
    body, star, said = line.lstrip("$!").partition("*")
    if not star:
        return True
    total = 0
    for character in body.encode():
        total ^= character
    return said[:2].upper() == f"{total:02X}"
