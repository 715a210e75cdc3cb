"""``hippodrome sweep``: a grid of cells, run anywhere, resumed where it stopped, merged from samples."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from hippodrome._files import read_bounded, why_unreadable, write_atomically
from hippodrome._json import parse_json
from hippodrome.eval.contest.entry import Added
from hippodrome.eval.pool import progress_bar
from hippodrome.eval.report.pages import write_trial_page
from hippodrome.eval.results.model import MAX_BYTES, Results, to_json, write_results
from hippodrome.eval.reuse import DRIVE_INDEPENDENT_KEYS
from hippodrome.eval.sweep.cell import CellResult, CellTask, RecordingTask, make_recording, roles_of, run_cell
from hippodrome.eval.sweep.executors import Failure, Runner, SweepError, dask_cluster, local_processes
from hippodrome.eval.sweep.grid import Parameter, SweepCell, cell_code_sha256, make_grid
from hippodrome.eval.sweep.table import pooled_rows, sweep_markdown
from hippodrome.sim.key_words import first_fault
from hippodrome.sim.record import RecordingPlan
from hippodrome.sim.render.probe import require_gl

RESULTS, TABLE, PAGE, CELL = "results.json", "table.md", "sweep.html", "cell.json"


def sweep(
    paths: Sequence[Path],
    seeds: Sequence[int] | None,
    parameters: Sequence[Parameter],
    workers: int,
    scheduler: str | None,
    out: Path,
    methods: Sequence[Added] = (),
) -> bool:
    """Run the cells that are not finished, then merge all; whether every cell has a result.

    Args:
        paths: The scenarios' files.
        seeds: Seeds that replace the scenarios' own; None: their own.
        parameters: Keys and the values that they take in turn.
        workers: How many processes of this machine to use.
        scheduler: Address of a Dask cluster's scheduler to run on instead; None: run here.
        out: Folder for the merged results, the cells, and the recordings that they share.
        methods: Methods that take part beside ours and those that a scenario names.

    Raises:
        HippodromeError: Bad input, or nobody answers at the scheduler's address.
    """
    out = out.resolve()  # a cluster's workers have a working directory of their own
    cells = make_grid(paths, seeds, parameters, methods)
    if scheduler is None:
        require_gl()
    executors = dask_cluster(scheduler) if scheduler else local_processes(workers)
    finished = {cell: result for cell in cells if (result := _finished(cell, out)) is not None}
    kept, failures = len(finished), dict[SweepCell, str]()

    def ended(task: CellTask, result: CellResult | Failure) -> None:
        if isinstance(result, Failure):
            failures[task.cell] = result.cause
            return
        write_atomically(_path(task.cell, out), to_json(result.model_dump(mode="python")).encode())
        finished[task.cell] = result

    waiting = [cell for cell in cells if cell not in finished]
    with progress_bar() as progress:
        runner = Runner(executors, progress)
        runner.run("record", make_recording, _recordings(waiting, out), _let_pass)
        tasks = [CellTask(cell, out, cell_code_sha256()) for cell in waiting]
        runner.run("cells", run_cell, tasks, ended)
    _merge(cells, {cell: _read(_path(cell, out)) for cell in cells if cell in finished}, failures, out)
    print(f"{len(cells)} cell(s): {kept} kept, {len(finished) - kept} run, {len(failures)} failed\n"
          f"results: {out / RESULTS}\ntable:   {out / TABLE}\npage:    {out / PAGE}")  # fmt: skip
    for cell, cause in failures.items():
        print(f"failed: {cell.name}: {cause}")
    return not failures


def _recordings(cells: Sequence[SweepCell], out: Path) -> list[RecordingTask]:
    """One task for each drive, however many cells it serves."""
    plans = dict.fromkeys(RecordingPlan(_driven(cell), role, out) for cell in cells for role in roles_of(cell))
    return [RecordingTask(plan, cell_code_sha256()) for plan in plans]


def _driven(cell: SweepCell) -> Any:
    """The scenario with defaults for all that no drive depends on: cells that differ only in these share their recordings."""
    fields = type(cell.scenario).model_fields
    defaults = {name: fields[name].get_default(call_default_factory=True) for name in DRIVE_INDEPENDENT_KEYS}
    return cell.scenario.model_copy(update=defaults)


def _let_pass(_: RecordingTask, __: str | Failure) -> None:
    """A drive that cannot be made fails again, with its cause, in each cell that needs it."""


def _path(cell: SweepCell, out: Path) -> Path:
    return out / "cells" / cell.key / CELL


def _finished(cell: SweepCell, out: Path) -> CellResult | None:
    return _read(_path(cell, out)) if _path(cell, out).exists() else None


def _read(path: Path) -> CellResult:
    try:
        return CellResult.model_validate(parse_json(read_bounded(path, MAX_BYTES)))
    except ValidationError as error:
        raise SweepError(f"{path}: not a cell's result: {first_fault(error, None)}; delete it to run the cell again") from None
    except (OSError, ValueError, RecursionError) as error:  # ValueError: no JSON, no UTF-8
        raise SweepError(f"{path}: not a cell's result: {why_unreadable(error)}; delete it to run the cell again") from None


def _merge(cells: Sequence[SweepCell], finished: dict[SweepCell, CellResult], failures: dict[SweepCell, str], out: Path) -> None:
    """``results.json`` as of ``hippodrome eval``, each scenario named with its setting; the pooled table and its page."""
    rows = pooled_rows(finished)
    scenarios = tuple(_named(cell, finished[cell]) for cell in cells if cell in finished)
    failed = [(cell.name, failures[cell]) for cell in cells if cell in failures]
    extra: dict[str, Any] = {"pooled": rows, "failures": [{"cell": name, "cause": cause} for name, cause in failed]}
    write_results(out / RESULTS, Results(scenarios=scenarios, **extra))
    text = sweep_markdown(rows, failed)
    write_atomically(out / TABLE, text.encode())
    write_trial_page(out / PAGE, "Sweep", text, command="hippodrome sweep")


def _named(cell: SweepCell, found: CellResult) -> Any:
    """The cell's result, named with its setting."""
    name = f"{found.result.name} ({cell.label})" if cell.parameters else found.result.name
    return found.result.model_copy(update={"name": name, "parameters": found.parameters})
