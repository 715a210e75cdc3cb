"""``hippodrome robustness``: one map, localized in under many conditions, each from several unknown starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hippodrome.core.road_network import RoadNetwork
from hippodrome.core.types import CognitiveMap, FloatArray, HippodromeError, Observation, Trajectory
from hippodrome.eval.localization_score import FALSE_FIX_M, LocalizationScore, score_localization
from hippodrome.eval.metrics import path_length_m
from hippodrome.eval.pool import worker_pool
from hippodrome.eval.robustness_conditions import CONDITIONS, chosen
from hippodrome.eval.robustness_report import ConditionResult, SequenceResult, report
from hippodrome.eval.run import make_recordings
from hippodrome.eval.stages import localize_recording, map_recording, refine_map
from hippodrome.proto.codec import load_map, save_map
from hippodrome.sim.record import RecordingPlan, finish
from hippodrome.sim.recording import Recording
from hippodrome.sim.render.probe import require_gl
from hippodrome.sim.scenario import Scenario, load_scenario
from hippodrome.sim.survey import with_survey_error

SEQUENCE_M = 300.0  # long enough to be localized within 200 m and to be wrong thereafter; the paper's are 170-1,485 m


@dataclass(frozen=True, slots=True)
class Task:
    """One condition of one scenario, in a finished map."""

    name: str
    scenario: Scenario
    out: Path
    sequences: int


def robustness(path: Path, names: Sequence[str] | None, sequences: int, workers: int, out: Path) -> None:
    """Record, map once, localize under each condition; writes ``robustness.json``, ``.md`` and ``.png`` below ``out/<name>``."""
    conditions = chosen(names)
    scenario = load_scenario(path)
    require_gl()
    tasks = [Task(name, CONDITIONS[name](scenario), out, sequences) for name in conditions]
    plans = [RecordingPlan(task.scenario, "localization", out) for task in tasks]
    with worker_pool(workers) as pool:
        make_recordings([RecordingPlan(scenario, "mapping", out), *plans], pool)
        pool.run("map", _build_map, [(scenario, out)])
        results = pool.run("localize", _localize, [(task, scenario) for task in tasks])
    report(out / scenario.name, scenario.name, results)


def map_path(scenario: Scenario, out: Path) -> Path:
    return out / scenario.name / "robustness-map.pbstream"


def _build_map(task: tuple[Scenario, Path]) -> None:
    """The topometric map of the mapping drive, from an unknown start."""
    scenario, out = task
    recording = finish(RecordingPlan(scenario, "mapping", out))
    semi_metric, _ = map_recording(recording.observations(), scenario.mapper)
    config = replace(scenario.refine, mode="default")
    refinement, _ = refine_map(semi_metric, _roads(scenario, out), config, None)
    save_map(map_path(scenario, out), refinement.cognitive_map, {"scenario": scenario.name, "recording": recording.folder.name})


def _roads(scenario: Scenario, out: Path) -> RoadNetwork:
    """The network as surveyed on the mapping day: the localization conditions do not change it."""
    town = RecordingPlan(scenario, "mapping", out).town()
    rng = np.random.default_rng([scenario.seed, 2])
    return with_survey_error(town.network, scenario.self_motion_noise.survey_error_m, rng)


def _localize(task: tuple[Task, Scenario]) -> ConditionResult:
    condition, mapped = task
    drive = finish(RecordingPlan(condition.scenario, "localization", condition.out))
    cognitive_map, _ = load_map(map_path(mapped, condition.out))
    roads = _roads(mapped, condition.out)
    observations, truth = list(drive.observations()), drive.ground_truth()
    found = tuple(
        _sequence(observations[first:end], _part(truth, first, end), cognitive_map, roads, condition.scenario)
        for first, end in cuts(drive, condition.sequences)
    )
    return ConditionResult(condition.name, found)


def cuts(drive: Recording, sequences: int) -> list[tuple[int, int]]:
    """Steps [first, end) of ``SEQUENCE_M`` each, the starts spread evenly over the distance driven."""
    travelled_m = path_length_m(drive.samples.poses_m)
    last_m = float(travelled_m[-1]) - SEQUENCE_M
    if last_m < 0.0:
        raise HippodromeError(
            f"{drive.folder}: the localization drive is {travelled_m[-1]:.0f} m long, sequences take {SEQUENCE_M:g} m: "
            "give localization.tour a greater length_m"
        )
    starts_m = np.linspace(0.0, last_m, sequences)
    first = np.searchsorted(travelled_m, starts_m, side="right") - 1
    end = np.searchsorted(travelled_m, starts_m + SEQUENCE_M, side="right")
    return [(int(a), int(b)) for a, b in zip(first, end, strict=True)]


def _part(truth: Trajectory, first: int, end: int) -> Trajectory:
    return Trajectory(truth.t_s[first:end], truth.poses[first:end])


def _sequence(
    observations: list[Observation], truth: Trajectory, cognitive_map: CognitiveMap, roads: RoadNetwork, scenario: Scenario
) -> SequenceResult:
    run = localize_recording(observations, cognitive_map, roads, scenario.localizer)
    score = score_localization(run.estimates, truth, run.step_s)
    return SequenceResult(
        start=tuple(float(value) for value in truth.poses[0]),
        localized_after_m=score.initial_distance_m,
        errors_m=_errors_after_fix(score),
        false_fixes=score.false_fixes,
        false_share=score.false_fix_share,
        steps=len(score.localized) - _first_fix(score),
        declared=int(score.localized.sum()),
        nees=score.mean_nees,
    )


def _first_fix(score: LocalizationScore) -> int:
    right = score.localized & (score.errors_m <= FALSE_FIX_M)
    return int(np.argmax(right)) if right.any() else len(right)


def _errors_after_fix(score: LocalizationScore) -> FloatArray:
    """Errors of the declared steps from the initial localization on."""
    first = _first_fix(score)
    return score.errors_m[first:][score.localized[first:]]
