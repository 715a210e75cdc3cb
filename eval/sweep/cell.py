"""One cell of a sweep, in whatever process it runs: record what is missing, evaluate, bring back figures and samples."""

from __future__ import annotations

import fcntl
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import BaseModel, ConfigDict

from hippodrome.core.types import Trajectory
from hippodrome.eval.drive.run import drive_here
from hippodrome.eval.evaluate import EvaluationTask, evaluate_scenario
from hippodrome.eval.files.trajectories import read_tum
from hippodrome.eval.methods.materials import score_trajectory
from hippodrome.eval.methods.method import method_of
from hippodrome.eval.metrics.association import associate
from hippodrome.eval.metrics.localization import FALSE_FIX_M
from hippodrome.eval.metrics.trajectory import Score
from hippodrome.eval.results.model import Row, ScenarioResult
from hippodrome.eval.sweep.executors import SweepError
from hippodrome.eval.sweep.grid import SweepCell, cell_code_sha256
from hippodrome.sim.record import RecordingPlan, Role, close_renderer, record

ROLES: Final[tuple[Role, ...]] = ("mapping", "localization")
SHARED: Final = ("recordings", "towns")  # folders that all cells share, so that cells that drive alike drive once

_one_at_a_time = threading.Lock()  # SUMO and GL keep one state per process, and a cluster's worker may run several threads


class Samples(BaseModel):
    """The errors behind one figure."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    definition: str
    errors_m: tuple[float, ...]
    matched: int
    total: int

    def score(self) -> Score:
        """As a score that can be pooled; when each error was made is no longer known."""
        errors_m = np.array(self.errors_m)
        return Score(self.definition, errors_m, np.zeros(len(errors_m)), self.matched, self.total)


class CellResult(BaseModel):
    """What a cell came to: the figures of ``hippodrome eval``, and the samples that a merged table is made of."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    parameters: dict[str, str]
    result: ScenarioResult
    samples: dict[str, dict[str, Samples]]  # by method, then by figure: ape, rpe, rpe_20m, localization


@dataclass(frozen=True, slots=True)
class RecordingTask:
    """A drive that one or more cells need, and the code that is to make it."""

    plan: RecordingPlan
    code: str  # hash of the code of the process that hands out the tasks


@dataclass(frozen=True, slots=True)
class CellTask:
    """A cell, the sweep's folder, and the code that the results are to come from."""

    cell: SweepCell
    out: Path
    code: str  # hash of the code of the process that hands out the tasks


def roles_of(cell: SweepCell) -> tuple[Role, ...]:
    """The drives that a cell needs: missions are driven on the map of the first one."""
    return ROLES if cell.scenario.missions.count is None else ("mapping",)


def make_recording(task: RecordingTask) -> str:
    """Record one drive unless it is on disk; the recording's folder."""
    _require_same_code(task.code)
    with _one_at_a_time, _locked(task.plan):
        try:
            return str(record(task.plan).folder)
        finally:
            close_renderer()


def run_cell(task: CellTask) -> CellResult:
    """Evaluate a cell into its folder, or drive its missions, if it has some.

    A machine that does not share the sweep's folder makes the recordings that it needs.
    """
    _require_same_code(task.code)
    for role in roles_of(task.cell):
        make_recording(RecordingTask(RecordingPlan(task.cell.scenario, role, task.out), task.code))
    folder = task.out / "cells" / task.cell.key
    folder.mkdir(parents=True, exist_ok=True)
    for name in SHARED:
        _share(folder, name)
    if task.cell.scenario.missions.count is not None:
        with _one_at_a_time:
            driven = drive_here(task.cell.scenario, folder)
        return CellResult(parameters=dict(task.cell.parameters), result=driven, samples={})
    with _one_at_a_time:
        result = evaluate_scenario(EvaluationTask(task.cell.scenario, folder, figures=False))
    evidence = folder / task.cell.scenario.name
    samples = {row.method: found for row in result.rows if (found := _samples(row, evidence))}
    return CellResult(parameters=dict(task.cell.parameters), result=result, samples=samples)


def _share(folder: Path, name: str) -> None:
    """Link a folder of the sweep into a cell's. A cell whose folder was deleted while it ran has made one of its own there."""
    link = folder / name
    if not link.is_symlink():
        if link.exists():
            shutil.rmtree(link)
        link.symlink_to(Path("..", "..", name))


def _require_same_code(code: str) -> None:
    """Raise SweepError if this process, on whatever machine, runs other code than the one that hands out the tasks."""
    if cell_code_sha256() != code:
        raise SweepError(
            f"a worker runs other code ({cell_code_sha256()}) than this command ({code}); install the same on all machines"
        )


@contextmanager
def _locked(plan: RecordingPlan) -> Iterator[None]:
    """Let one process at a time make a recording; the second finds it finished. The lock of a process that dies is free."""
    folder = plan.folder()
    folder.parent.mkdir(parents=True, exist_ok=True)
    with (folder.parent / f".{folder.name}.lock").open("w") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        yield


def _samples(row: Row, evidence: Path) -> dict[str, Samples]:
    """The errors behind a row's figures, scored again from the trajectories that the evaluation left."""
    method, found = method_of(row.method, row.declaration.frame if row.declaration else None), {}
    path = evidence / f"{method.stem}.tum"
    if row.ape is not None and path.exists():
        scored = score_trajectory(read_tum(path), read_tum(evidence / "ground-truth.tum"), method.alignment)
        found = {name: _kept(score) for name, score in (("ape", scored.ape), ("rpe", scored.rpe), ("rpe_20m", scored.rpe_20m))}
    path, truth_path = evidence / f"{method.stem}-localization.tum", evidence / "localization-ground-truth.tum"
    if row.localization is not None and path.exists() and truth_path.exists():  # a drive of others may have no truth
        located = _localization(read_tum(path), read_tum(truth_path), row.localization.definition)
        found |= {"localization": located} if located is not None else {}
    return found


def _localization(declared: Trajectory, truth: Trajectory, definition: str) -> Samples | None:
    """Errors of the declared steps from the first right one on, as ``score_localization`` defines them."""
    pairs = associate(declared, truth)
    errors_m = np.hypot(*(pairs.estimate - pairs.reference)[:, :2].T)
    right = errors_m <= FALSE_FIX_M
    if not right.any():
        return None
    errors_m = errors_m[int(np.argmax(right)) :]
    return Samples(definition=definition, errors_m=tuple(errors_m.tolist()), matched=len(errors_m), total=pairs.total)


def _kept(score: Score) -> Samples:
    fields: dict[str, Any] = {name: getattr(score, name) for name in ("definition", "matched", "total")}
    return Samples(errors_m=tuple(score.errors_m.tolist()), **fields)
