"""All entries run on one scenario: each maps the first drive and localizes the second, as far as it can; each has a row.

A method that raises, crashes or answers with no answer has a row that says so, and the others go on.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from time import process_time
from typing import Any, Final

import numpy as np

from hippodrome._folders import temporary_folder
from hippodrome._native import give_back_memory
from hippodrome.core.se2 import interpolate
from hippodrome.core.types import FloatArray, HippodromeError, Trajectory
from hippodrome.eval.contest.apart import Apart
from hippodrome.eval.contest.calls import Drawn, draw_all, localize
from hippodrome.eval.contest.entry import Entry
from hippodrome.eval.contest.guard import guarded
from hippodrome.eval.contest.places import recognise
from hippodrome.eval.methods.materials import Materials, Outcome, Unscored, score_trajectory, truth_of, why_unscored
from hippodrome.eval.methods.method import SEMI_METRIC
from hippodrome.eval.methods.needs import require_met
from hippodrome.eval.methods.protocol import (
    Localizes,
    MethodError,
)
from hippodrome.eval.methods.stages import Localization
from hippodrome.eval.metrics.localization import LocalizationScore, score_localization
from hippodrome.eval.metrics.places import PlaceScore
from hippodrome.eval.metrics.trajectory import path_length_m
from hippodrome.eval.results.model import LocalizationSummary, PlaceSummary, Row, summarize_localization
from hippodrome.eval.results.rows import latency, row_of

SPACING_M: Final = 5.0  # between two scored samples where there is no semi-metric map: as far apart as its vertices are
LEAST_COVERED: Final = 0.5  # share of the drive that a trajectory must cover: with less, its errors say little about the drive


@dataclass(frozen=True, slots=True, eq=False)
class Performance:
    """What all entries came to, in their order."""

    rows: list[Row]
    outcomes: list[Outcome]  # of those that have a trajectory
    unscored: list[Unscored] = field(default_factory=list)  # in place of the outcomes where the mapping drive has no truth


def perform(materials: Materials, entries: Sequence[Entry]) -> Performance:
    """Run all entries on a scenario's drives. Maps go to the scenario's folder.

    Raises:
        HippodromeError: There is no semi-metric map, and no method beside ours.
    """
    with ExitStack() as stack:
        folders = {entry.method.key: stack.enter_context(temporary_folder()) for entry in entries}
        for entry in entries:
            stack.callback(entry.close)
        drawn = draw_all(materials, entries, folders)
        at_s = scored_times(materials, drawn.get(SEMI_METRIC.key))
        rows, outcomes, unscored = [], [], []
        without_truth = why_unscored(materials.mapping)
        for entry in entries:
            if entry.does == ("describe",):
                rows.append(_description_row(entry, materials))
                continue
            if without_truth is not None:
                row, found = _unscored(entry, materials, drawn, at_s, folders[entry.method.key], without_truth)
                rows.append(row)
                unscored += [found] if found is not None else []
                continue
            try:
                row, outcome = _judged(entry, materials, drawn[entry.method.key], at_s, folders[entry.method.key])
            except HippodromeError as error:
                rows.append(_failed(entry, drawn, str(error)))
            else:
                rows.append(row)
                outcomes.append(outcome)
            finally:
                give_back_memory()
    return Performance(rows, outcomes, unscored)


def _judged(entry: Entry, materials: Materials, drawn: Drawn | str, at_s: FloatArray, folder: Path) -> tuple[Row, Outcome]:
    """The row of a method, and what it came to. Raises HippodromeError without a trajectory.

    What is odd in an answer of others, and was not seen when it was looked at, falls in its own row and not in the whole run.
    """

    def judged() -> tuple[Row, Outcome]:
        outcome = _outcome(entry, materials, drawn, at_s, folder)
        said = {"declaration": entry.declaration, "places": _places(entry, materials)}
        return row_of(outcome, materials).model_copy(update={**said, **_second_drive(outcome, materials)}), outcome

    return judged() if entry.source == "hippodrome" else guarded(entry.method.label, judged, materials)


def _second_drive(outcome: Outcome, materials: Materials) -> dict[str, Any]:
    """Fields of the row where the second drive has no truth; none where it has."""
    cause = why_unscored(materials.drive)
    if cause is None or outcome.localization is None:
        return {}
    return {"unscored": f"localization: {cause}", "localization": _share(outcome.localization)}


def _share(localization: Localization) -> LocalizationSummary:
    """For how much of a drive without truth a method says that it is localized."""
    known = [estimate.localized for estimate in localization.estimates]
    return LocalizationSummary(definition="not scored, as the truth is not known", localized_share=sum(known) / len(known))


def _unscored(
    entry: Entry, materials: Materials, drawn: Mapping[str, Drawn | str], at_s: FloatArray, folder: Path, cause: str
) -> tuple[Row, Unscored | None]:
    """The row of a method on a mapping drive without truth, and what it came to, if it came to anything."""
    found = drawn[entry.method.key]
    try:
        if isinstance(found, str):
            raise MethodError(found)
        trajectory, covered = sampled(found.mapped.trajectory, at_s)
    except HippodromeError as error:
        return _failed(entry, drawn, str(error)), None
    localization, score, failure = _localized(entry, materials, found, folder)
    summary = None
    if localization is not None:
        summary = _share(localization) if score is None else summarize_localization(score)
    row = Row(
        method=entry.method.label,
        failure=failure,
        unscored=cause,
        declaration=entry.declaration,
        cpu_percent=100 * found.whole_s / materials.duration_s,
        latency_ms=latency(found.step_s),
        peak_rss_bytes=found.peak_rss_bytes,
        map_bytes=found.map_bytes,
        covered=covered,
        localization=summary,
        **found.mapped.figures,
    )
    return row, Unscored(entry.method, trajectory, localization)


def _description_row(entry: Entry, materials: Materials) -> Row:
    """The row of a method that only describes frames."""
    label = entry.method.label
    if (cause := why_unscored(materials.mapping) or why_unscored(materials.drive)) is not None:
        return Row(method=label, unscored=cause, declaration=entry.declaration)
    try:
        score, cpu_s, step_s = _recognised(entry, materials)
    except HippodromeError as error:
        return Row(method=label, failure=str(error), declaration=entry.declaration)
    drives_s = materials.duration_s + float(materials.drive.samples.t_s[-1])
    return Row(
        method=label,
        declaration=entry.declaration,
        places=PlaceSummary(**asdict(score)),
        cpu_percent=100 * cpu_s / drives_s,
        latency_ms=latency(step_s),
        peak_rss_bytes=entry.runner.peak_rss_bytes if isinstance(entry.runner, Apart) else None,
    )


def _recognised(entry: Entry, materials: Materials) -> tuple[PlaceScore, float, FloatArray]:
    """Place recognition by a method's vectors: score, CPU seconds, seconds (N,) for each frame. Raises MethodError."""
    label, runner = entry.method.label, entry.runner
    for drive in (materials.mapping, materials.drive):
        require_met(entry.needs, materials.scenario, drive)
    if isinstance(runner, Apart):
        guarded(label, runner.prepare, materials)
    clock = runner.cpu_s if isinstance(runner, Apart) else process_time
    return guarded(label, lambda: recognise(label, runner.describe, materials, clock), materials)


