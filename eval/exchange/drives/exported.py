"""What there is to export: drives with their frames, trajectories, maps and roads, gathered from a folder of results."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Literal

import numpy as np

from hippodrome._files import sha256_of
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, Trajectory
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.files.trajectories import read_tum
from hippodrome.eval.methods.method import method_of
from hippodrome.eval.methods.stages import dead_reckoning
from hippodrome.eval.results.model import read_results
from hippodrome.proto.codec import load_map
from hippodrome.sim.network import read_network
from hippodrome.sim.recording import MANIFEST, Recording, open_recording

TRUTH = {"mapping": "ground-truth", "localization": "localization-ground-truth"}  # stem of the truth's file, by drive
LOCALIZED = "-localization"  # end of the stems of estimates that belong to the localization drive
DEAD_RECKONING = "dead-reckoning"
CELLS = "cells"  # the folder of a sweep that has those of its cells
LATEST_S = 4e9  # seconds since 1970 beyond which a clock's stamps do not fit into those of ROS


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """A method's trajectory."""

    trajectory: Trajectory
    frame: Literal["network", "own"]  # network: metres in the road network's frame; own: map units from its own start


@dataclass(frozen=True, slots=True, eq=False)
class ExportedDrive:
    """One drive and everything that is known of it."""

    name: str
    recording: Recording
    truth: Trajectory | None  # None: the drive was imported without truth
    estimates: dict[str, Estimate]  # by method
    maps: dict[str, CognitiveMap]  # by the stem of the map's file
    network: RoadNetwork | None  # None: its file was not found
    network_file: Path | None = None
    # Of the drive that the maps were made on, where that is another one, and they were finished before this one began.
    map_truth: Trajectory | None = None
    maps_finished: bool = False

    def origin_ns(self) -> int:
        """When the recording's clock begins in that of its source, whole nanoseconds; 0 of ours, and where that is no stamp."""
        imported = self.recording.manifest.get("imported")
        value = imported.get("time_origin_s", 0.0) if isinstance(imported, dict) else 0.0
        plausible = isinstance(value, int | float) and 0.0 < value < LATEST_S
        return round(value * 1e9) if plausible else 0


def gather_drives(folder: Path, network: Path | None) -> list[ExportedDrive]:
    """The drives of a recording, of a scenario's results, of a whole run or of a sweep.

    Args:
        folder: The folder of one of these.
        network: The road network's file; None: it is looked for beside the results.

    Raises:
        HippodromeError: The folder is none of these, or something in it cannot be read.
    """
    if (folder / MANIFEST).exists():
        recording = open_recording(folder)
        return [_drive(folder.name, recording, {}, {}, network or _network_file(recording, folder.parent.parent))]
    if (folder / CELLS).is_dir():
        return [
            replace(drive, name=f"{cell.name}-{drive.name}")
            for cell in sorted(_folders(folder / CELLS))
            for drive in _drives_below(cell, network)
        ]
    return _drives_below(folder, network)


def _drives_below(folder: Path, network: Path | None) -> list[ExportedDrive]:
    """The drives of a scenario's results or of a whole run. Raises HippodromeError if it is neither."""
    scenarios = [folder] if _is_scenario(folder) else sorted(path for path in _folders(folder) if _is_scenario(path))
    if not scenarios:
        raise ExchangeError(
            f"{folder}: neither a recording ({MANIFEST}) nor results ({TRUTH['mapping']}.tum); give DIR of `hippodrome eval`"
        )
    return [drive for scenario in scenarios for drive in _scenario_drives(scenario, network)]


def truth_of(recording: Recording) -> Trajectory | None:
    """The true poses where they are known; None if nowhere. An imported drive may have them for a part."""
    truth = recording.ground_truth()
    known = np.isfinite(truth.poses).all(axis=1)
    return Trajectory(truth.t_s[known], truth.poses[known]) if known.any() else None


