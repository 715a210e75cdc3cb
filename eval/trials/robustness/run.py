"""``hippodrome robustness``: a map of each town, localized in under many conditions, each from several unknown starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hippodrome.core.localization.config import LocalizerConfig, Mode
from hippodrome.core.localization.localizer import Localizer
from hippodrome.core.mapping.mapper import Mapper
from hippodrome.core.refinement.refine import refine
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, HippodromeError, Observation, Trajectory
from hippodrome.eval.methods.materials import refine_config
from hippodrome.eval.methods.stages import localize_recording, map_recording
from hippodrome.eval.metrics.localization import score_localization
from hippodrome.eval.metrics.mapped_road import split_by_map
from hippodrome.eval.metrics.trajectory import path_length_m
from hippodrome.eval.pool import Workers, worker_pool
from hippodrome.eval.run import load_scenarios, make_recordings
from hippodrome.eval.trials.robustness.cases import (
    Kidnapping,
    PaperSequence,
    kidnappings,
    paper_sequences,
)
from hippodrome.eval.trials.robustness.conditions import CONDITIONS, SAME, chosen
from hippodrome.eval.trials.robustness.place_recognition import half_known, looks_of, recognise
from hippodrome.eval.trials.robustness.places import PlaceResult
from hippodrome.eval.trials.robustness.report import (
    ELSEWHERE,
    ConditionResult,
    Findings,
    SequenceResult,
    markdown,
    report,
)
from hippodrome.eval.trials.robustness.towns import report_towns
from hippodrome.proto.codec import load_map, save_map
from hippodrome.sim.record import RecordingPlan, finish
from hippodrome.sim.recording import Recording
from hippodrome.sim.render.probe import require_gl
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.survey import with_survey_error
from hippodrome.sim.town import TownSpec

SEQUENCE_M = 300.0  # long enough to be localized within 200 m and to be wrong thereafter; the paper's are 170-1,485 m
FAR_M = 1e6  # where another town lies
ELSEWHERE_SEED = 1_000  # added to the seed: another town of the same kind


@dataclass(frozen=True, slots=True)
class Task:
    """One condition of one scenario, in the finished map of ``mapped``."""

    name: str
    scenario: Scenario
    mapped: Scenario
    out: Path
    starts: tuple[int, int | None]  # how many unknown starts, and the one that is wanted alone
    mode: Mode = "coupled"


@dataclass(frozen=True, slots=True)
class Request:
    """What the command line asks for."""

    scenarios: Sequence[Path]
    conditions: Sequence[str] | None
    sequences: int
    only: int | None  # number of the only start to run, from 1: a failure seen again
    modes: Sequence[Mode]
    workers: int
    out: Path


def robustness(request: Request) -> None:
    """Each town's files below ``out/<name>``; with several towns, all of them pooled in ``out``."""
    scenarios = load_scenarios(request.scenarios, None, None)
    conditions = chosen(request.conditions)
    if request.only is not None and request.only > request.sequences:
        raise HippodromeError(f"--start {request.only}: there are {request.sequences} starts, see --sequences")
    require_gl()
    with worker_pool(request.workers) as pool:
        towns = {one.name: found for one in scenarios if (found := _town(one, conditions, request, pool)) is not None}
    if len(towns) > 1:
        report_towns(request.out, towns)


def _town(scenario: Scenario, conditions: Sequence[str], request: Request, pool: Workers) -> Findings | None:
    """Record, map once, localize under each condition, report. None: only one start was asked for, and is printed."""
    out, starts = request.out, (request.sequences, request.only)
    tasks = [Task(name, CONDITIONS[name](scenario), scenario, out, starts) for name in conditions]
    away = Task(ELSEWHERE, elsewhere(scenario), scenario, out, starts)
    plans = [RecordingPlan(task.scenario, "localization", out) for task in [*tasks, away]]
    make_recordings([RecordingPlan(scenario, "mapping", out), *plans], pool)
    pool.run("map", _build_map, [(scenario, out)])
    by_mode = [replace(task, mode=mode) for mode in request.modes for task in tasks]
    results = pool.run("localize", _localize, [*by_mode, away])
    if request.only is not None:
        print(markdown(scenario.name, results))
        return None
    places = pool.run("places", _recognise, tasks)
    kidnapped = dict(zip(conditions, pool.run("kidnap", _kidnap, tasks), strict=True))
    paper = pool.run("lengths", _paper_lengths, tasks[:1])[0]
    path = map_path(scenario, out)
    views = len(load_map(path)[0].view_cells.templates)
    found = Findings(results, places, kidnapped, paper, path.stat().st_size, views)
    report(out / scenario.name, scenario.name, found)
    return found


