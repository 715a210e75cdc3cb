"""``hippodrome stress``: the refinement with an unknown start, from real frames, under errors it may meet, over towns and seeds.

Every case starts from the same recorded frames of a town and seed and changes one thing: the self-motion (sensed anew), the loop
closures (false ones added), or the road network (displaced, with driven roads missing, or another town's). Cases of the same
self-motion share one map. Each row is kept as soon as it is known, and can be rerun alone by its scenario, seed and case.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from hippodrome._files import write_atomically
from hippodrome.eval.contest.entry import Added, Entry, as_option, entries_of, with_methods
from hippodrome.eval.contest.sources import methods_sha256
from hippodrome.eval.contest.trials import added_methods
from hippodrome.eval.figures.stress import draw_stress
from hippodrome.eval.files.scenarios import read_scenario
from hippodrome.eval.pool import worker_pool
from hippodrome.eval.report.pages import write_trial_page
from hippodrome.eval.results.kept import read_kept
from hippodrome.eval.results.model import to_json
from hippodrome.eval.reuse import figure_code_sha256
from hippodrome.eval.run import RECORD_STAGES, make_recordings
from hippodrome.eval.trials.stress.cases import StressCase, chosen_cases, in_self_similar_grid
from hippodrome.eval.trials.stress.rows import StressRow
from hippodrome.eval.trials.stress.table import stress_markdown
from hippodrome.eval.trials.stress.trial import StressedDrive, run_case, run_method
from hippodrome.sim.record import RecordingPlan, finish
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.self_motion import NoiseLevel, at_level


@dataclass(frozen=True, slots=True)
class StressTask:
    """All cases that share the recording of one scenario."""

    scenario: Scenario
    cases: tuple[StressCase, ...]
    out: Path
    path: Path  # the scenario's file, for the command that reruns a row
    added: frozenset[str] = frozenset()  # names of the methods that are not in that file, for the command as well

    def plan(self) -> RecordingPlan:
        """The mapping drive that all cases start from."""
        return RecordingPlan(self.scenario, "mapping", self.out)

    def rerun(self, case: StressCase, method: str = "") -> str:
        """The command that runs one case alone, and the method ``method`` in it, if that is not in the scenario's file."""
        command = f"hippodrome stress {self.path} --seeds {self.scenario.seed} --case '{case.name}'"
        return f"{command} {as_option(method, self.scenario.methods[method])}" if method in self.added else command

    def row_file(self, case: StressCase, method: str = "") -> Path:
        """Where the case's row is kept: a name made of all that the row depends on."""
        code = figure_code_sha256("eval/trials/stress/*.py")
        whole = [self.plan().folder().name, self.scenario.model_dump_json(exclude={"town"}), asdict(case), code]
        text = json.dumps([*whole, method, *methods_sha256(self.scenario)] if method else whole)
        return self.out / "rows" / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.json"


def stress(
    paths: Sequence[Path],
    seeds: Sequence[int],
    names: Sequence[str],
    workers: int,
    out: Path,
    methods: Sequence[Added] = (),
) -> None:
    """Run cases over scenarios x seeds; write ``stress.json``, ``.md``, ``.png`` and ``.html``, and print the table.

    Args:
        paths: The scenarios' files.
        seeds: Seeds that replace the scenarios' own, one run each.
        names: Names of the cases to run; none: all of them.
        workers: How many processes to use.
        out: Folder for the results, the recordings and the rows kept for the next run.
        methods: Methods that take part beside those that the scenarios name.

    Raises:
        HippodromeError: A scenario cannot be used, or there is no case of a name.
    """
    cases = chosen_cases(names)
    tasks = [task for path in paths for seed in seeds for task in _tasks(path, seed, cases, out, path == paths[0], methods)]
    for scenario in {task.scenario.name: task.scenario for task in tasks}.values():
        _say_left_out(scenario)
    with worker_pool(workers, (*RECORD_STAGES, "refine"), out) as pool:
        make_recordings([task.plan() for task in tasks], pool)
        rows = [row for part in pool.run("refine", run_cases, tasks, weight=lambda task: len(task.cases)) for row in part]
    rows.sort(key=lambda row: (row.method != "", row.method, [case.name for case in cases].index(row.case)))
    write_atomically(
        out / "stress.json", to_json({"cases": [asdict(case) for case in cases], "rows": [asdict(row) for row in rows]}).encode()
    )
    text = stress_markdown(rows)
    write_atomically(out / "stress.md", text.encode())
    ours = [row for row in rows if not row.method]
    draw_stress(out / "stress.png", {case.name: [row.ape_mean_m for row in ours if row.case == case.name] for case in cases})
    write_trial_page(out / "stress.html", "Refinement under stress", text, [out / "stress.png"], "hippodrome stress")
    print(f"{text}\n{out / 'stress.json'}, {out / 'stress.md'}, {out / 'stress.png'}, {out / 'stress.html'}")


