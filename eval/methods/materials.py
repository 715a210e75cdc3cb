"""What one evaluation starts from, and what it finds on the way to rows and pictures."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from hippodrome.core.refinement.refine import RefineConfig
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import Refinement, Trajectory
from hippodrome.eval.methods.stages import Localization
from hippodrome.eval.metrics.alignment import AlignmentName
from hippodrome.eval.metrics.localization import LocalizationScore
from hippodrome.eval.metrics.trajectory import Score, ape, rpe
from hippodrome.sim.record import RecordingPlan, finish
from hippodrome.sim.recording import Recording
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.survey import with_survey_error
from hippodrome.sim.types import Town

RPE_DELTA_M = 20.0  # the paper's 9.4 m for its semi-metric map fits a delta of about this


@dataclass(frozen=True, slots=True, eq=False)
class Materials:
    """The inputs of one evaluation."""

    scenario: Scenario
    folder: Path
    town: Town
    roads: RoadNetwork  # as surveyed: what the refinement and the localizer are given
    mapping: Recording
    drive: Recording  # to localize

    @property
    def duration_s(self) -> float:
        return float(self.mapping.samples.t_s[-1])


def gather(scenario: Scenario, out: Path) -> Materials:
    """The finished recordings of a scenario below ``out``, and its road network as surveyed."""
    mapping, drive = RecordingPlan(scenario, "mapping", out), RecordingPlan(scenario, "localization", out)
    town = mapping.town()
    rng = np.random.default_rng([scenario.seed, 2])
    roads = with_survey_error(town.network, scenario.self_motion_noise.survey_error_m, rng)
    folder = out / scenario.name
    folder.mkdir(parents=True, exist_ok=True)
    return Materials(scenario, folder, town, roads, finish(mapping), finish(drive))


def refine_config(scenario: Scenario, mode: Literal["route", "paper"], survey_error_m: float | None = None) -> RefineConfig:
    """The scenario's refinement in one mode, told how accurate the road network is: surveyors state that, no drive can show it.

    ``survey_error_m``: of the network that is given, where it is not the scenario's own. A value set in the scenario stands.
    """
    config = scenario.refine
    if survey_error_m is None:
        survey_error_m = scenario.self_motion_noise.survey_error_m
    solver = config.route.solver
    stated = replace(solver, survey_sigma_m=solver.survey_sigma_m or survey_error_m)
    return replace(config, mode=mode, route=replace(config.route, solver=stated))


@dataclass(frozen=True, slots=True, eq=False)
class Scored:
    """A method's trajectory and its errors. A method without a metric frame is placed at the drive's start, not scaled."""

    trajectory: Trajectory
    alignment: AlignmentName  # of the APE
    ape: Score
    rpe: Score  # consecutive vertices
    rpe_20m: Score


def score_trajectory(trajectory: Trajectory, truth: Trajectory, metric: bool) -> Scored:
    """APE (no alignment at all if ``metric``, at the start if not) and RPE of a trajectory."""
    alignment: AlignmentName = "none" if metric else "start"
    return Scored(
        trajectory, alignment, ape(trajectory, truth, alignment), rpe(trajectory, truth), rpe(trajectory, truth, RPE_DELTA_M)
    )


@dataclass(frozen=True, slots=True, eq=False)
class Topometric:
    """What one refinement mode gave, and how a second drive fared in its map."""

    refinement: Refinement
    scored: Scored
    map_bytes: int
    cpu_s: float
    localization: Localization
    localized: LocalizationScore


def file_stem(method: str) -> str:
    """A method's name as a file name: ``topometric (paper)`` becomes ``topometric-paper``."""
    return method.replace(" (", "-").replace(")", "").replace(",", "").replace(" ", "-")