def elsewhere(scenario: Scenario) -> Scenario:
    """A drive in another town: generated with another seed, or the default town if the scenario's is a file."""
    same = CONDITIONS[SAME](scenario)
    town = same.town if same.town.network is None else TownSpec()
    return same.model_copy(update={"name": f"{scenario.name}-elsewhere", "seed": scenario.seed + ELSEWHERE_SEED, "town": town})


def map_path(scenario: Scenario, out: Path) -> Path:
    return out / scenario.name / "robustness-map.pbstream"


def _build_map(task: tuple[Scenario, Path]) -> None:
    """The topometric map of the mapping drive, from an unknown start."""
    scenario, out = task
    recording = finish(RecordingPlan(scenario, "mapping", out))
    semi_metric, _ = map_recording(recording.observations(), Mapper(scenario.mapper))
    refined = refine(semi_metric, _roads(scenario, out), refine_config(scenario, "route"), None)
    save_map(map_path(scenario, out), refined.cognitive_map, {"scenario": scenario.name, "recording": recording.folder.name})


def _roads(scenario: Scenario, out: Path) -> RoadNetwork:
    """The network as surveyed on the mapping day: the localization conditions do not change it."""
    town = RecordingPlan(scenario, "mapping", out).town()
    rng = np.random.default_rng([scenario.seed, 2])
    return with_survey_error(town.network, scenario.self_motion_noise.survey_error_m, rng)


def _opened(task: Task) -> tuple[Recording, list[Observation], CognitiveMap, RoadNetwork, LocalizerConfig]:
    drive = finish(RecordingPlan(task.scenario, "localization", task.out))
    cognitive_map, _ = load_map(map_path(task.mapped, task.out))
    config = replace(task.scenario.localizer, mode=task.mode)
    return drive, list(drive.observations()), cognitive_map, _roads(task.mapped, task.out), config


def _localize(task: Task) -> ConditionResult:
    drive, observations, cognitive_map, roads, config = _opened(task)
    truth, (count, only) = drive.ground_truth(), task.starts
    if task.name == ELSEWHERE:  # no place of this map is right
        truth = replace(truth, poses=truth.poses + np.array([FAR_M, FAR_M, 0.0]))
    chosen_cuts = [(number, *ends) for number, ends in enumerate(cuts(drive, count), start=1) if only in (None, number)]
    found = tuple(
        sequence_result(number, observations[first:end], _part(truth, first, end), cognitive_map, roads, config)
        for number, first, end in chosen_cuts
    )
    return ConditionResult(task.name, found, task.mode)


def _recognise(task: Task) -> PlaceResult:
    drive = finish(RecordingPlan(task.scenario, "localization", task.out))
    mapping = finish(RecordingPlan(task.mapped, "mapping", task.out))
    cognitive_map, config = half_known(load_map(map_path(task.mapped, task.out))[0]), task.scenario.localizer
    return PlaceResult(task.name, recognise(cognitive_map, mapping, looks_of(drive, config), config))


def _kidnap(task: Task) -> tuple[Kidnapping, ...]:
    return kidnappings(*_opened(task), task.starts[0])


def _paper_lengths(task: Task) -> tuple[PaperSequence, ...]:
    return paper_sequences(*_opened(task))


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


def sequence_result(
    number: int, observations: Sequence[Observation], truth: Trajectory, cognitive_map: CognitiveMap, roads: RoadNetwork,
    config: LocalizerConfig,
) -> SequenceResult:  # fmt: skip
    """One unknown start."""
    run = localize_recording(observations, Localizer(cognitive_map, roads, config))
    score = score_localization(run.estimates, truth, run.step_s)
    confidence = np.array([estimate.confidence for estimate in run.estimates])
    on_map = split_by_map(score, truth.poses, cognitive_map)
    looks = np.append(True, np.diff(confidence) != 0.0)  # a look gives a new margin, a step without keeps the last
    return SequenceResult(
        number=number,
        start=tuple(float(value) for value in truth.poses[0]),
        on_map=on_map,
        false_fixes=score.false_fixes,
        false_share=score.false_fix_share,
        declared=int(score.localized.sum()),
        nees=score.mean_nees,
        step_ms=1e3 * float(run.step_s.mean()),
        look_ms=1e3 * float(np.median(run.step_s[looks])),
    )
