"""``hippodrome baselines``: Tables I and II with binocular ORB-SLAM3 beside the rest on the same drives, and the figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hippodrome._files import write_atomically
from hippodrome.eval.contest.entry import Added
from hippodrome.eval.contest.trials import localize_added
from hippodrome.eval.methods.materials import gather
from hippodrome.eval.pool import Workers, worker_pool
from hippodrome.eval.report.report import REPORT, write_report
from hippodrome.eval.results.model import Results, Row, ScenarioResult, read_results, to_json, write_results
from hippodrome.eval.results.paper_rows import SEQUENCE_LENGTH_M, quoted_rows
from hippodrome.eval.results.ratios import RATIOS, ratio_lines, ratios
from hippodrome.eval.results.table_two import LocalizedSequence, write_table_two
from hippodrome.eval.results.tables import failed_runs, print_table_one, table_one_markdown
from hippodrome.eval.results.terminal import PlainConsole
from hippodrome.eval.rivals.memory import with_peak_rss
from hippodrome.eval.rivals.sequences import localize_sequences
from hippodrome.eval.run import RESULTS, evaluate, load_scenarios
from hippodrome.eval.trials.rivals.comparison import draw_comparison, draw_sequences
from hippodrome.eval.trials.rivals.stage import Tracked, TrackerOptions, locate, track
from hippodrome.sim.render.probe import require_gl
from hippodrome.sim.scenario import Scenario

ORBSLAM3_RESULTS = "orb-slam3.json"


@dataclass(frozen=True, slots=True)
class BaselineOptions:
    """What the command line asks for."""

    scenario: Path
    out: Path
    runs: int  # of ORB-SLAM3
    workers: int
    seconds: float | None  # a quick look: ORB-SLAM3 alone, on the first seconds of the drive
    paced: bool  # feed frames at the camera's rate, not as fast as they are taken
    limit_s: float | None  # time that a run of ORB-SLAM3 may take; None: by its number of frames
    methods: Sequence[Added] = ()  # that take part beside those that the scenario names


def run_baselines(options: BaselineOptions) -> None:
    """Evaluate a scenario and compare with ORB-SLAM3; all files go to ``options.out``, and what is there is not made again.

    Raises:
        HippodromeError: The scenario cannot be used, or asks for too few frames.
    """
    scenario, out = load_scenarios([options.scenario], None, None, options.methods)[0], options.out
    require_gl()
    whole = options.seconds is None
    if whole:
        evaluate([options.scenario], None, None, options.workers, out, options.methods)
    with worker_pool(options.workers) as pool:
        tracked = track(scenario, out, TrackerOptions(options.runs, options.seconds, options.paced, options.limit_s), pool)
        write_atomically(out / ORBSLAM3_RESULTS, to_json([row.model_dump(mode="python") for row in tracked.rows]).encode())
        for row in tracked.rows:
            _print_row(row)
        _print_failures(tracked.rows)
        if whole:
            _complete(scenario, out, tracked, pool)


def _complete(scenario: Scenario, out: Path, tracked: Tracked, pool: Workers) -> None:
    """Write both tables, the figures with all methods in them, and the report."""
    materials = gather(scenario, out)
    results = _joined(read_results(out / RESULTS), tracked.rows)
    results = with_peak_rss(results, scenario, out, pool)
    added = localize_added(materials, SEQUENCE_LENGTH_M)
    found: list[LocalizedSequence] = [*localize_sequences(materials), *added, *locate(scenario, out, tracked, pool)]
    write_results(out / RESULTS, results)
    write_atomically(out / "table1.md", table_one_markdown(results, quoted_rows()).encode())
    write_table_two(out, scenario.name, [one.row for one in found])
    compared = ratios(results.scenarios[0].rows, [one.row for one in found])
    write_atomically(out / scenario.name / RATIOS, to_json(compared).encode())
    draw_comparison(materials, tracked)
    draw_sequences(materials, found)
    write_report(out)
    print_table_one(results, quoted_rows(), PlainConsole())
    print("\n".join(ratio_lines(compared)))
    print(f"tables:  {out / 'table1.md'} {out / 'table2.md'}\nfigures: {out / scenario.name}/*.png\nreport:  {out / REPORT}")


def _joined(results: Results, rows: list[Row]) -> Results:
    """The evaluation's results with these rows added."""
    scenarios = tuple(ScenarioResult(**{**dict(one), "rows": (*one.rows, *rows)}) for one in results.scenarios)
    return Results(scenarios=scenarios)


def _print_failures(rows: list[Row]) -> None:
    """Print which runs did not end, and how to have others; nothing if all of them ended, or none was begun."""
    begun = (rows[-1].model_extra or {}).get("runs", ())
    ended = sum(run.get("failure") is None for run in begun)
    if ended < len(begun):
        print("\n".join([*failed_runs(rows), f"{ended} of {len(begun)} runs ended; to add others: --runs {len(begun) + 1}"]))


def _print_row(row: Row) -> None:
    if row.failure is not None or row.ape is None or row.cpu_percent is None or row.map_bytes is None:
        print(f"{row.method}: {row.failure or 'incomplete'}")
        return
    lost = f", {extra['maps_started']} maps" if (extra := row.model_extra or {}).get("maps_started", 1) > 1 else ""
    print(f"{row.method}: APE {row.ape.mean_m:.2f} m, CPU {row.cpu_percent:.1f} %, map {row.map_bytes / 1e6:.1f} MB, "
          f"{row.keyframes} keyframes of {row.camera_frames} frames{lost}")  # fmt: skip
