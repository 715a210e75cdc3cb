"""What the result files hold, taken apart into leaves: a place in the file, and the number, text or array that stands there."""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import re
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hippodrome.eval.results.model import TIMING_FIELDS
from hippodrome.proto.codec import load_map
from hippodrome.sim.renamed import present_value

Leaf: TypeAlias = "NDArray[Any] | str | int | float | bool | None"
Reader: TypeAlias = Callable[[Path], Iterator[tuple[str, Leaf]]]

PROVENANCE: Final = frozenset({"configuration", "provenance", "versions", "code_sha256", "sha256", "manifest_sha256"})
FILE_SIZES: Final = frozenset({"map_bytes", "bytes_per_view"})  # a map's file also holds its provenance: its arrays are compared
RECORDING_KEY: Final = re.compile(r"-[0-9a-f]{16}$")  # ends a recording's name and depends on the code that made it
LEFT_OUT: Final = TIMING_FIELDS | PROVENANCE | FILE_SIZES | {"cpu_s", "rerun"}  # rerun: the command to type


def frames_of(path: Path) -> Iterator[tuple[str, Leaf]]:
    """A recording's chunk: the digest of each PNG image."""
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            yield name, hashlib.sha256(archive.read(name)).hexdigest()


def arrays_of(path: Path) -> Iterator[tuple[str, Leaf]]:
    """An npz archive: each of its arrays."""
    with np.load(path, allow_pickle=False) as archive:
        for name in archive.files:
            yield name, archive[name]


def trajectory_of(path: Path) -> Iterator[tuple[str, Leaf]]:
    """A TUM file: its numbers as one array, a row for each pose. They are printed with all digits of a double."""
    yield "poses", np.loadtxt(io.StringIO(path.read_text(encoding="utf-8")), ndmin=2)


def map_of(path: Path) -> Iterator[tuple[str, Leaf]]:
    """A cognitive map: every array and name in it, but not the provenance."""
    cognitive_map, _ = load_map(path)
    yield from _fields_of(cognitive_map, "")


def network_of(path: Path) -> Iterator[tuple[str, Leaf]]:
    """A SUMO network: the digest of its text."""
    blob = path.read_bytes()
    yield "text", hashlib.sha256(gzip.decompress(blob) if path.suffix == ".gz" else blob).hexdigest()


def figures_of(path: Path) -> Iterator[tuple[str, Leaf]]:
    """A JSON file: its figures and texts but for ``LEFT_OUT``, modes by present names, recordings without their key."""
    yield from _json_leaves(json.loads(path.read_text(encoding="utf-8")), "")


def _json_leaves(value: Any, place: str) -> Iterator[tuple[str, Leaf]]:
    if isinstance(value, dict):
        for key, item in value.items():
            if key not in LEFT_OUT:
                item = present_value("localizer.mode", item) if key == "mode" else item
                yield from _json_leaves(item, f"{place}.{key}" if place else key)
    elif isinstance(value, list):
        yield f"{place}.length", len(value)
        for index, item in enumerate(value):
            yield from _json_leaves(item, f"{place}[{index}]")
    else:
        yield place, RECORDING_KEY.sub("", value) if isinstance(value, str) else value


def _fields_of(value: Any, place: str) -> Iterator[tuple[str, Leaf]]:
    if is_dataclass(value):
        for field in fields(value):
            yield from _fields_of(getattr(value, field.name), f"{place}.{field.name}" if place else field.name)
    else:
        yield place, value if isinstance(value, np.ndarray) or value is None else repr(value)
