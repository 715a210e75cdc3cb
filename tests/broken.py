"""Broken inputs, made of whole ones by seeded, structure-aware changes, and what may come of them.

A reader joins by a ``Subject``: how its whole input is written, and the command that reads it. Every change is a function of a
random generator, so a number says which input fell. ``python -m tests.broken --cases 3000 --seed 1`` runs a campaign over all
subjects of tests/eval/exchange/subjects.py.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
import resource
import shutil
import signal
import traceback
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from hippodrome.eval.cli import main

LONGEST_S: Final = 30  # a case that takes longer hangs
LARGEST_KB: Final = 1 << 20  # of growth of the process in one case
NASTY: Final = ("nan", "inf", "-inf", "1e308", "-1e300", "1e-320", "0", "-1", "9" * 20, "9" * 400, "9" * 5000, "1e400", "", "x",
                "0x10", "٣", "²", "1_0", "\x00", "[red]", '"', "../../etc/passwd", "a" * 5000)  # fmt: skip
LEAVES: Final = (
    None,
    True,
    [],
    {},
    "",
    "x",
    -1,
    0,
    1e308,
    10**30,
    "nan",
    [[[]]],
    {"a": {}},
    "\ud800x".encode("utf-8", "replace").decode(),
)


@dataclass(frozen=True)
class Subject:
    """An input and its reader."""

    name: str
    write: Callable[[Path], None]  # the whole input into an empty folder
    command: Callable[[Path, Path], list[str]]  # of (folder of the input, path of the result)
    files: str = "**/*"  # which of the files are changed


@dataclass(frozen=True)
class Outcome:
    """What came of a case: the name of what was wrong, or "" """

    fault: str
    detail: str
    accepted: bool


def change(rng: np.random.Generator, path: Path) -> str:
    """Break a file in one way, and say which."""
    data = path.read_bytes()
    kinds: list[Callable[[np.random.Generator, bytes], bytes]] = [*BINARY]
    if path.suffix in (".csv", ".txt", ".tum", ".yaml", ".gpx", ".nmea", ".json", ".geojson", ".catalog", ".log"):
        kinds = [*TEXT, *TEXT, *BINARY[:2]]
    if path.suffix in (".json", ".geojson", ".catalog"):
        kinds += [_json_leaf] * 8
    kind = kinds[int(rng.integers(len(kinds)))]
    path.write_bytes(kind(rng, data))
    return kind.__name__.strip("_")


def run_case(subject: Subject, whole: Path, seed: int, place: Path) -> Outcome:
    """Break a copy of the whole input and have it read, in this process."""
    rng = np.random.default_rng([seed, *subject.name.encode()])
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(whole, place / "in")
    files: dict[str, list[Path]] = {}  # by ending, so that a hundred images do not hide the one list of them
    for path in sorted((place / "in").glob(subject.files)):
        if path.is_file():
            files.setdefault(path.suffix, []).append(path)
    said = []
    for _ in range(int(rng.integers(1, 3))):
        alike = list(files.values())[_some(rng, len(files))]
        path = alike[_some(rng, len(alike))]
        said.append(f"{path.name}: {change(rng, path)}")
    return _run(subject.command(place / "in", place / "out"), f"seed {seed}: {'; '.join(said)}")


def _run(command: list[str], said: str) -> Outcome:
    out, err = io.StringIO(), io.StringIO()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    previous = signal.signal(signal.SIGALRM, _too_long)
    signal.alarm(LONGEST_S)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            status = main(command)
    except SystemExit as error:
        status = int(error.code or 0)
    except TimeoutError:
        return Outcome("hang", said, False)
    except BaseException as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        return Outcome(
            "traceback",
            f"{said}: {type(error).__name__}: {str(error)[:120]} at {Path(place.filename).name}:{place.lineno}",
            False,
        )
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, previous)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    if grown > LARGEST_KB:
        return Outcome("memory", f"{said}: {grown >> 10} MiB", False)
    lines = err.getvalue().strip().splitlines()
    if status not in (0, 2) or (status == 2 and len(lines) != 1):
        return Outcome("no sentence", f"{said}: status {status}, {len(lines)} lines: {' / '.join(lines)[:300]}", False)
    if "Traceback" in err.getvalue() or "fault of hippodrome" in err.getvalue():
        return Outcome("traceback", f"{said}: {lines[-1][:200]}", False)
    return Outcome("", "", status == 0)


def _too_long(*_: Any) -> None:
    raise TimeoutError


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


TEXT: Final = (_line_lost, _line_twice, _lines_swapped, _column_lost, _number, _number, _number, _numbers, _numbers, _empty)
BINARY: Final = (_cut, _noise, _bit, _large, _twice, _empty)


def campaign(subjects: Sequence[Subject], cases: int, seed: int, folder: Path) -> list[Outcome]:
    """The outcomes of ``cases`` broken inputs, as many of each subject."""
    found = []
    for subject in subjects:
        whole = folder / f"whole-{subject.name}"
        whole.mkdir(parents=True)
        subject.write(whole)
        for number in range(cases // len(subjects)):
            found.append((subject.name, run_case(subject, whole, seed * 1_000_000 + number, folder / "case")))
    return [Outcome(one.fault, f"{name}: {one.detail}", one.accepted) for name, one in found]


def _main() -> None:
    import argparse
    import tempfile

    from tests.eval.exchange.subjects import SUBJECTS

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=300, help="how many (default: 300)")
    parser.add_argument("--seed", type=int, default=0, help="of the random changes (default: 0)")
    parser.add_argument("--only", default="", help="names of subjects that begin so (default: all)")
    options = parser.parse_args()
    subjects = [one for one in SUBJECTS if one.name.startswith(options.only)]
    with tempfile.TemporaryDirectory() as folder:
        found = campaign(subjects, options.cases, options.seed, Path(folder))
    for one in found:
        if one.fault:
            print(f"{one.fault}: {one.detail}")
    faults = {name: sum(one.fault == name for one in found) for name in ("traceback", "hang", "memory", "no sentence")}
    print(f"{len(found)} broken inputs, seed {options.seed}: {sum(one.accepted for one in found)} accepted, "
          + ", ".join(f"{count} {name}" for name, count in faults.items()))  # fmt: skip


if __name__ == "__main__":
    _main()
