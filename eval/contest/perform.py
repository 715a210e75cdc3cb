"""All entries run on one scenario: each maps the first drive and localizes the second, as far as it can; each has a row.

A method that raises, crashes or answers with no answer has a row that says so, and the others go on.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import process_time
from typing import Final

import numpy as np

from hippodrome.core.se2 import interpolate
from hippodrome.core.types import FloatArray, HippodromeError, LocalizationEstimate, Trajectory
from hippodrome.eval.contest.entry import Entry
from hippodrome.eval.contest.guard import guarded
from hippodrome.eval.contest.places import recognise
from hippodrome.eval.methods.feed import Feed
from hippodrome.eval.methods.materials import Materials, Outcome, score_trajectory, true_start
from hippodrome.eval.methods.method import SEMI_METRIC
from hippodrome.eval.methods.protocol import (
    Cost,
    Given,
    Localized,
    Localizes,
    Localizing,
    Mapped,
    Maps,
    MethodError,
    as_estimate,
    as_mapped,
)
from hippodrome.eval.methods.stages import Localization
from hippodrome.eval.metrics.association import check_trajectory
from hippodrome.eval.metrics.localization import score_localization
from hippodrome.eval.metrics.trajectory import path_length_m
from hippodrome.eval.results.model import PlaceSummary, Row
from hippodrome.eval.results.rows import latency, row_of
from hippodrome.proto.codec import save_map
from hippodrome.sim.recording import Recording
from hippodrome.sim.render.camera import CameraSpec

SPACING_M: Final = 5.0  # between two scored samples where there is no semi-metric map: as far apart as its vertices are
LEAST_COVERED: Final = 0.5  # share of the drive that a trajectory must cover: with less, its errors say little about the drive


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """The map that a method made of the first drive, and what that took."""

    mapped: Mapped
    cpu_s: float  # of its map alone
    whole_s: float  # with the map that it builds on
    step_s: FloatArray
    map_bytes: int | None


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
        folders = {entry.method.key: Path(stack.enter_context(tempfile.TemporaryDirectory())) for entry in entries}
        drawn: dict[str, Drawn | str] = {}
        for entry in _bases_first(entries):
            if entry.does == ("describe",):
                continue
            try:
                drawn[entry.method.key] = _draw(entry, materials, drawn, folders[entry.method.key])
            except HippodromeError as error:
                if entry.method == SEMI_METRIC and all(other.source == "hippodrome" for other in entries):
                    raise
                drawn[entry.method.key] = str(error)
        at_s = _scored_times(materials, drawn.get(SEMI_METRIC.key))
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


def _bases_first(entries: Sequence[Entry]) -> list[Entry]:
    """The entries, those that others build on before these. A method that builds on itself comes last, and fails there."""
    by_key = {entry.method.key: entry for entry in entries}

    def depth(entry: Entry) -> int:
        found, steps = entry, 0
        while found.builds_on is not None and steps <= len(entries):
            found, steps = by_key[found.builds_on], steps + 1
        return steps

    return sorted(entries, key=depth)


def _draw(entry: Entry, materials: Materials, drawn: Mapping[str, Drawn | str], folder: Path) -> Drawn:
    """The method's map of the first drive. Raises HippodromeError if there is none."""
    label, base = entry.method.label, None
    if entry.builds_on is not None:
        found = drawn.get(entry.builds_on, "it was not run")
        if isinstance(found, str):
            raise MethodError(f"builds on {entry.builds_on}, which failed: {found}")
        base = found
    if not isinstance(entry.runner, Maps):
        if base is None:
            raise MethodError("it makes no map, and builds on none")
        return replace(base, cpu_s=0.0, whole_s=base.whole_s, step_s=np.zeros(0), map_bytes=None)
    given = _given(entry, materials, materials.mapping, folder, base.mapped if base else None)
    if (warm_up := getattr(entry.runner, "warm_up", None)) is not None:
        guarded(label, warm_up, materials)
    feed = Feed(materials.mapping.observations() if entry.needs.camera else materials.mapping.self_motion())
    began = process_time()
    mapped = guarded(label, lambda: as_mapped(entry.runner.map(iter(feed), given), label), materials)
    cpu_s = process_time() - began - feed.decoding_s
    feed.settle()
    check_trajectory(mapped.trajectory, label)
    map_bytes = guarded(label, lambda: _save(entry, mapped, materials), materials)
    step_s = feed.step_s
    if (cost := mapped.cost) is not None:
        cpu_s, step_s = cost.cpu_s, np.zeros(0) if cost.step_s is None else cost.step_s
    return Drawn(mapped, cpu_s, cpu_s + (base.whole_s if base else 0.0), step_s, map_bytes)


