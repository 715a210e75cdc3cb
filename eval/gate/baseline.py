"""The baseline of the gate: the figures of earlier code, one row for each scenario, seed and method."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any, Final

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler, ValidationError
from pydantic_core import CoreSchema

from hippodrome._files import read_bounded, why_unreadable, write_atomically
from hippodrome._json import parse_json
from hippodrome.core.types import HippodromeError
from hippodrome.eval.results.model import (
    MAX_BYTES,
    ErrorSummary,
    Results,
    Row,
    ScenarioResult,
    drive_of,
    is_driven,
    to_json,
)
from hippodrome.eval.reuse import DRIVE_INDEPENDENT_KEYS
from hippodrome.sim.key_words import first_fault
from hippodrome.sim.limits import refuse_truth_values

FORMAT: Final = 1
LARGEST: Final = 1e12  # of a figure: farther than any planet


MISSIONS: Final = {  # figures of missions that are the better the smaller they are: name with unit, and definition
    "missed (share)": "share of the missions that did not stand within 3 m of the goal's place, on its lane, and say so",
    "1 - SPL (share)": "one less the success weighted by path length",
    "collisions at fault (times)": "collisions with vehicles that were the ego's fault, in all missions",
    "wrong way (times)": "times that the ego drove against its lane's direction, in all missions",
    "false arrivals (times)": "times that an arrival was said elsewhere than at the goal",
    "red lights (per km)": "red lights run, per driven kilometre",
    "rights of way (per km)": "rights of way taken, per driven kilometre",
    "outside the lane (%)": "share of the time with a wheel outside of the lane, or off the paving in junctions",
    "time (ratio)": "time of successful missions over that of SUMO's own driver on them, mean",
}


class GateError(HippodromeError):
    """A baseline that cannot be read, or must not be compared with."""


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        schema = handler(source)
        refuse_truth_values(schema, handler.resolve_ref_schema)
        return schema


class Figure(_Model):
    """One number, smaller is better, and the words that say what it measures."""

    value: float
    definition: str


class BaselineRow(_Model):
    """What one method made of one scenario with one seed."""

    scenario: str
    seed: int
    question: str  # hash of everything that the figures depend on except the code, see ``question_of``
    method: str
    failed: bool
    localized: bool | None  # None: the method does not localize
    figures: dict[str, Figure]

    @property
    def key(self) -> tuple[str, int, str]:
        """What tells the row from all others."""
        return self.scenario, self.seed, self.method


class Baseline(_Model):
    """The file that is committed beside the code."""

    format: int = FORMAT
    cells: tuple[BaselineRow, ...]  # the rows, under the name that the file gives them


def baseline_of(runs: list[Results]) -> Baseline:
    """The baseline that several runs make: all their rows that were measured, none that are quoted; sorted."""
    cells = [_row(result, row) for run in runs for result in run.scenarios for row in result.rows if not row.quoted]
    return Baseline(cells=tuple(sorted(cells, key=lambda cell: cell.key)))


def write_baseline(path: Path, baseline: Baseline) -> None:
    """Write the file. The same rows give the same bytes, and a changed figure changes one line."""
    write_atomically(path, to_json(baseline.model_dump(), str(path)).encode())


def read_baseline(path: Path) -> Baseline:
    """Read and validate. Raises GateError."""
    try:
        data = parse_json(read_bounded(path, MAX_BYTES))
        if isinstance(data, dict) and data.get("format") != FORMAT:
            raise GateError(
                f"{path}: baseline format {data.get('format')}, this version reads {FORMAT}; refresh it with --update"
            )
        baseline = Baseline.model_validate(data)
    except FileNotFoundError:
        raise GateError(f"{path}: no baseline there; make one with `hippodrome gate --update`") from None
    except ValidationError as error:
        cure = "name another, or make it anew with --update"
        raise GateError(f"{path}: {first_fault(error, data, Baseline)}; {cure}") from error
    except (OSError, ValueError, RecursionError) as error:  # ValueError: no JSON, no UTF-8, or a number of thousands of digits
        cure = "name another, or make it anew with --update"
        raise GateError(f"{path}: not a readable baseline: {why_unreadable(error)}; {cure}") from error
    for cell in baseline.cells:
        for name, figure in cell.figures.items():
            if not 0.0 <= figure.value <= LARGEST:  # nothing would ever be worse by a share than one below zero
                place, why = f"{cell.scenario}, seed {cell.seed}, {cell.method}", "which no error is"
                raise GateError(f"{path}: {place}: {name} is {figure.value:g}, {why}; make it anew with --update")
    return baseline


def question_of(result: ScenarioResult) -> str:
    """Hash of what the methods are asked: town, drives, camera and noise, and how many frames came of them.

    Constants of the algorithms are not in it: a change there is what the gate is for. Figures of different questions must not be
    compared.
    """
    configuration: dict[str, Any] = getattr(result, "configuration", None) or {}
    asked = {key: value for key, value in configuration.items() if key not in DRIVE_INDEPENDENT_KEYS}
    driven = [result.network.edges, round(result.network.km, 3), result.frames]  # a file's name does not say what is in it
    if is_driven(result):  # how many missions are asked for is a question, of an evaluation it is none
        driven.append(configuration.get("missions", {}).get("count"))
    return hashlib.sha256(json.dumps([asked, driven], sort_keys=True).encode()).hexdigest()[:16]


def _row(result: ScenarioResult, row: Row) -> BaselineRow:
    return BaselineRow(
        scenario=result.name,
        seed=result.seed,
        question=question_of(result),
        method=row.method,
        failed=row.failure is not None,
        localized=row.localization.success if row.localization is not None else None,
        figures=_figures(row),
    )


def _figures(row: Row) -> dict[str, Figure]:
    if (drive := drive_of(row)) is not None:
        return mission_figures(drive)
    errors: dict[str, ErrorSummary | None] = {"APE": row.ape, "RPE": row.rpe}
    figures = {
        f"{name} mean (m)": Figure(value=error.mean_m, definition=error.definition)
        for name, error in errors.items()
        if error is not None
    }
    located = row.localization
    if located is not None and located.error_mean_m is not None:
        figures["localization error mean (m)"] = Figure(value=located.error_mean_m, definition=located.definition)
    return figures


def mission_figures(drive: dict[str, Any]) -> dict[str, Figure]:
    """What the gate compares of a row's missions; a figure that a row has not, such as the time of no success, is left out."""
    km = max(drive["driven_km"], 1e-3)
    values = (
        1.0 - drive["success_rate"], 1.0 - drive["spl"], drive["collisions_at_fault"], drive["wrong_way"],
        drive["false_arrivals"], drive["red_lights"] / km, drive["rights_of_way"] / km, 100.0 * drive["outside_lane_share"],
        drive["time_ratio"],
    )  # fmt: skip
    named = zip(MISSIONS.items(), values, strict=True)
    return {name: Figure(value=float(value), definition=definition) for (name, definition), value in named if value is not None}