def run_cases(task: StressTask) -> list[StressRow]:
    """Every case of one recording; the rows of an earlier run of the same code are read back."""
    drive, rows = _drive(task), {}
    for case in task.cases:
        file = task.row_file(case)
        if not file.exists():
            row = run_case(case, drive, task.rerun(case))
            write_atomically(file, to_json(asdict(row)).encode())
        rows[case.name] = _kept_row(file)
    return [*rows.values(), *_rows_of_methods(task, drive)]


def _rows_of_methods(task: StressTask, drive: StressedDrive) -> list[StressRow]:
    """Every case that applies to methods beside ours, of each that maps and answers in the network's frame."""
    rows = []
    for entry in applicable(task.scenario):
        label = entry.method.label
        for case in (one for one in task.cases if not one.ours_alone):
            file = task.row_file(case, label)
            if not file.exists():
                row = run_method(case, drive, entry, task.rerun(case, label))
                write_atomically(file, to_json(asdict(row)).encode())
            rows.append(_kept_row(file))
    return rows


def _kept_row(file: Path) -> StressRow:
    """A row that this run or an earlier one left. Raises ResultsError."""
    row: StressRow = read_kept(file, StressRow, "not the row of a case", "delete it, and the same command makes it anew")
    return row


def applicable(scenario: Scenario) -> list[Entry]:
    """The methods beside ours that errors in self-motion and roads are put to: those that answer in the network's frame."""
    return [entry for entry in added_methods(scenario, "map") if entry.method.frame == "network"]


def _say_left_out(scenario: Scenario) -> None:
    """Name the methods that no case is put to, and why."""
    taken = [entry.method.key for entry in applicable(scenario)]
    for entry in entries_of(scenario):
        if entry.source != "hippodrome" and entry.method.key not in taken:
            why = (
                "it makes no map" if "map" not in entry.does else f"it answers in frame '{entry.method.frame}', not the network's"
            )
            print(f"{scenario.name}: {entry.method.label}: left out: {why}", flush=True)


def _drive(task: StressTask) -> StressedDrive:
    return StressedDrive(task.scenario, finish(task.plan()), task.plan().town(), task.out / "towns")


def _tasks(
    path: Path, seed: int, cases: Sequence[StressCase], out: Path, with_grid: bool, methods: Sequence[Added] = ()
) -> list[StressTask]:
    """Cases grouped by the drive that they need: the lateral wander of a noise level makes another one, and so does the
    self-similar grid, which is run with the first scenario only (``with_grid``).
    """
    read = read_scenario(path, seed=seed)
    scenario = with_methods(read, methods)
    added = frozenset(scenario.methods) - frozenset(read.methods)
    groups: dict[tuple[NoiseLevel, bool], list[StressCase]] = {}
    for case in cases:
        if with_grid or not case.self_similar:
            groups.setdefault((case.noise, case.self_similar), []).append(case)
    return [
        StressTask(
            (in_self_similar_grid(scenario, out) if grid else scenario).model_copy(
                update={"noise": at_level(level, scenario.noise)}
            ),
            tuple(group),
            out,
            path,
            added,
        )
        for (level, grid), group in groups.items()
    ]
