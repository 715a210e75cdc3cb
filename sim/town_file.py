"""Large towns as they were read, on disk beside what is made of them: each process of a command needs the town, and ``sumolib``
takes seconds and hundreds of megabytes for a network of 1,000 km."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import fields
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np

from hippodrome._files import PACKAGE, code_sha256, sha256_of
from hippodrome._json import parse_json
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray
from hippodrome.sim.array_file import read_arrays, write_arrays
from hippodrome.sim.types import Town

LARGE_BYTES: Final = 8_000_000  # of a network's file: some 200 km; what is smaller is read within a second or two
LARGE_PACKED_BYTES: Final = 800_000  # the same, packed
KEPT: Final = "kept"  # the folder of kept towns, which nobody else locks: the one it lies in may be held by the command itself
CODE: Final = ("sim/**/*.py", "core/roads/*.py")  # that a town depends on
OUTLINES: Final = ("junction_polygons_m", "other_lanes_m", "turning_places_m")  # parts of a town that are many arrays (n, 2)
WORDS: Final = ("lane_ids", "edge_ids")  # parts of its network that are names
NUMBERS: Final = tuple(field.name for field in fields(RoadNetwork) if field.name not in WORDS)


def is_large(net_file: Path) -> bool:
    """Whether a network's file is so large that its town is kept; one that is not there is not, and who reads it says so."""
    most_bytes = LARGE_PACKED_BYTES if net_file.suffix == ".gz" else LARGE_BYTES
    return net_file.is_file() and net_file.stat().st_size > most_bytes


def kept_town(net_file: Path, folder: Path, read: Callable[[], Town]) -> Town:
    """The town of a network. A large one is read and checked once, by one process, and then kept in ``folder``.

    Args:
        net_file: The network.
        folder: Below it the town is kept, under a name that the network's bytes and our code give.
        read: Reads and checks the network.
    """
    if not is_large(net_file):
        return read()
    folder = folder / KEPT
    recipe = sha256_of(net_file), net_file.name, code_sha256(PACKAGE, CODE), version("eclipse-sumo")
    path = folder / f"{net_file.name.partition('.')[0]}-{hashlib.sha256(repr(recipe).encode()).hexdigest()[:12]}.town.npz"
    folder.mkdir(parents=True, exist_ok=True)
    with _one_at_a_time(folder):
        town = town_from_file(path, net_file)
        if town is None:
            town = read()
            write_town(path, town)
    return town


@contextmanager
def _one_at_a_time(folder: Path) -> Iterator[None]:
    """Within the block no other process is within it for the same folder; where there are no locks, all are."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def write_town(path: Path, town: Town) -> None:
    """A town on disk, whole or not at all."""
    write_arrays(path, _arrays(town, path.name))


def _arrays(town: Town, file_name: str) -> dict[str, Any]:
    """A town as arrays of numbers; its words are JSON, and hold the name of the file, which says what the town was made of."""
    network = town.network
    words: dict[str, Any] = {"name": town.name, "notes": town.notes, "left_hand": town.left_hand, "rural": town.rural,
             "lane_ids": network.lane_ids, "edge_ids": network.edge_ids}  # fmt: skip
    arrays: dict[str, Any] = {"signals_m": town.signals_m}
    arrays |= {f"network_{name}": np.asarray(getattr(network, name)) for name in NUMBERS}
    for name in OUTLINES:
        arrays |= _joined(name, getattr(town, name), (0, 2))
    if town.heights_m is not None and town.junction_heights_m is not None:
        arrays |= {"heights_m": town.heights_m, **_joined("junction_heights_m", town.junction_heights_m, (0,))}
    words |= {"file": file_name, "sha256": _digest(arrays)}
    return arrays | {"words": np.frombuffer(json.dumps(words).encode(), dtype=np.uint8)}


def _digest(arrays: dict[str, Any]) -> str:
    """A hash of all arrays but the words."""
    digest = hashlib.sha256()
    for name in sorted(arrays.keys() - {"words"}):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape} ".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def town_from_file(path: Path, net_file: Path) -> Town | None:
    """The town that was kept; None if there is none, or none that is whole."""
    joined = [name for part in OUTLINES for name in (part, f"{part}_ends")]
    wanted = ["words", "signals_m", *joined, *(f"network_{name}" for name in NUMBERS)]
    try:
        arrays = read_arrays(path, wanted, ["heights_m", "junction_heights_m", "junction_heights_m_ends"])
        words = parse_json(arrays["words"].tobytes())
        if (words["file"], words["sha256"]) != (path.name, _digest(arrays)):
            return None  # another network's, or changed
        numbers: dict[str, Any] = {name: arrays[f"network_{name}"] for name in NUMBERS}
        numbers["survey_sigma_m"] = float(numbers["survey_sigma_m"])
        names: dict[str, Any] = {name: tuple(words[name]) for name in WORDS}
        outlines: dict[str, Any] = {name: _parted(arrays, name) for name in OUTLINES}
        high = "heights_m" in arrays
        return Town(
            name=words["name"],
            net_file=net_file,
            network=RoadNetwork(**names, **numbers),
            signals_m=arrays["signals_m"],
            left_hand=words["left_hand"],
            notes=tuple(words["notes"]),
            rural=words["rural"],
            **outlines,
            heights_m=arrays["heights_m"] if high else None,
            junction_heights_m=_parted(arrays, "junction_heights_m") if high else None,
        )
    except Exception:  # NumPy, zipfile and json have many; what cannot be read is made anew
        return None


def _joined(name: str, parts: Sequence[FloatArray], empty: tuple[int, ...]) -> dict[str, Any]:
    """Many arrays as one, and where each ends."""
    return {
        name: np.concatenate([np.empty(empty), *parts]),
        f"{name}_ends": np.cumsum([len(part) for part in parts], dtype=np.int64),
    }


def _parted(arrays: dict[str, Any], name: str) -> tuple[FloatArray, ...]:
    ends = arrays[f"{name}_ends"]
    return tuple(np.split(arrays[name], ends[:-1])) if len(ends) else ()
