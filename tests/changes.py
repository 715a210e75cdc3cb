"""Seeded, structure-aware changes that break a file: its bytes, lines, numbers, JSON or XML values, arrays, packed records."""

from __future__ import annotations

import contextlib
import io
import json
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from hippodrome.proto.codec import FORMAT_VERSION
from hippodrome.proto.pbstream import read_stream, write_stream

NASTY: Final = ("nan", "inf", "-inf", "1e308", "-1e300", "1e-320", "0", "-1", "9" * 20, "9" * 400, "9" * 5000, "1e400", "", "x",
                "0x10", "٣", "²", "1_0", "\x00", "[red]", '"', "../../etc/passwd", "a" * 5000, "!!float x", "2001-99-99",
                "*a", "&a [*a]", "{<<: 1}", "&lol;", "&#0;")  # fmt: skip
LEAVES: Final = (None, True, [], {}, "", "x", -1, 0, 1e308, float("nan"), float("-inf"), 10**30, "nan", [[[]]], {"a": {}},
                 "\ud800x".encode("utf-8", "replace").decode(), "\x1b[31m[red]", 0.5, 2**31, 2**63, [1, 2, 3])  # fmt: skip
TEXTS: Final = (
    ".csv",
    ".txt",
    ".tum",
    ".yaml",
    ".gpx",
    ".nmea",
    ".json",
    ".geojson",
    ".catalog",
    ".log",
    ".xml",
    ".osm",
    ".xodr",
)
MARKUP: Final = (".xml", ".osm", ".xodr", ".gpx")
DOCUMENTS: Final = (".json", ".geojson", ".catalog")


def change(rng: np.random.Generator, path: Path) -> str:
    """Break a file in one way that suits its kind, and say which."""
    if path.suffix in (".pbstream", ".npz", ".zip") and rng.random() < 0.8:
        kind = {".pbstream": record_changed, ".npz": array_changed, ".zip": member_changed}[path.suffix]
        kind(rng, path)
        return kind.__name__
    kinds: list[Callable[[np.random.Generator, bytes], bytes]] = [*BINARY]
    if path.suffix in TEXTS:
        kinds = [*TEXT, *TEXT, *BINARY[:2]]
    if path.suffix in DOCUMENTS:
        kinds += [_json_leaf] * 8
    if path.suffix in MARKUP:
        kinds += [_attribute] * 12 + [_attribute_lost] * 4 + [_attributes_swapped] * 6 + [_element_lost] * 6
    chosen = kinds[int(rng.integers(len(kinds)))]
    path.write_bytes(chosen(rng, path.read_bytes()))
    return chosen.__name__.strip("_")


def record_changed(rng: np.random.Generator, path: Path) -> None:
    """One record of a map is broken; sizes and checksums around it are right, as of one who did it on purpose."""
    _, records = read_stream(path, FORMAT_VERSION)
    at = _some(rng, len(records))
    kinds = (_cut, _noise, _bit, _large, _twice, _empty, _float)
    records[at] = kinds[_some(rng, len(kinds))](rng, records[at])
    if rng.random() < 0.1:
        records = records[: _some(rng, len(records) + 1)]
    write_stream(path, FORMAT_VERSION, records)


def array_changed(rng: np.random.Generator, path: Path) -> None:
    """One array of an npz file becomes one of other values, type or shape, or is lost."""
    with np.load(path, allow_pickle=False) as data:
        arrays = dict(data)
    name = list(arrays)[_some(rng, len(arrays))]
    array = arrays[name]
    value: Any = rng.choice([np.nan, np.inf, -1.0, 0.0, 1e300, 1e12, 1e-320, 2**31, -(2**40)])
    kind = _some(rng, 7)
    with np.errstate(all="ignore"):
        if kind == 0:
            del arrays[name]
        elif kind == 1:
            arrays[name] = np.array(value)
        elif kind == 2:
            arrays[name] = array[: _some(rng, len(array))] if array.ndim else np.zeros(0)
        elif kind == 3:
            arrays[name] = array[::-1].copy() if array.ndim else array
        elif kind == 4:
            other = rng.choice(["f4", "i8", "U9", "c16", "?"])
            arrays[name] = array.astype(other) if array.dtype.kind in "fiu" else array.reshape(-1, 1)
        elif array.size and array.dtype.kind in "fiu":
            flat = array.ravel().copy()
            begin = _some(rng, len(flat))
            flat[begin : begin + (1 if kind == 5 else len(flat))] = np.array(value).astype(array.dtype)
            arrays[name] = flat.reshape(array.shape)
    np.savez(path, **arrays)


