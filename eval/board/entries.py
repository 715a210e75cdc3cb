"""Results of any number of folders sorted into cells: one for each method, drive and definition, over its seeds and runs."""

from __future__ import annotations

import hashlib
import json
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from hippodrome.core.types import HippodromeError
from hippodrome.eval.results.model import Results, Row, ScenarioResult, read_results, to_json
from hippodrome.eval.reuse import DRIVE_INDEPENDENT_KEYS

RESULTS: Final = "results.json"
HASH: Final = 12  # letters of a hash that are shown


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of which the board has a table."""

    key: str
    title: str
    of: Callable[[Row], tuple[str, float] | None]  # definition and value; None: the row has none


def _error(name: str) -> Callable[[Row], tuple[str, float] | None]:
    def of(row: Row) -> tuple[str, float] | None:
        found = getattr(row, name)
        return None if found is None else (found.definition, found.mean_m)

    return of


def _localization(row: Row) -> tuple[str, float] | None:
    found = row.localization
    return None if found is None or found.error_mean_m is None else (found.definition, found.error_mean_m)


def _cpu(row: Row) -> tuple[str, float] | None:
    return None if row.cpu_percent is None else ("CPU time of the method over the drive's duration, %", row.cpu_percent)


FIGURES: Final = (
    Figure("ape", "APE as it lies (m)", _error("ape")),
    Figure("ape_sim2", "APE after Sim(2) (m)", _error("ape_sim2")),
    Figure("rpe", "RPE (m)", _error("rpe")),
    Figure("localization", "Localization error (m)", _localization),
    Figure("cpu", "CPU (%)", _cpu),
)


@dataclass(frozen=True, slots=True)
class Drive:
    """A scenario as it was driven, whatever its seed: two of one name that ask different things are two drives."""

    name: str
    asked: str  # hash of town, drives, camera and noise


@dataclass(slots=True)
class Cell:
    """What one method made of one drive, under one definition."""

    values: list[float] = field(default_factory=list)
    seeds: list[int] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    refusals: list[str] = field(default_factory=list)
    sources: list[str] = field(default_factory=list)  # folder and hash of what each value was made from
    command: str = ""  # that makes the first of them again


@dataclass(frozen=True, slots=True)
class Table:
    """One figure: a line for each method and definition, a column for each drive."""

    figure: Figure
    drives: tuple[Drive, ...]
    lines: dict[tuple[str, str], dict[Drive, Cell]]  # by method and definition


def read_folders(folders: Sequence[Path]) -> list[tuple[Path, Results]]:
    """The results in these folders. Raises HippodromeError if there are none in one of them."""
    found = []
    for folder in folders:
        path = folder / RESULTS if folder.is_dir() else folder
        if not path.is_file():
            raise HippodromeError(f"{folder}: no {RESULTS} there; give DIR of `hippodrome eval`, `sweep` or `baselines`")
        found.append((path.parent, read_results(path)))
    return found


def tables(found: Sequence[tuple[Path, Results]]) -> list[Table]:
    """One table for each figure that at least one row has."""
    rows = [(folder, scenario, row) for folder, results in found for scenario in results.scenarios for row in scenario.rows]
    drives = tuple(sorted({drive_of(scenario) for _, scenario, _ in rows}, key=lambda drive: (drive.name, drive.asked)))
    made = [_table(figure, drives, [one for one in rows if not one[2].quoted]) for figure in FIGURES]
    return [table for table in made if any(cell.values for line in table.lines.values() for cell in line.values())]


def drive_of(scenario: ScenarioResult) -> Drive:
    """The drive of a result, without its seed."""
    configuration: dict[str, Any] = getattr(scenario, "configuration", None) or {}
    asked = {key: value for key, value in configuration.items() if key not in (*DRIVE_INDEPENDENT_KEYS, "seed")}
    text = json.dumps([asked, getattr(scenario, "parameters", None)], sort_keys=True, default=str)
    return Drive(scenario.name, hashlib.sha256(text.encode()).hexdigest()[:HASH])


def _table(figure: Figure, drives: tuple[Drive, ...], rows: Sequence[tuple[Path, ScenarioResult, Row]]) -> Table:
    lines: dict[tuple[str, str], dict[Drive, Cell]] = {}
    known: dict[str, str] = {}  # a definition of each method, for rows that failed and have none
    for _, _, row in rows:
        if (measured := figure.of(row)) is not None:
            known.setdefault(row.method, measured[0])
    for folder, scenario, row in rows:
        measured = figure.of(row)
        if measured is None and (row.failure is None or row.method not in known):
            continue
        definition = measured[0] if measured is not None else known[row.method]
        cell = lines.setdefault((row.method, definition), {}).setdefault(drive_of(scenario), Cell())
        if measured is not None:
            cell.values.append(measured[1])
            cell.seeds.append(scenario.seed)
        if row.failure is not None:
            cell.failures.append(row.failure)
        if row.refused is not None:
            cell.refusals.append(row.refused)
        cell.sources.append(f"{folder.name}/{RESULTS}, seed {scenario.seed}, sha256 {_sha256(scenario)}")
        cell.command = cell.command or shlex.join(["hippodrome", "eval", f"{folder}/{scenario.name}/scenario.json"])
    order = list(dict.fromkeys(row.method for _, _, row in rows))[::-1]  # what a run is about first, as in the report
    return Table(figure, drives, dict(sorted(lines.items(), key=lambda line: (order.index(line[0][0]), line[0][1]))))


def _sha256(scenario: ScenarioResult) -> str:
    return hashlib.sha256(to_json(scenario.model_dump(mode="python")).encode()).hexdigest()[:HASH]
