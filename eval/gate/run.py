"""The run behind ``hippodrome gate``: every scenario with every seed, then the comparison."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from hippodrome._files import write_atomically
from hippodrome.eval.contest.entry import Added
from hippodrome.eval.gate.baseline import Baseline, GateError, baseline_of, read_baseline, write_baseline
from hippodrome.eval.gate.compare import MIN_PAIRS, Verdict, compare
from hippodrome.eval.gate.report import junit_xml, print_verdict, summary_markdown
from hippodrome.eval.results.model import Results
from hippodrome.eval.results.thresholds import failed_limits
from hippodrome.eval.run import load_scenarios, run_scenarios
from hippodrome.sim.scenario import Thresholds

SUMMARY = "GITHUB_STEP_SUMMARY"  # where GitHub Actions wants Markdown


@dataclass(frozen=True, slots=True)
class GateRequest:
    """What the command line asks for."""

    scenarios: Sequence[Path]
    seeds: Sequence[int]
    baseline: Path
    update: bool  # make the run the baseline instead of comparing with it
    workers: int
    out: Path
    junit: Path | None  # where the verdict goes as JUnit XML too
    methods: Sequence[Added] = ()  # that take part beside ours and the scenarios' own


def gate(request: GateRequest) -> bool:
    """Run the scenarios with all seeds; whether the run is as good as the baseline and within all limits.

    With ``update`` the run becomes the baseline, and passes. Raises HippodromeError on bad input.
    """
    if not request.scenarios:
        raise GateError("no scenario: name one or more files")
    if len(request.scenarios) * len(request.seeds) < MIN_PAIRS:
        raise GateError(
            f"{len(request.scenarios)} scenario(s) with {len(request.seeds)} seed(s): a test needs {MIN_PAIRS} pairs; "
            "give more seeds"
        )
    known = None if request.update else read_baseline(request.baseline)  # before the minutes that a run takes
    runs = [_run(request, seed) for seed in request.seeds]
    found, limits = baseline_of(runs), broken_limits(runs)
    if known is not None:
        return say(compare(found, known), limits, request.junit)
    _show_update(found, request.baseline, limits)
    write_baseline(request.baseline, found)
    print(f"{request.baseline}: written, {len(found.cells)} cells; commit it")
    return True


def _show_update(found: Baseline, path: Path, limits: Sequence[str]) -> None:
    """What the new baseline changes, where there is an old one that it compares with, and what no baseline excuses."""
    for line in limits:
        print(f"limit, fails the gate with any baseline: {line}")
    if path.exists():
        try:
            print_verdict(compare(found, read_baseline(path)), (), Console())
        except GateError as error:
            print(f"not comparable with the old baseline: {error}")


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
    """The scenarios' own limits that do not hold, in words."""
    return [
        f"{result.name}, seed {result.seed}: {line}"
        for run in runs
        for result in run.scenarios
        for line in failed_limits(Thresholds.model_validate(result.model_dump().get("configuration", {})["thresholds"]), result)
    ]


def _run(request: GateRequest, seed: int) -> Results:
    """One seed; recordings that are there already are not made again, everything after them is."""
    scenarios = load_scenarios(request.scenarios, None, seed, request.methods)
    return run_scenarios(scenarios, request.workers, request.out / f"seed-{seed}")