def member_changed(rng: np.random.Generator, path: Path) -> None:
    """One file within a ZIP archive is broken, lost, or packed otherwise."""
    with zipfile.ZipFile(path) as archive:
        members = {item.filename: archive.read(item) for item in archive.infolist()}
    name = list(members)[_some(rng, len(members))]
    if rng.random() < 0.2:
        del members[name]
    else:
        members[name] = BINARY[_some(rng, len(BINARY))](rng, members[name])
    blob = io.BytesIO()
    with zipfile.ZipFile(blob, "w", int(rng.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_LZMA]))) as archive:
        for member, content in members.items():
            archive.writestr(member, content)
    path.write_bytes(blob.getvalue())


def _lines(
    change_lines: Callable[[np.random.Generator, list[bytes]], list[bytes]],
) -> Callable[[np.random.Generator, bytes], bytes]:
    def changed(rng: np.random.Generator, data: bytes) -> bytes:
        return b"\n".join(change_lines(rng, data.split(b"\n")))

    changed.__name__ = change_lines.__name__
    return changed


def _some(rng: np.random.Generator, count: int) -> int:
    return int(rng.integers(max(count, 1)))


@_lines
def _line_lost(rng: np.random.Generator, lines: list[bytes]) -> list[bytes]:
    at = _some(rng, len(lines))
    return lines[:at] + lines[at + 1 + _some(rng, 3) :]


@_lines
def _line_twice(rng: np.random.Generator, lines: list[bytes]) -> list[bytes]:
    at = _some(rng, len(lines))
    return lines[:at] + [lines[at]] * int(rng.integers(1, 4)) + lines[at:]


@_lines
def _lines_swapped(rng: np.random.Generator, lines: list[bytes]) -> list[bytes]:
    a, b = _some(rng, len(lines)), _some(rng, len(lines))
    lines[a], lines[b] = lines[b], lines[a]
    return lines


@_lines
def _column_lost(rng: np.random.Generator, lines: list[bytes]) -> list[bytes]:
    at = _some(rng, len(lines))
    words = re.split(rb"([,; \t])", lines[at])
    lines[at] = b"".join(words[: -2 if len(words) > 2 else None])
    return lines


