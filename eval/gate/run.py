"""The run behind ``hippodrome gate``: every scenario with every seed, then the comparison."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from hippodrome._files import write_atomically
from hippodrome.eval.contest.entry import Added
from hippodrome.eval.drive.page import write_page
from hippodrome.eval.drive.run import drive_scenarios
from hippodrome.eval.gate.baseline import Baseline, GateError, baseline_of, read_baseline, write_baseline
from hippodrome.eval.gate.compare import Verdict, compare
from hippodrome.eval.gate.report import junit_xml, outcome_of, print_verdict, summary_markdown
from hippodrome.eval.gate.statistics import MIN_PAIRS
from hippodrome.eval.report.pages import write_trial_page
from hippodrome.eval.results.model import Results, write_results
from hippodrome.eval.results.terminal import PlainConsole
from hippodrome.eval.results.thresholds import failed_limits
from hippodrome.eval.run import RESULTS, load_scenarios, run_scenarios
from hippodrome.sim.scenario import Thresholds

SUMMARY = "GITHUB_STEP_SUMMARY"  # where GitHub Actions wants Markdown

PAGE = "gate.html"
PAGE_NOTE = (
    "Before is the baseline, after is this run; both are geometric means over the pairs of scenario and seed. The true change "
    "lies within the interval 95 times of 100. p is the probability that chance alone makes a figure this much worse. WORSE "
    "fails the gate; the worst pair is the one that became worse most."
)


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
    town_limit: float | None = None  # share by which no figure may become worse in a single town
    methods: Sequence[Added] = ()  # that take part beside ours and the scenarios' own


def gate(request: GateRequest) -> str:
    """Run the scenarios with all seeds, and compare: ``passed``, ``failed`` or ``cannot tell``.

    With ``update`` the run becomes the baseline, and passes. Raises HippodromeError on bad input, and before the minutes that a
    run takes if a file that is to be written at its end cannot be.
    """
    if not request.scenarios:
        raise GateError("no scenario: name one or more files")
    if len(request.scenarios) * len(request.seeds) < MIN_PAIRS:
        raise GateError(
            f"{len(request.scenarios)} scenario(s) with {len(request.seeds)} seed(s): a test needs {MIN_PAIRS} pairs; "
            "give more seeds"
        )
    known = None if request.update else read_baseline(request.baseline)
    _require_writable(request)
    runs = [_run(request, seed) for seed in request.seeds]
    found, limits = baseline_of(runs), broken_limits(runs)
    if known is not None:
        verdict = compare(found, known, request.town_limit)
        outcome = say(verdict, limits, request.junit)
        text = f"{summary_markdown(verdict, limits)}\n{PAGE_NOTE}\n"
        write_trial_page(request.out / PAGE, "Gate", text, command="hippodrome gate", verdict=outcome)
        print(f"page: {request.out / PAGE}")
        return outcome
    _show_update(found, request.baseline, limits)
    write_baseline(request.baseline, found)
    print(f"{request.baseline}: written, {len(found.cells)} cells; commit it")
    return "passed"


def _require_writable(request: GateRequest) -> None:
    """Raise GateError unless the files that the end of the run writes can be written."""
    if request.update:
        require_writable(request.baseline, "the baseline")
    if request.junit is not None:
        require_writable(request.junit, "--junit")
    if summary := os.environ.get(SUMMARY):
        _open_summary(Path(summary)).close()


def require_writable(path: Path, what: str) -> None:
    """Raise GateError unless ``path`` can become a file: a file may be made beside it, and it is no folder and no device."""
    if path.exists() and not path.is_file():
        raise GateError(f"{path}: {what} is to be written there, which is no regular file; name another")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path.parent) as trial:
            trial.write(b"trial")
    except OSError as error:
        raise GateError(f"{path}: {what} cannot be written there: {error.strerror or error}; name another file") from error


def _open_summary(path: Path) -> IO[str]:
    try:
        return path.open("a", encoding="utf-8")
    except OSError as error:
        raise GateError(f"{path}: the step summary cannot be written: {error.strerror or error}; unset {SUMMARY}") from error


def _show_update(found: Baseline, path: Path, limits: Sequence[str]) -> None:
    """What the new baseline changes, where there is an old one that it compares with, and what no baseline excuses."""
    for line in limits:
        print(f"limit, fails the gate with any baseline: {line}")
    if path.exists():
        try:
            print_verdict(compare(found, read_baseline(path)), (), PlainConsole())
        except GateError as error:
            print(f"not comparable with the old baseline: {error}")


def say(verdict: Verdict, limits: Sequence[str], junit: Path | None) -> str:
    """Tell the terminal, the CI system and GitHub; ``passed``, ``failed`` or ``cannot tell``."""
    print_verdict(verdict, limits, PlainConsole())
    if junit is not None:
        write_atomically(junit, junit_xml(verdict, limits))
    if summary := os.environ.get(SUMMARY):
        try:
            with _open_summary(Path(summary)) as stream:
                stream.write(summary_markdown(verdict, limits))
        except OSError as error:
            raise GateError(f"{summary}: the step summary cannot be written: {error.strerror or error}") from error
    return outcome_of(verdict, limits)


def broken_limits(runs: Sequence[Results]) -> list[str]:
    """The scenarios' own limits that do not hold, in words."""
    return [
        f"{result.name}, seed {result.seed}: {line}"
        for run in runs
        for result in run.scenarios
        for line in failed_limits(Thresholds.model_validate(result.model_dump().get("configuration", {})["thresholds"]), result)
    ]


def _run(request: GateRequest, seed: int) -> Results:
    """One seed; recordings and missions that are there already are not made again, everything else is.

    A scenario with missions is driven, any other one evaluated.
    """
    scenarios, out = load_scenarios(request.scenarios, None, seed, request.methods), request.out / f"seed-{seed}"
    evaluated = [one for one in scenarios if one.missions.count is None]
    driven = [one for one in scenarios if one.missions.count is not None]
    found = run_scenarios(evaluated, request.workers, out).scenarios if evaluated else ()
    if driven:
        results, tasks = drive_scenarios(driven, request.workers, out)
        write_page(results, tasks, out)
        found = (*found, *results.scenarios)
        write_results(out / RESULTS, Results(scenarios=found))
    return Results(scenarios=found)
