"""``hippodrome robustness``: a map of each town, and localization in it under many conditions, from several unknown starts.

Each stage runs as independent tasks over a pool of processes: recordings, the map, the sequences of every condition and mode,
place recognition, kidnapping, and the paper's ten lengths. ``report`` writes what they found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from hippodrome.core.localization.beliefs.config import Mode
from hippodrome.core.mapping.mapper import Mapper
from hippodrome.core.refinement.refine import refine
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import HippodromeError
from hippodrome.eval.contest.entry import Added, entries_of
from hippodrome.eval.methods.materials import refine_config
from hippodrome.eval.methods.stages import map_recording
from hippodrome.eval.pool import Workers, worker_pool
from hippodrome.eval.run import RECORD_STAGES, load_scenarios, make_recordings
from hippodrome.eval.trials.robustness.conditions import CONDITIONS, SAME, chosen
from hippodrome.eval.trials.robustness.findings import Findings
from hippodrome.eval.trials.robustness.kidnapping import Kidnapping, kidnappings
from hippodrome.eval.trials.robustness.localize import localized_sequence, sequence_steps
from hippodrome.eval.trials.robustness.methods import FAR_M, MethodTask, describe_places, left_out, localizing, try_method
from hippodrome.eval.trials.robustness.paper_lengths import PaperSequence, paper_sequences
from hippodrome.eval.trials.robustness.place_recognition import half_known, queries_of, recognise
from hippodrome.eval.trials.robustness.recall import PlaceResult
from hippodrome.eval.trials.robustness.report import report_town, report_towns
from hippodrome.eval.trials.robustness.sequences import ELSEWHERE, MAIN_MODE, ConditionResult
from hippodrome.eval.trials.robustness.tables import conditions_markdown
from hippodrome.eval.trials.robustness.trial_drive import TrialDrive
from hippodrome.proto.codec import load_map, save_map
from hippodrome.sim.record import RecordingPlan, finish
from hippodrome.sim.render.probe import require_gl
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.survey import with_survey_error
from hippodrome.sim.town_spec import TownSpec

STAGES: Final = (*RECORD_STAGES, "map", "localize", "methods", "places", "kidnap", "lengths")  # of each town
ELSEWHERE_SEED: Final = 1_000  # added to the scenario's seed: another town of the same kind


@dataclass(frozen=True, slots=True)
class RobustnessRequest:
    """What the command line asks for."""

    scenarios: Sequence[Path]
    conditions: Sequence[str] | None  # None: all of them
    sequences: int  # unknown starts per condition
    only: int | None  # number of the only start to run, from 1: a failure run again
    modes: Sequence[Mode]
    workers: int
    out: Path
    methods: Sequence[Added] = ()  # that take part beside those that the scenarios name


@dataclass(frozen=True, slots=True)
class ConditionTask:
    """One condition of one scenario, localized in the finished map of ``mapped``."""

    name: str
    scenario: Scenario  # the scenario under the condition
    mapped: Scenario  # the scenario as it is written, whose mapping drive made the map
    out: Path
    sequences: int
    only: int | None
    mode: Mode = MAIN_MODE


def robustness(request: RobustnessRequest) -> None:
    """Write the robustness trial of each town and, if there are several, of all together. Raises HippodromeError on bad input."""
    scenarios = load_scenarios(request.scenarios, None, None, request.methods)
    for scenario in scenarios:
        entries_of(scenario)  # what cannot be loaded is said before anything is simulated
    conditions = chosen(request.conditions)
    if request.only is not None and request.only > request.sequences:
        raise HippodromeError(f"--start {request.only}: there are {request.sequences} starts, see --sequences")
    require_gl()
    with worker_pool(request.workers, STAGES, request.out) as pool:
        towns = {one.name: found for one in scenarios if (found := _town(one, conditions, request, pool)) is not None}
    if len(towns) > 1:
        report_towns(request.out, towns)


def _town(scenario: Scenario, conditions: Sequence[str], request: RobustnessRequest, pool: Workers) -> Findings | None:
    """Record, map once, localize under each condition, report. None if only one start was asked for, which is printed."""
    out, wanted = request.out, (request.out, request.sequences, request.only)
    tasks = [ConditionTask(name, CONDITIONS[name](scenario), scenario, *wanted) for name in conditions]
    away = ConditionTask(ELSEWHERE, elsewhere(scenario), scenario, *wanted)
    plans = [RecordingPlan(task.scenario, "localization", out) for task in [*tasks, away]]
    make_recordings([RecordingPlan(scenario, "mapping", out), *plans], pool)
    pool.run("map", _build_map, [(scenario, out)])
    by_mode = [replace(task, mode=mode) for mode in request.modes for task in tasks]
    results = pool.run("localize", _localize, [*by_mode, away])
    drives = tuple((task.name, task.scenario) for task in [*tasks, away])
    wanted_of = (drives, map_path(scenario, out), *wanted)
    tried = pool.run("methods", try_method, [MethodTask(label, scenario, *wanted_of) for label in localizing(scenario)])
    for one in tried:
        results += one.results
        if one.failure is not None:
            print(f"{scenario.name}: {one.label}: {one.failure}", flush=True)
    if request.only is not None:
        print(conditions_markdown(scenario.name, results))
        return None
    places = pool.run("places", _recognise, tasks)
    kidnapped = dict(zip(conditions, pool.run("kidnap", _kidnap, tasks), strict=True))
    paper = pool.run("lengths", _paper_lengths, tasks[:1])[0]
    path = map_path(scenario, out)
    failed = {**{one.label: one.failure for one in tried if one.failure is not None}, **left_out(scenario)}
    views = len(load_map(path)[0].view_cells.templates)
    found = Findings(results, places, kidnapped, paper, path.stat().st_size, views, failed)
    report_town(out / scenario.name, scenario.name, found)
    return found


def elsewhere(scenario: Scenario) -> Scenario:
    """A drive in another town: generated with another seed, or the default town if the scenario's is a file."""
    same = CONDITIONS[SAME](scenario)
    town = same.town if same.town.network is None else TownSpec()
    return same.model_copy(update={"name": f"{scenario.name}-elsewhere", "seed": scenario.seed + ELSEWHERE_SEED, "town": town})