def _number(rng: np.random.Generator, data: bytes) -> bytes:
    found = list(re.finditer(rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?", data))
    if not found:
        return data
    nasty = NASTY[_some(rng, len(NASTY))].encode()
    one = found[_some(rng, len(found))]
    return data[: one.start()] + nasty + data[one.end() :]


def _numbers(rng: np.random.Generator, data: bytes) -> bytes:
    """All numbers of one column, or all of one size, become another's."""
    factor = float(rng.choice([1e9, -1.0, 0.0, 1e-9, 1e300]))
    column = _some(rng, 9)

    def scaled(line: bytes) -> bytes:
        words = re.split(rb"([,; \t])", line)
        with contextlib.suppress(ValueError, IndexError):
            words[2 * column] = repr(float(words[2 * column]) * factor).encode()
        return b"".join(words)

    return b"\n".join(scaled(line) for line in data.split(b"\n"))


def _cut(rng: np.random.Generator, data: bytes) -> bytes:
    return data[: _some(rng, len(data))]


def _noise(rng: np.random.Generator, data: bytes) -> bytes:
    at = _some(rng, len(data))
    return data[:at] + rng.integers(0, 256, int(rng.integers(1, 40)), np.uint8).tobytes() + data[at + _some(rng, 40) :]


def _bit(rng: np.random.Generator, data: bytes) -> bytes:
    broken = bytearray(data)
    for _ in range(int(rng.integers(1, 6)) if data else 0):
        broken[_some(rng, len(data))] ^= 1 << _some(rng, 8)
    return bytes(broken)


def _large(rng: np.random.Generator, data: bytes) -> bytes:
    """Four or eight bytes, where a length may stand, become as large as they can."""
    at, width = _some(rng, len(data)), int(rng.choice([1, 2, 4, 8]))
    return data[:at] + rng.choice([b"\xff", b"\x7f", b"\x00"]) * width + data[at + width :]


def _twice(rng: np.random.Generator, data: bytes) -> bytes:
    a, b = sorted((_some(rng, len(data)), _some(rng, len(data))))
    return data[:b] + data[a:b] * int(rng.integers(1, 3)) + data[b:]


def _empty(_rng: np.random.Generator, _data: bytes) -> bytes:
    return b""


def _json_leaf(rng: np.random.Generator, data: bytes) -> bytes:
    """One value of a JSON document, or of a line of one, becomes another."""
    try:
        whole = json.loads(data)
        return json.dumps(_with_leaf(rng, whole)).encode()
    except ValueError:
        lines = data.split(b"\n")
        at = _some(rng, len(lines))
        with contextlib.suppress(ValueError):
            lines[at] = json.dumps(_with_leaf(rng, json.loads(lines[at]))).encode()
        return b"\n".join(lines)


def _with_leaf(rng: np.random.Generator, value: Any) -> Any:
    if isinstance(value, dict) and value and rng.random() < 0.85:
        name = list(value)[_some(rng, len(value))]
        if rng.random() < 0.15:
            return {key: inner for key, inner in value.items() if key != name}
        return {**value, name: _with_leaf(rng, value[name])}
    if isinstance(value, list) and value and rng.random() < 0.85:
        at = _some(rng, len(value))
        return [*value[:at], _with_leaf(rng, value[at]), *value[at + 1 :]]
    return LEAVES[_some(rng, len(LEAVES))]


def _float(rng: np.random.Generator, data: bytes) -> bytes:
    """Eight bytes, where a number may stand, become one that no vehicle makes."""
    at = 8 * _some(rng, len(data) // 8) + int(rng.integers(8)) * (rng.random() < 0.8)
    value = float(rng.choice([np.nan, np.inf, -1.0, 0.0, 1e300, 1e9, 5e-324]))
    return data[:at] + np.float64(value).tobytes() + data[at + 8 :]


ATTRIBUTE: Final = re.compile(rb'([\w:.-]+)="([^"]*)"')


def _found(rng: np.random.Generator, data: bytes, pattern: re.Pattern[bytes]) -> re.Match[bytes] | None:
    """One of the places where a pattern is found, from a random place on: elements at the end are as likely as those before."""
    return pattern.search(data, _some(rng, len(data))) or pattern.search(data)


def _attribute(rng: np.random.Generator, data: bytes) -> bytes:
    one = _found(rng, data, ATTRIBUTE)
    return data if one is None else data[: one.start(2)] + NASTY[_some(rng, len(NASTY))].encode() + data[one.end(2) :]


def _attribute_lost(rng: np.random.Generator, data: bytes) -> bytes:
    one = _found(rng, data, ATTRIBUTE)
    return data if one is None else data[: one.start()] + data[one.end() :]


def _attributes_swapped(rng: np.random.Generator, data: bytes) -> bytes:
    """An attribute has the value of another one: a name that exists, in a place where it makes no sense."""
    one, other = _found(rng, data, ATTRIBUTE), _found(rng, data, ATTRIBUTE)
    return data if one is None or other is None else data[: one.start(2)] + other.group(2) + data[one.end(2) :]


def _element_lost(rng: np.random.Generator, data: bytes) -> bytes:
    one = _found(rng, data, re.compile(rb"<([\w:]+)[^<>]*/>|<([\w:]+)\b[^<>]*>.{0,3000}?</\2>", re.DOTALL))
    return data if one is None else data[: one.start()] + data[one.end() :]


TEXT: Final = (_line_lost, _line_twice, _lines_swapped, _column_lost, _number, _number, _number, _numbers, _numbers, _empty)
BINARY: Final = (_cut, _noise, _bit, _large, _twice, _empty)