def _places(entry: Entry, materials: Materials) -> PlaceSummary | None:
    """Place recognition of a method that does other things, too. Raises MethodError if that fails."""
    if "describe" not in entry.does or why_unscored(materials.drive) is not None:
        return None
    return PlaceSummary(**asdict(_recognised(entry, materials)[0]))


def scored_times(materials: Materials, semi_metric: Drawn | str | None) -> FloatArray:
    """Times (N,) at which trajectories are scored: those of the semi-metric map's vertices, or else one every ``SPACING_M``."""
    if isinstance(semi_metric, Drawn):
        return semi_metric.mapped.trajectory.t_s
    if (truth := truth_of(materials.mapping)) is None:
        return materials.mapping.samples.t_s
    stretch = np.floor(path_length_m(truth.poses) / SPACING_M)
    times_s: FloatArray = truth.t_s[np.concatenate([[True], np.diff(stretch) > 0])]
    return times_s


def _outcome(entry: Entry, materials: Materials, drawn: Drawn | str, at_s: FloatArray, folder: Path) -> Outcome:
    """The method's trajectory scored, and the second drive localized in its map. Raises HippodromeError without a trajectory."""
    if isinstance(drawn, str):
        raise MethodError(drawn)
    method, truth = entry.method, materials.mapping.ground_truth()
    trajectory, covered = sampled(drawn.mapped.trajectory, at_s)
    outcome = Outcome(
        method=method,
        mapped=drawn.mapped,
        scored=score_trajectory(trajectory, truth, method.alignment),
        cpu_s=drawn.whole_s,
        own_cpu_s=drawn.cpu_s,
        step_s=drawn.step_s,
        map_bytes=drawn.map_bytes,
        covered=covered,
        peak_rss_bytes=drawn.peak_rss_bytes,
    )
    localization, localized, failure = _localized(entry, materials, drawn, folder)
    return replace(outcome, localization=localization, localized=localized, failure=failure)