def map_path(scenario: Scenario, out: Path) -> Path:
    """The file of the map that all conditions of the scenario are localized in."""
    return out / scenario.name / "robustness-map.pbstream"


def _build_map(task: tuple[Scenario, Path]) -> None:
    """Write the topometric map of the mapping drive, refined from an unknown start."""
    scenario, out = task
    recording = finish(RecordingPlan(scenario, "mapping", out))
    semi_metric, _ = map_recording(recording.observations(), Mapper(scenario.mapper))
    refined = refine(semi_metric, _roads(scenario, out), refine_config(scenario, "route"), None)
    save_map(map_path(scenario, out), refined.cognitive_map, {"scenario": scenario.name, "recording": recording.folder.name})


def _roads(scenario: Scenario, out: Path) -> RoadNetwork:
    """The network as surveyed on the mapping day: the conditions of the localization drive do not change it."""
    town = RecordingPlan(scenario, "mapping", out).town()
    rng = np.random.default_rng([scenario.seed, 2])
    return with_survey_error(town.network, scenario.self_motion_noise.survey_error_m, rng)


def _opened(task: ConditionTask) -> TrialDrive:
    """The recorded drive of a task, the map and the roads, read in the process that works on them."""
    drive = finish(RecordingPlan(task.scenario, "localization", task.out))
    cognitive_map, _ = load_map(map_path(task.mapped, task.out))
    config = replace(task.scenario.localizer, mode=task.mode)
    return TrialDrive(drive, list(drive.observations()), cognitive_map, _roads(task.mapped, task.out), config)


def _localize(task: ConditionTask) -> ConditionResult:
    """All sequences of a condition, or the only one that is wanted."""
    drive = _opened(task)
    truth = drive.recording.ground_truth()
    if task.name == ELSEWHERE:  # no place of this map is right
        truth = replace(truth, poses=truth.poses + np.array([FAR_M, FAR_M, 0.0]))
    numbered = enumerate(sequence_steps(drive.recording, task.sequences), start=1)
    found = [localized_sequence(number, steps, truth, drive) for number, steps in numbered if task.only in (None, number)]
    return ConditionResult(task.name, tuple(found), task.mode)


def _recognise(task: ConditionTask) -> PlaceResult:
    """Place recognition alone, in the map without one side of the town."""
    drive = finish(RecordingPlan(task.scenario, "localization", task.out))
    mapping = finish(RecordingPlan(task.mapped, "mapping", task.out))
    cognitive_map, config = half_known(load_map(map_path(task.mapped, task.out))[0]), task.scenario.localizer
    queries = queries_of(drive, config)
    others, failed = describe_places(task.mapped, cognitive_map, mapping, queries, task.out)
    return PlaceResult(task.name, (*recognise(cognitive_map, mapping, queries, config), *others), failed)


def _kidnap(task: ConditionTask) -> tuple[Kidnapping, ...]:
    return kidnappings(_opened(task), task.sequences)


def _paper_lengths(task: ConditionTask) -> tuple[PaperSequence, ...]:
    return paper_sequences(_opened(task))