def _save(entry: Entry, mapped: Mapped, materials: Materials) -> int | None:
    """Write the map into the scenario's folder; its size in bytes, or None if the method keeps no map."""
    if entry.method.map_file is None:
        return None
    path = entry.method.map_path(materials.folder)
    if mapped.save is not None:
        return mapped.save(path)
    if mapped.cognitive_map is not None:
        return save_map(path, mapped.cognitive_map, materials.provenance(entry.method))
    return None


def _given(entry: Entry, materials: Materials, drive: Recording, folder: Path, base: Mapped | None) -> Given:
    scenario, needs = materials.scenario, entry.needs
    return Given(
        camera=_camera(scenario.camera, drive),
        rate_hz=scenario.odometry_rate_hz,
        duration_s=float(drive.samples.t_s[-1]),
        seed=scenario.seed,
        folder=folder,
        roads=materials.roads if needs.road_network else None,
        start=true_start(drive) if needs.start_pose and drive is materials.mapping else None,
        base=base,
        concealed=tuple(folder for folder in materials.truth_folders if folder.is_dir()),
    )


def _camera(camera: CameraSpec, drive: Recording) -> CameraSpec:
    """The camera of a drive: the scenario's, or what is known of that of a drive that was recorded elsewhere."""
    known = getattr(drive, "manifest", {}).get("camera", {})
    return camera.model_copy(update={name: value for name, value in known.items() if name in CameraSpec.model_fields})


def _scored_times(materials: Materials, semi_metric: Drawn | str | None) -> FloatArray:
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
    trajectory, covered = _sampled(drawn.mapped.trajectory, at_s)
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
        localization = _localize(entry, materials, drawn.mapped, folder)
        localized = score_localization(localization.estimates, materials.drive.ground_truth(), localization.step_s)
    except HippodromeError as error:
        return replace(outcome, failure=f"localization: {error}")
    return replace(outcome, localization=localization, localized=localized)


def _sampled(trajectory: Trajectory, at_s: FloatArray) -> tuple[Trajectory, float]:
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


def _localize(entry: Entry, materials: Materials, mapped: Mapped, folder: Path) -> Localization:
    """The second drive localized, from an unknown start. Raises HippodromeError."""
    label, drive = entry.method.label, materials.drive
    given = replace(_given(entry, materials, drive, folder, None), mapped=mapped)
    feed = Feed(drive.observations() if entry.needs.camera else drive.self_motion())
    estimates, cost = guarded(label, lambda: _answers(label, entry.runner.localize(iter(feed), given)), materials)
    feed.settle()
    times_s = drive.samples.t_s
    if len(estimates) != len(times_s):
        raise MethodError(f"{len(estimates)} answers to {len(times_s)} observations; one for each is expected, in their order")
    if not np.allclose([estimate.t_s for estimate in estimates], times_s, rtol=0.0, atol=1e-6):
        raise MethodError("its answers have other times than the observations; answer each with its own t_s")
    if cost is None:
        return Localization(estimates, feed.step_cpu_s)
    return Localization(estimates, np.full(len(times_s), cost.cpu_s / len(times_s)) if cost.step_s is None else cost.step_s)


def _answers(label: str, answers: Localizing) -> tuple[list[LocalizationEstimate], Cost | None]:
    """What ``localize`` gave, answer by answer; a method that yields them does its work here."""
    if isinstance(answers, Localized):
        return [as_estimate(answer, label) for answer in answers.answers], answers.cost
    return [as_estimate(answer, label) for answer in answers], None


def _failed(entry: Entry, drawn: Mapping[str, Drawn | str], cause: str) -> Row:
    """The row of a method without a trajectory, with the size of the map that it builds on."""
    base = drawn.get(entry.builds_on) if entry.builds_on is not None else None
    figures = base.mapped.figures if isinstance(base, Drawn) else {}
    return Row(method=entry.method.label, failure=cause, declaration=entry.declaration, **figures)


def drawn_methods(outcomes: Iterable[Outcome]) -> list[Outcome]:
    """The outcomes that pictures show."""
    return [outcome for outcome in outcomes if outcome.method.drawn]
