"""Methods beside ours under the conditions of the robustness trial: those that localize, and those that describe views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from hippodrome.core.types import CognitiveMap, FloatArray, Frame, HippodromeError, Trajectory
from hippodrome.eval.contest.entry import Entry
from hippodrome.eval.contest.guard import guarded
from hippodrome.eval.contest.places import vector_of
from hippodrome.eval.contest.trials import Localizer, added_methods, localizer_of
from hippodrome.eval.methods.materials import Materials, gather
from hippodrome.eval.methods.needs import require_met
from hippodrome.eval.methods.protocol import MethodError
from hippodrome.eval.metrics.localization import score_localization
from hippodrome.eval.metrics.mapped_road import split_by_map
from hippodrome.eval.trials.robustness.conditions import OURS_ALONE
from hippodrome.eval.trials.robustness.localize import sequence_steps
from hippodrome.eval.trials.robustness.place_recognition import Answers, Queries, judged, margin_of, places_of
from hippodrome.eval.trials.robustness.sequences import ELSEWHERE, ConditionResult, SequenceResult
from hippodrome.proto.codec import load_map
from hippodrome.sim.record import RecordingPlan, finish
from hippodrome.sim.recording import Recording
from hippodrome.sim.scenario import Scenario

FAR_M: Final = 1e6  # the truth of a drive in another town is moved by this: no declared pose may be right there


@dataclass(frozen=True, slots=True)
class MethodTask:
    """One method that localizes, under all conditions of a town: it maps the mapping drive but once."""

    label: str
    mapped: Scenario  # the scenario as it is written
    drives: tuple[tuple[str, Scenario], ...]  # names of conditions, and the scenario under each; another town's is the last
    map_file: Path  # our map, which says what road was mapped
    out: Path
    sequences: int
    only: int | None


@dataclass(frozen=True, slots=True, eq=False)
class Tried:
    """What came of one method; nothing but the cause where it failed."""

    label: str
    results: tuple[ConditionResult, ...] = ()
    failure: str | None = None


def localizing(scenario: Scenario) -> list[str]:
    """Labels of the methods beside ours that localize."""
    return [entry.method.label for entry in added_methods(scenario, "localize")]


def left_out(scenario: Scenario) -> dict[str, str]:
    """Labels of the methods beside ours that have nothing to do here, and why."""
    mapping = {entry.method.label: entry.does for entry in added_methods(scenario, "map")}
    why = "left out: it neither localizes nor describes views"
    return {label: why for label, does in mapping.items() if "localize" not in does and "describe" not in does}


def try_method(task: MethodTask) -> Tried:
    """Localize all sequences under all conditions with one method. Conditions that only ours can have are left out."""
    entry = next(one for one in added_methods(task.mapped, "localize") if one.method.label == task.label)
    cognitive_map, _ = load_map(task.map_file)
    try:
        with localizer_of(entry, gather(task.mapped, task.out)) as localizer:
            found = [
                _condition(name, scenario, localizer, cognitive_map, task)
                for name, scenario in task.drives
                if name not in OURS_ALONE
            ]
    except HippodromeError as error:
        return Tried(task.label, failure=str(error))
    return Tried(task.label, tuple(found))


def describe_places(
    scenario: Scenario, cognitive_map: CognitiveMap, mapping: Recording, queries: Queries, out: Path
) -> tuple[tuple[Answers, ...], dict[str, str]]:
    """The answers of all methods that describe views, to the queries that ours answers, about the same places.

    A query's place is the one whose vector is nearest; how far it stands out from the best one elsewhere says how sure it is.
    A method that fails has no answers: its label and the cause are in what is returned beside them.
    """
    steps, places_m = places_of(cognitive_map, mapping)
    frames = [mapping.frame(int(mapping.samples.frame[step])) for step in steps]
    materials, found, failed = gather(scenario, out), [], {}
    for entry in added_methods(scenario, "describe"):
        try:
            require_met(entry.needs, scenario, mapping)
            found.append(_described(entry, frames, places_m, queries, materials))
        except HippodromeError as error:
            failed[entry.method.label] = str(error)
            print(f"{scenario.name}: {entry.method.label}: place recognition: {error}", flush=True)
        finally:
            entry.close()
    return tuple(found), failed


def _described(entry: Entry, frames: Sequence[Frame], places_m: FloatArray, queries: Queries, materials: Materials) -> Answers:
    label = entry.method.label
    places = guarded(label, partial(_vectors, label, entry, frames), materials)
    asked = guarded(label, partial(_vectors, label, entry, queries.frames), materials)
    if places.shape[1] != asked.shape[1]:
        raise MethodError(f"describe() gave {places.shape[1]} numbers, and later {asked.shape[1]}")
    similarity = np.array([-np.linalg.norm(places - one, axis=1) for one in asked])
    margins = np.array([margin_of(row, places_m) for row in similarity])
    return judged(label, np.argmax(similarity, axis=1).astype(np.int32), margins, queries.poses_m, places_m)


def _vectors(label: str, entry: Entry, frames: Sequence[Frame]) -> FloatArray:
    vectors: list[FloatArray] = []
    for frame in frames:
        vectors.append(vector_of(entry.runner.describe(frame), vectors[0] if vectors else None, label))
    return np.array(vectors)


def _condition(
    name: str, scenario: Scenario, localizer: Localizer, cognitive_map: CognitiveMap, task: MethodTask
) -> ConditionResult:
    """All sequences of a condition, or the only one that is wanted."""
    drive = finish(RecordingPlan(scenario, "localization", task.out))
    truth = drive.ground_truth()
    if name == ELSEWHERE:  # no place of this map is right
        truth = replace(truth, poses=truth.poses + np.array([FAR_M, FAR_M, 0.0]))
    numbered = enumerate(sequence_steps(drive, task.sequences), start=1)
    found = [
        _sequence(number, steps, truth, drive, localizer, cognitive_map)
        for number, steps in numbered
        if task.only in (None, number)
    ]
    return ConditionResult(name, tuple(found), task.label)


def _sequence(
    number: int, steps: slice, truth: Trajectory, drive: Recording, localizer: Localizer, cognitive_map: CognitiveMap
) -> SequenceResult:
    """One sequence localized and scored, as ours is."""
    run = localizer.localize(drive, (steps.start, steps.stop))
    truth = Trajectory(truth.t_s[steps], truth.poses[steps])
    score = score_localization(run.estimates, truth, run.step_s)
    return SequenceResult(
        number=number,
        start=tuple(float(value) for value in truth.poses[0]),
        on_map=split_by_map(score, truth.poses, cognitive_map),
        false_fixes=score.false_fixes,
        false_share=score.false_fix_share,
        declared=int(score.localized.sum()),
        nees=score.mean_nees,
        step_ms=1e3 * float(run.step_s.mean()),
        query_step_ms=1e3 * float(np.median(run.step_s)),
    )