def _localized(
    entry: Entry, materials: Materials, drawn: Drawn, folder: Path
) -> tuple[Localization | None, LocalizationScore | None, str | None]:
    """The second drive localized in the method's map: its answers, their score where the truth is known, or why there is none."""
    if not isinstance(entry.runner, Localizes):
        return None, None, None
    try:
        localization = localize(entry, materials, drawn.mapped, folder, materials.drive)
        if (truth := truth_of(materials.drive)) is None:
            return localization, None, None
        return localization, score_localization(localization.estimates, truth, localization.step_s), None
    except HippodromeError as error:
        return None, None, f"localization: {error}"


def sampled(trajectory: Trajectory, at_s: FloatArray) -> tuple[Trajectory, float]:
    """The trajectory at the times ``at_s`` (N,) between its ends, linear between its poses, and the share of times that is.

    Raises:
        MethodError: It covers less than ``LEAST_COVERED`` of the times.
    """
    if np.array_equal(trajectory.t_s, at_s):
        return trajectory, 1.0
    within = at_s[(at_s >= trajectory.t_s[0]) & (at_s <= trajectory.t_s[-1])]
    covered = len(within) / len(at_s)
    if covered < LEAST_COVERED or len(within) < 2:
        raise MethodError(
            f"its {len(trajectory.t_s)} poses, from {trajectory.t_s[0]:.1f} s to {trajectory.t_s[-1]:.1f} s, cover {covered:.0%} "
            f"of the drive, from {at_s[0]:.1f} s to {at_s[-1]:.1f} s; at least {LEAST_COVERED:.0%} is needed; "
            "times are those of the observations, in seconds"
        )
    return Trajectory(within, interpolate(trajectory.t_s, trajectory.poses, within)), covered


def _failed(entry: Entry, drawn: Mapping[str, Drawn | str], cause: str) -> Row:
    """The row of a method without a trajectory, with the size of the map that it builds on."""
    base = drawn.get(entry.builds_on) if entry.builds_on is not None else None
    figures = base.mapped.figures if isinstance(base, Drawn) else {}
    return Row(method=entry.method.label, failure=cause, declaration=entry.declaration, **figures)


def drawn_methods(outcomes: Iterable[Outcome]) -> list[Outcome]:
    """The outcomes that pictures show."""
    return [outcome for outcome in outcomes if outcome.method.drawn]
