"""All entries run on one scenario: each maps the first drive and localizes the second, as far as it can; each has a row.

A method that raises, crashes or answers with no answer has a row that says so, and the others go on.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from hippodrome._folders import temporary_folder
from hippodrome.core.se2 import interpolate
from hippodrome.core.types import FloatArray, HippodromeError, Trajectory
from hippodrome.eval.contest.calls import Drawn, draw_all, localize
from hippodrome.eval.contest.entry import Entry
from hippodrome.eval.contest.guard import guarded
from hippodrome.eval.contest.places import recognise
from hippodrome.eval.methods.materials import Materials, Outcome, score_trajectory
from hippodrome.eval.methods.method import SEMI_METRIC
from hippodrome.eval.methods.protocol import (
    Localizes,
    MethodError,
)
from hippodrome.eval.metrics.localization import score_localization
from hippodrome.eval.metrics.trajectory import path_length_m
from hippodrome.eval.results.model import PlaceSummary, Row
from hippodrome.eval.results.rows import latency, row_of

SPACING_M: Final = 5.0  # between two scored samples where there is no semi-metric map: as far apart as its vertices are
LEAST_COVERED: Final = 0.5  # share of the drive that a trajectory must cover: with less, its errors say little about the drive


@dataclass(frozen=True, slots=True, eq=False)
class Performance:
    """What all entries came to, in their order."""

    rows: list[Row]
    outcomes: list[Outcome]  # of those that have a trajectory


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
        rows, outcomes = [], []
        for entry in entries:
            if entry.does == ("describe",):
                rows.append(_description_row(entry, materials))
                continue
            try:
                outcome = _outcome(entry, materials, drawn[entry.method.key], at_s, folders[entry.method.key])
                said = {"declaration": entry.declaration, "places": _places(entry, materials)}
            except HippodromeError as error:
                rows.append(_failed(entry, drawn, str(error)))
            else:
                rows.append(row_of(outcome, materials).model_copy(update=said))
                outcomes.append(outcome)
    return Performance(rows, outcomes)


def _description_row(entry: Entry, materials: Materials) -> Row:
    """The row of a method that only describes frames."""
    label = entry.method.label
    try:
        score, cpu_s, step_s = guarded(label, lambda: recognise(label, entry.runner.describe, materials), materials)
    except HippodromeError as error:
        return Row(method=label, failure=str(error), declaration=entry.declaration)
    drives_s = materials.duration_s + float(materials.drive.samples.t_s[-1])
    return Row(
        method=label,
        declaration=entry.declaration,
        places=PlaceSummary(**asdict(score)),
        cpu_percent=100 * cpu_s / drives_s,
        latency_ms=latency(step_s),
    )


def _places(entry: Entry, materials: Materials) -> PlaceSummary | None:
    """Place recognition of a method that does other things, too. Raises MethodError if that fails."""
    if "describe" not in entry.does:
        return None
    label = entry.method.label
    return PlaceSummary(**asdict(guarded(label, lambda: recognise(label, entry.runner.describe, materials), materials)[0]))


def scored_times(materials: Materials, semi_metric: Drawn | str | None) -> FloatArray:
    """Times (N,) at which trajectories are scored: those of the semi-metric map's vertices, or else one every ``SPACING_M``."""
    if isinstance(semi_metric, Drawn):
        return semi_metric.mapped.trajectory.t_s
    truth = materials.mapping.ground_truth()
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
        peak_rss_bytes=drawn.mapped.cost.peak_rss_bytes if drawn.mapped.cost else None,
    )
    if not isinstance(entry.runner, Localizes):
        return outcome
    try:
        localization = localize(entry, materials, drawn.mapped, folder, materials.drive)
        localized = score_localization(localization.estimates, materials.drive.ground_truth(), localization.step_s)
    except HippodromeError as error:
        return replace(outcome, failure=f"localization: {error}")
    return replace(outcome, localization=localization, localized=localized)


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
            f"of the drive, from {at_s[0]:.1f} s to {at_s[-1]:.1f} s; at least {LEAST_COVERED:.0%} is needed"
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
