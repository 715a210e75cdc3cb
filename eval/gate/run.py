"""The run behind ``hippodrome gate``: every scenario with every seed, then the comparison."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from hippodrome.eval.gate.baseline import GateError, baseline_of, read_baseline, write_baseline
from hippodrome.eval.gate.compare import MIN_PAIRS, Verdict, compare
from hippodrome.eval.gate.report import junit_xml, print_verdict, summary_markdown
from hippodrome.eval.results import Results, read_results
from hippodrome.eval.run import RESULTS, evaluate
from hippodrome.eval.thresholds import failed_limits
from hippodrome.proto.atomic import write_atomically
from hippodrome.sim.scenario import Thresholds

SUMMARY = "GITHUB_STEP_SUMMARY"  # where GitHub Actions wants Markdown


def gate(
    scenarios: Sequence[Path], seeds: Sequence[int], baseline: Path, update: bool, workers: int, out: Path, junit: Path | None
) -> bool:
    """Whether the run is as good as the baseline and within all limits; with ``update`` it becomes the baseline."""
    if len(scenarios) * len(seeds) < MIN_PAIRS:
        raise GateError(
            f"{len(scenarios)} scenario(s) with {len(seeds)} seed(s): a test needs {MIN_PAIRS} pairs; give more seeds"
        )
    known = None if update else read_baseline(baseline)  # before the minutes that a run takes
    runs = [_run(scenarios, seed, workers, out / f"seed-{seed}") for seed in seeds]
    found, limits = baseline_of(runs), broken_limits(runs)
    if known is None:
        write_baseline(baseline, found)
        print(f"{baseline}: written, {len(found.cells)} cells; commit it")
        return True
    return say(compare(found, known), limits, junit)


def say(verdict: Verdict, limits: Sequence[str], junit: Path | None) -> bool:
    """Tell the terminal, the CI system and GitHub; whether the gate is passed."""
    print_verdict(verdict, limits, Console())
    if junit is not None:
        write_atomically(junit, junit_xml(verdict, limits))
    if summary := os.environ.get(SUMMARY):
        with Path(summary).open("a", encoding="utf-8") as stream:
            stream.write(summary_markdown(verdict, limits))
    return verdict.passed and not limits


def broken_limits(runs: Sequence[Results]) -> list[str]:
    """The scenarios' own limits that do not hold."""
    return [
        f"{result.name}, seed {result.seed}: {line}"
        for run in runs
        for result in run.scenarios
        for line in failed_limits(Thresholds.model_validate(result.model_dump().get("configuration", {})["thresholds"]), result)
    ]


def _run(scenarios: Sequence[Path], seed: int, workers: int, out: Path) -> Results:
    """One seed; recordings that are there already are not made again, everything after them is."""
    evaluate(scenarios, None, seed, workers, out)
    return read_results(out / RESULTS)
