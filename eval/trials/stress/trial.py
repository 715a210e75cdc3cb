"""One stress case: do to a recorded drive's map and roads what the case says, refine, and score against the truth."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from time import process_time

import numpy as np

from hippodrome.core.mapping.mapper import Mapper
from hippodrome.core.refinement.refine import refine
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.se2 import interpolate
from hippodrome.core.types import CognitiveMap, FloatArray, HippodromeError, MatchStatus, StartPose, Trajectory
from hippodrome.eval.contest.entry import Entry
from hippodrome.eval.contest.trials import map_alone
from hippodrome.eval.methods.materials import RPE_DELTA_M, Materials, refine_config
from hippodrome.eval.methods.stages import map_recording
from hippodrome.eval.methods.warm_up import warm_up
from hippodrome.eval.metrics.calibration import nees, pose_errors
from hippodrome.eval.metrics.trajectory import ape, rpe
from hippodrome.eval.trials.stress.cases import FOREIGN_SEED, StressCase
from hippodrome.eval.trials.stress.perturbations import driven_streets, with_false_closures, without_roads
from hippodrome.eval.trials.stress.rows import FAR_M, WRONG_M, StressRow
from hippodrome.sim.record import sensed_anew
from hippodrome.sim.recording import Recording
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.self_motion import NOISE_LEVELS, SelfMotionNoise
from hippodrome.sim.survey import with_survey_error
from hippodrome.sim.town import build_town
from hippodrome.sim.types import Town


@dataclass(frozen=True, slots=True, eq=False)
class StressedDrive:
    """A recorded drive that several cases share, with the maps made of it so far."""

    scenario: Scenario
    recording: Recording
    town: Town
    towns_folder: Path  # where other towns are generated
    maps: dict[str, CognitiveMap] = field(default_factory=dict)  # by the self-motion's noise, as JSON

    def map_under(self, noise: SelfMotionNoise) -> CognitiveMap:
        """The semi-metric map of the drive with its self-motion sensed anew under ``noise``; built when first asked for."""
        key = noise.model_dump_json()
        if key not in self.maps:
            sensed = sensed_anew(self.recording, noise, np.random.default_rng([self.scenario.seed, 3]))
            self.maps[key], _ = map_recording(sensed.observations(), Mapper(self.scenario.mapper))
        return self.maps[key]


def run_case(case: StressCase, drive: StressedDrive, rerun: str) -> StressRow:
    """Refine the drive's map under one case and score it.

    Args:
        case: What goes wrong.
        drive: The recorded drive; it keeps the map for later cases of the same self-motion.
        rerun: The command that runs this case alone, kept in the row.
    """
    warm_up()
    scenario = drive.scenario
    semi_metric = drive.map_under(case.self_motion(scenario.noise))
    rng = np.random.default_rng([scenario.seed, 4])
    semi_metric = with_false_closures(semi_metric, case.false_closures, rng)
    survey_error_m = max(case.survey_error_m, NOISE_LEVELS[case.noise].survey_error_m)
    roads = _roads_under(case, drive, survey_error_m, rng)
    start = StartPose(*(float(value) for value in drive.recording.ground_truth().poses[0])) if case.start_known else None
    row = StressRow(scenario.name, scenario.seed, case.name, len(semi_metric.t_s), rerun=rerun)
    began = process_time()
    try:
        refined = refine(semi_metric, roads, refine_config(scenario, "route", survey_error_m), start).cognitive_map
    except HippodromeError as error:
        return replace(row, failure=str(error), cpu_s=process_time() - began)
    row = _scored(replace(row, cpu_s=process_time() - began), refined, drive.recording)
    if case.foreign:  # no vertex is on a road of that network
        return row
    return replace(row, right_share=_right_share(refined, drive.recording, drive.town.network, roads))


def run_method(case: StressCase, drive: StressedDrive, entry: Entry, rerun: str) -> StressRow:
    """Give a method beside ours the case's self-motion and roads, and score its trajectory as it lies.

    False loop closures are errors of our own map; it has none of them. It vouches for all of its poses.

    Args:
        case: What goes wrong.
        drive: The recorded drive.
        entry: A method that maps, and answers in the network's frame.
        rerun: The command that runs this case alone, kept in the row.
    """
    warm_up()
    scenario, recording = drive.scenario, drive.recording
    sensed = sensed_anew(recording, case.self_motion(scenario.noise), np.random.default_rng([scenario.seed, 3]))
    survey_error_m = max(case.survey_error_m, NOISE_LEVELS[case.noise].survey_error_m)
    roads = _roads_under(case, drive, survey_error_m, np.random.default_rng([scenario.seed, 4]))
    materials = Materials(scenario, drive.towns_folder.parent / scenario.name, drive.town, roads, sensed, sensed)
    materials.folder.mkdir(parents=True, exist_ok=True)
    row = StressRow(scenario.name, scenario.seed, case.name, 0, method=entry.method.label, rerun=rerun)
    try:
        trajectory, cpu_s = map_alone(entry, materials)
        truth = recording.ground_truth()
        absolute, relative = ape(trajectory, truth), rpe(trajectory, truth, RPE_DELTA_M)
    except HippodromeError as error:
        return replace(row, failure=str(error))
    errors_m = absolute.errors_m
    return replace(
        row,
        vertices=len(errors_m),
        matched_share=1.0,
        wrong=int(np.count_nonzero(errors_m > WRONG_M)),
        far=int(np.count_nonzero(errors_m > FAR_M)),
        ape_mean_m=absolute.mean_m,
        ape_max_m=float(errors_m.max()),
        ape_all_mean_m=absolute.mean_m,
        rpe_20m_mean_m=relative.mean_m,
        cpu_s=cpu_s,
    )


def _roads_under(case: StressCase, drive: StressedDrive, survey_error_m: float, rng: np.random.Generator) -> RoadNetwork:
    """The road network that the refinement is given: the town's or another town's, displaced, with driven roads missing."""
    roads = drive.town.network
    if case.foreign:  # an imported town, too, is answered with a generated one
        elsewhere = drive.scenario.town.model_copy(update={"network": None})
        roads = build_town(elsewhere, drive.scenario.seed + FOREIGN_SEED, drive.towns_folder).network
    roads = with_survey_error(roads, survey_error_m, rng)
    return without_roads(roads, driven_streets(drive.recording, drive.town.network, case.missing_roads, rng))


def _scored(row: StressRow, refined: CognitiveMap, recording: Recording) -> StressRow:
    """The row with errors of the vertices against the truth, in the network's frame, without alignment."""
    truth = recording.ground_truth()
    estimate = Trajectory(refined.t_s, refined.poses)
    absolute, relative = ape(estimate, truth), rpe(estimate, truth, RPE_DELTA_M)
    assert refined.road_match is not None
    vouched = refined.road_match.status == MatchStatus.MATCHED
    row = replace(row, matched_share=float(vouched.mean()), ape_all_mean_m=absolute.mean_m)
    if not vouched.any():
        return replace(row, failure="no vertex is vouched for")
    errors_m = absolute.errors_m[vouched]
    offsets = pose_errors(refined.poses, interpolate(truth.t_s, truth.poses, refined.t_s))
    spread = None if refined.covariance is None else float(nees(offsets[vouched], refined.covariance[vouched]).mean() / 3.0)
    return replace(
        row,
        wrong=int(np.count_nonzero(errors_m > WRONG_M)),
        far=int(np.count_nonzero(errors_m > FAR_M)),
        ape_mean_m=float(errors_m.mean()),
        ape_max_m=float(errors_m.max()),
        rpe_20m_mean_m=relative.mean_m,
        nees=spread,
    )


def _right_share(refined: CognitiveMap, recording: Recording, driven: RoadNetwork, roads: RoadNetwork) -> float:
    """Share of the vertices on lanes that ``roads`` has that are vouched for and less than ``FAR_M`` off.

    ``driven`` is the town's own network, in which the recording says on which lane the vehicle was.
    """
    samples = recording.samples
    nearest = np.clip(np.searchsorted(samples.t_s, refined.t_s - 1e-9), 0, len(samples.t_s) - 1)
    on_known_lane = np.isin(np.array(driven.lane_ids)[samples.lane[nearest]], roads.lane_ids)
    errors_m: FloatArray = ape(Trajectory(refined.t_s, refined.poses), recording.ground_truth()).errors_m
    assert refined.road_match is not None
    right = (refined.road_match.status == MatchStatus.MATCHED) & (errors_m < FAR_M)
    return float(np.mean(right[on_known_lane]))
