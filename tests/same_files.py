"""Two folders of results, file by file: which are not the same bytes, are missing, or are too many."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, Final

from benchmarks.same.contents import LEFT_OUT

# What a run of ORB-SLAM3 comes to differs from run to run, and belongs to the run that ended first.
RANDOM: Final = re.compile(r"(^|/)orb-slam3(/|\.json$)")
TEXTS: Final = (".md", ".html", ".txt", ".csv", ".svg")
NUMBER: Final = re.compile(rb"(<|&lt;)?\d+(\.\d+)?(e[+-]?\d+)?")  # "<0.001" is a time, too


def differences(whole: Path, out: Path) -> list[str]:
    """The files of ``whole`` that ``out`` lacks, or has with other bytes, times and hashes of provenance left out."""
    found = []
    for name in sorted(_files(whole)):
        if not (out / name).is_file():
            found.append(f"{name} is lost")
        elif not RANDOM.search(name) and not _same(whole / name, out / name):
            found.append(f"{name} has other bytes")
    return found


def extra(whole: Path, out: Path) -> list[str]:
    """The files and folders of ``out`` that ``whole`` does not have."""
    names = {path.relative_to(whole).as_posix() for path in whole.rglob("*")}
    return sorted(
        name for path in out.rglob("*") if (name := path.relative_to(out).as_posix()) not in names and not RANDOM.search(name)
    )


def _files(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def _same(one: Path, other: Path) -> bool:
    """Whether two files hold the same. Of JSON the times do not count, nor the figures of texts, which have them from there."""
    first, second = one.read_bytes(), other.read_bytes()
    if first == second:
        return True
    if one.suffix == ".json":
        return _untimed(json.loads(first)) == _untimed(json.loads(second))
    return one.suffix in TEXTS and NUMBER.sub(b"#", first) == NUMBER.sub(b"#", second)


def _untimed(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _untimed(item) for key, item in value.items() if key not in LEFT_OUT}
    return [_untimed(item) for item in value] if isinstance(value, list) else value