def _scenario_drives(folder: Path, network: Path | None) -> Iterator[ExportedDrive]:
    """The mapping and the localization drive of one scenario. Raises ExchangeError if the recording of one of them is gone."""
    root = folder.parent
    estimates = {path.stem: read_tum(path) for path in sorted(folder.glob("*.tum"))}
    declared = _declared_frames(folder)
    maps = {path.stem: load_map(path)[0] for path in sorted(folder.glob("*.pbstream"))}
    for role, reference in TRUTH.items():
        if (truth := estimates.get(reference)) is None:
            continue
        recording = _recording_of(truth, root, f"{folder.name}-{role}-*")
        mine = {name: value for name, value in estimates.items() if _role_of(name) == role and name not in TRUTH.values()}
        name, roads = f"{folder.name}-{role}", network or _network_file(recording, root)
        drive = _drive(name, recording, mine, maps, roads, declared)
        if role == "localization":
            drive = replace(drive, map_truth=estimates.get(TRUTH["mapping"]), maps_finished=True)
        yield drive


def _drive(
    name: str,
    recording: Recording,
    found: dict[str, Trajectory],
    maps: dict[str, CognitiveMap],
    network: Path | None,
    declared: Mapping[str, str] = MappingProxyType({}),
) -> ExportedDrive:
    estimates = {method: Estimate(trajectory, _frame_of(method, declared)) for method, trajectory in found.items()}
    if DEAD_RECKONING not in estimates:
        estimates[DEAD_RECKONING] = Estimate(dead_reckoning(recording.self_motion())[0], "own")
    roads = read_network(network) if network is not None else None
    return ExportedDrive(name, recording, truth_of(recording), estimates, maps, roads, network)


def _frame_of(method: str, declared: Mapping[str, str]) -> Literal["network", "own"]:
    """Refinement and localization answer in the network's frame, as do methods that say so; others in a frame of their own."""
    frame = declared.get(method) or method_of(method).frame
    return (
        "network" if frame == "network" or (method.endswith(LOCALIZED) and method.removesuffix(LOCALIZED) in declared) else "own"
    )


def _declared_frames(folder: Path) -> dict[str, str]:
    """The frame that each method of a scenario's results declares, by the stem of its files; empty without such results."""
    path = folder.parent / "results.json"
    if not path.is_file():
        return {}
    rows = [row for scenario in read_results(path).scenarios if scenario.name == folder.name for row in scenario.rows]
    return {method_of(row.method).stem: row.declaration.frame for row in rows if row.declaration is not None}


def _role_of(stem: str) -> str:
    return "localization" if stem.endswith(LOCALIZED) or stem == TRUTH["localization"] else "mapping"


def _recording_of(truth: Trajectory, root: Path, pattern: str) -> Recording:
    """The recording that was evaluated: of several with the same name, the one with the same truth."""
    for path in sorted((root / "recordings").glob(pattern)):
        if (path / MANIFEST).exists():
            recording = open_recording(path)
            samples = recording.samples
            if np.array_equal(samples.t_s, truth.t_s) and np.array_equal(samples.poses_m[:, :2], truth.poses[:, :2]):
                return recording
    raise ExchangeError(f"{root / 'recordings' / pattern}: no finished recording of this drive; run `hippodrome render` for it")


def _network_file(recording: Recording, root: Path) -> Path | None:
    """The network that was driven, found by its content below ``root``; None where it lies elsewhere."""
    wanted = recording.manifest.get("network_sha256")
    return next((path for path in sorted((root / "towns").glob("*.net.xml*")) if sha256_of(path) == wanted), None)


def _is_scenario(folder: Path) -> bool:
    return (folder / f"{TRUTH['mapping']}.tum").exists()


def _folders(folder: Path) -> list[Path]:
    try:
        return [path for path in folder.iterdir() if path.is_dir()]
    except OSError as error:
        raise ExchangeError(
            f"{folder}: cannot be read: {error.strerror}; name the folder of a recording, or DIR of `hippodrome eval`"
        ) from None
