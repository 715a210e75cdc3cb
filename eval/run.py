"""``hippodrome eval`` and ``render``: scenarios in, ``results.json``, tables and figures out.

The work is done in rounds over one pool of processes: simulate every drive, draw every chunk of frames, evaluate every scenario
(of large towns in a second pool, since the first one's processes are full of the town).
The tasks of a round do not depend on one another, and no result depends on the number of processes.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from pathlib import Path

from hippodrome._files import write_atomically
from hippodrome._native import give_back_memory
from hippodrome.core.types import HippodromeError
from hippodrome.eval.contest.entry import Added, entries_of, with_methods
from hippodrome.eval.evaluate import EvaluationTask, evaluate_scenario
from hippodrome.eval.files.scenarios import read_scenario
from hippodrome.eval.methods.warm_up import is_compiled, warm_up
from hippodrome.eval.pool import Workers, process_pool, worker_pool
from hippodrome.eval.report.report import REPORT, write_report
from hippodrome.eval.results.model import Results, write_results
from hippodrome.eval.results.paper_rows import quoted_rows
from hippodrome.eval.results.tables import print_table_one, table_one_markdown
from hippodrome.eval.results.terminal import PlainConsole
from hippodrome.eval.results.thresholds import failed_limits
from hippodrome.sim.record import ROLES, RecordingPlan, finish, prepare, render_chunk
from hippodrome.sim.recording import CHUNK_FRAMES
from hippodrome.sim.render.probe import require_gl
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.town_file import is_large

RESULTS = "results.json"
EVALUATE = "evaluate"  # the stage after them
RECORD_STAGES = ("simulate", "render", "seal")  # of ``make_recordings``


def evaluate(
    paths: Sequence[Path], network: Path | None, seed: int | None, workers: int, out: Path, methods: Sequence[Added] = ()
) -> bool:
    """Evaluate scenarios and print their tables. Returns whether all their thresholds hold.

    Args:
        paths: Scenario files.
        network: Road network that replaces the scenarios' own.
        seed: Seed that replaces the scenarios' own.
        workers: Number of processes.
        out: Folder for all files.
        methods: Methods that take part beside ours and those that a scenario names.

    Raises:
        HippodromeError: A scenario, its network or a method cannot be used.
    """
    scenarios = load_scenarios(paths, network, seed, methods)
    return _report(scenarios, run_scenarios(scenarios, workers, out), out)


def run_scenarios(scenarios: Sequence[Scenario], workers: int, out: Path) -> Results:
    """Evaluate scenarios and write ``results.json``, tables, figures and report into ``out``. Raises HippodromeError."""
    for scenario in scenarios:
        entries_of(scenario)  # what cannot be loaded is said before anything is simulated
    require_gl()
    plans = [RecordingPlan(scenario, role, out) for scenario in scenarios for role in ROLES]
    tasks, rows = [EvaluationTask(scenario, out) for scenario in scenarios], None
    with worker_pool(workers, (*RECORD_STAGES, EVALUATE), out) as pool:
        make_recordings(plans, pool)
        if not any(scenario.town.network and is_large(scenario.town.network) for scenario in scenarios):
            rows = pool.run(EVALUATE, evaluate_scenario, tasks)
    if rows is None:  # processes that simulated and drew a large town hold as much again as the evaluation takes
        _compile_apart()
        with worker_pool(workers, (EVALUATE,), out) as pool:
            rows = pool.run(EVALUATE, evaluate_scenario, tasks)
    results = Results(scenarios=tuple(rows))
    write_results(out / RESULTS, results)
    write_atomically(out / "table1.md", table_one_markdown(results, quoted_rows()).encode())
    write_report(out)
    return results


def render(paths: Sequence[Path], network: Path | None, seed: int | None, workers: int, out: Path) -> None:
    """Make the recordings of scenarios and print where they are; arguments as for ``evaluate``. Raises HippodromeError."""
    scenarios = load_scenarios(paths, network, seed)
    require_gl()
    plans = [RecordingPlan(scenario, role, out) for scenario in scenarios for role in ROLES]
    with worker_pool(workers, RECORD_STAGES, out) as pool:
        make_recordings(plans, pool)
    for plan in plans:
        print(plan.folder())


def load_scenarios(
    paths: Sequence[Path], network: Path | None, seed: int | None, methods: Sequence[Added] = ()
) -> list[Scenario]:
    """Read scenarios, and add methods to each.

    Raises:
        HippodromeError: One cannot be used, or two have one name, as results are filed by name.
    """
    scenarios = [with_methods(read_scenario(path, network, seed), methods) for path in paths]
    name, times = Counter(scenario.name for scenario in scenarios).most_common(1)[0]
    if times > 1:
        raise HippodromeError(f"{times} scenarios are named '{name}': results are filed by name, so give each its own")
    return scenarios


def make_recordings(plans: Sequence[RecordingPlan], pool: Workers) -> None:
    """Simulate and draw the drives that are not on disk yet."""
    chunks = pool.run("simulate", _prepare, plans, place=driven_place)
    pool.run("render", _render_chunk, [(plan, chunk) for plan, missing in zip(plans, chunks, strict=True) for chunk in missing],
             weight=lambda _: CHUNK_FRAMES)  # fmt: skip
    pool.run("seal", _finish, plans)


def driven_place(plan: RecordingPlan) -> str:
    """What a drive is simulated on, in words."""
    network = plan.scenario.town.network
    return f"{network} ({plan.scenario.name})" if network is not None else f"the generated town of {plan.scenario.name}"


def _compile_apart() -> None:
    """Compile our inner loops in a process of its own, which ends: compiling leaves 450 MB behind, which the evaluation of 1,000
    km of road has no room for within a gigabyte. Where the machine code is kept already, there is nothing to do.
    """
    if is_compiled():
        return
    with suppress(BrokenProcessPool), process_pool(1) as compiler:  # if it dies, the evaluation compiles
        compiler.submit(warm_up).result()


def _prepare(plan: RecordingPlan) -> list[int]:
    """Simulate a drive; what SUMO held of a large network goes back before the town is drawn."""
    try:
        return prepare(plan)
    finally:
        give_back_memory()


def _render_chunk(task: tuple[RecordingPlan, int]) -> int:
    return render_chunk(*task)


def _finish(plan: RecordingPlan) -> None:
    finish(plan)


def _report(scenarios: Sequence[Scenario], results: Results, out: Path) -> bool:
    """Print tables, thresholds that do not hold, and where the files are. Returns whether all thresholds hold."""
    print_table_one(results, quoted_rows(), PlainConsole())
    failures = [
        f"{result.name}: {limit}"
        for scenario, result in zip(scenarios, results.scenarios, strict=True)
        for limit in failed_limits(scenario.thresholds, result)
    ]
    for failure in failures:
        print(f"threshold failed: {failure}", file=sys.stderr)
    folders = "\n         ".join(str(out / result.name) for result in results.scenarios)
    print(f"\nresults: {out / RESULTS}\ntables:  {out / 'table1.md'}\nfigures: {folders}\nreport:  {out / REPORT}")
    return not failures
