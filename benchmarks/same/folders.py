"""Two folders of results, file by file: which files belong together, and which of their values differ.

Values are compared bit for bit, as they are stored. Files are matched by their place in the folder; the content key in the name
of a recording or a town, which depends on the code, is not part of it. What only the second folder has is new and no difference.
"""

from __future__ import annotations

import hashlib
import json
import re
import zipfile
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.same.contents import (
    RECORDING_KEY,
    Leaf,
    Reader,
    arrays_of,
    figures_of,
    frames_of,
    map_of,
    network_of,
    trajectory_of,
)
from hippodrome.core.types import HippodromeError
from hippodrome.sim.recording import MANIFEST

KINDS: Final[tuple[tuple[str, str, Reader], ...]] = (  # the first pattern that a file's name fits
    ("frames", r"frames-\d+\.zip", frames_of),
    ("drives: truth and self-motion", r"(samples|drive)\.npz", arrays_of),
    ("recordings: manifests", r"manifest\.json", figures_of),
    ("towns", r".+\.net\.xml(\.gz)?", network_of),
    ("truth (TUM)", r"(.+-)?ground-truth\.tum", trajectory_of),
    ("trajectories (TUM)", r".+\.tum", trajectory_of),
    ("maps (pbstream)", r".+\.pbstream", map_of),
    ("other arrays (npz)", r".+\.npz", arrays_of),
    ("results.json", r"results\.json", figures_of),
    ("robustness.json", r"robustness\.json", figures_of),
    ("stress.json", r"stress\.json", figures_of),
    ("evidence (map.json)", r"map\.json", figures_of),
)
SKIPPED_FOLDERS: Final = frozenset({"rows", "cells", "orb-slam3"})  # kept rows and cells are in the tables; the last is random
TOWN_KEY: Final = re.compile(r"-[0-9a-f]{12}(?=\.net\.xml)")
SPECIFICATION: Final = ("seed", "town", "drive", "camera", "odometry_rate_hz", "noise")  # keys of a recording's manifest
MAX_NAMED: Final = 5  # differing values of one file that are named


@dataclass(slots=True)
class Tally:
    """What was compared of one kind of file."""

    files: int = 0
    values: int = 0
    differing: int = 0
    new: int = 0  # values that only the second folder has
    differences: list[str] = field(default_factory=list)


def compare_folders(before: Path, after: Path) -> dict[str, Tally]:
    """Tallies by kind of file. Raises HippodromeError for a folder that holds no results."""
    ours, theirs = (_files(folder) for folder in (before, after))
    tallies = {kind: Tally() for kind, _, _ in KINDS}
    for place, path in ours.items():
        kind, reader = _kind(path)
        tallies[kind].files += 1
        if place not in theirs:
            tallies[kind].differing += 1
            tallies[kind].differences.append(f"{place}: missing in {after}")
            continue
        try:
            _compare_files(place, reader(path), reader(theirs[place]), tallies[kind])
        except (OSError, ValueError, zipfile.BadZipFile, HippodromeError) as error:
            raise HippodromeError(f"{path} and {theirs[place]}: cannot be compared: {error}") from error
    for place in theirs.keys() - ours.keys():
        tallies[_kind(theirs[place])[0]].new += 1
    return {kind: tally for kind, tally in tallies.items() if tally.files or tally.new}


def _compare_files(place: str, before: Iterable[tuple[str, Leaf]], after: Iterable[tuple[str, Leaf]], tally: Tally) -> None:
    """Every leaf of one file with its counterpart."""
    theirs = dict(after)
    found = []
    for name, leaf in before:
        tally.values += leaf.size if isinstance(leaf, np.ndarray) else 1
        if name not in theirs:
            found.append((1, f"{name} is missing"))
        elif difference := _difference(leaf, theirs.pop(name)):
            found.append((difference[0], f"{name}: {difference[1]}"))
    tally.new += len(theirs)
    tally.differing += sum(count for count, _ in found)
    tally.differences += [f"{place}: {text}" for _, text in found[:MAX_NAMED]]
    if len(found) > MAX_NAMED:
        tally.differences.append(f"{place}: and {len(found) - MAX_NAMED} more places")


def _difference(before: Leaf, after: Leaf) -> tuple[int, str] | None:
    """How many values differ, and the first of them in words; None if every bit is the same."""
    if not isinstance(before, np.ndarray) or not isinstance(after, np.ndarray):
        return None if type(before) is type(after) and repr(before) == repr(after) else (1, f"{before!r} -> {after!r}")
    if before.dtype != after.dtype or before.shape != after.shape:
        return before.size, f"{before.dtype} {before.shape} -> {after.dtype} {after.shape}"
    flat, other = (np.ascontiguousarray(array).reshape(-1) for array in (before, after))
    bits, others = (array.view(np.uint8).reshape(len(array), array.itemsize) for array in (flat, other))
    rows = np.flatnonzero((bits != others).any(axis=1))
    if not len(rows):
        return None
    first = rows[0]
    where = ", ".join(str(index) for index in np.unravel_index(first, before.shape))
    return len(rows), f"{len(rows)} of {before.size} values, first at [{where}]: {flat[first]!r} -> {other[first]!r}"


def _kind(path: Path) -> tuple[str, Reader]:
    return next((kind, reader) for kind, pattern, reader in KINDS if re.fullmatch(pattern, path.name))


def _files(root: Path) -> dict[str, Path]:
    """The files that are compared, by a place that does not depend on the code."""
    found = dict(_placed(root))
    if not found:
        raise HippodromeError(f"{root}: no results in it; give a folder that `hippodrome eval`, `stress` or `robustness` wrote")
    return found


def _placed(root: Path) -> Iterator[tuple[str, Path]]:
    for folder in sorted({path.parent for path in root.rglob("*") if path.is_file()}):
        parts = folder.relative_to(root).parts
        if SKIPPED_FOLDERS & set(parts) or any(part.startswith(".") for part in parts):
            continue
        names = {path: TOWN_KEY.sub("", path.name) for path in sorted(folder.iterdir()) if path.is_file()}
        alike = Counter(names.values())
        for path, name in names.items():
            if any(re.fullmatch(pattern, path.name) for _, pattern, _ in KINDS):
                label = path.name if alike[name] > 1 else name
                yield "/".join([*_without_key(folder, parts), label]), path


def _without_key(folder: Path, parts: tuple[str, ...]) -> tuple[str, ...]:
    """The folder's parts; a recording by its name, and where several have that name, by what was to be driven and seen too."""
    if not parts or not (folder / MANIFEST).is_file():
        return parts
    name = RECORDING_KEY.sub("", folder.name)
    alike = [other for other in folder.parent.iterdir() if RECORDING_KEY.sub("", other.name) == name]
    return (*parts[:-1], name if len(alike) == 1 else f"{name} {_specification(folder)}")


def _specification(folder: Path) -> str:
    """A short digest of what a recording was to be, without the code that made it and what came out."""
    manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    text = json.dumps({key: manifest.get(key) for key in SPECIFICATION}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:6]
