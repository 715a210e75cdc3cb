"""What one evaluation starts from, and what it learns about each method on the way to rows and pictures."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from hippodrome.core.refinement.config import RefineConfig
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, FloatArray, HippodromeError, StartPose, Trajectory
from hippodrome.eval.files.scenarios import effective_configuration
from hippodrome.eval.methods.method import Method, RefineMode
from hippodrome.eval.methods.protocol import Mapped
from hippodrome.eval.methods.stages import Localization
from hippodrome.eval.metrics.alignment import AlignmentName
from hippodrome.eval.metrics.localization import LocalizationScore
from hippodrome.eval.metrics.trajectory import Score, ape, rpe
from hippodrome.sim.record import RecordingPlan, finish
from hippodrome.sim.recording import Recording
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.survey import with_survey_error
from hippodrome.sim.types import Town

RPE_DELTA_M: Final = 20.0  # the paper does not say its own; with about this, its semi-metric map would have the 9.4 m it prints


@dataclass(frozen=True, slots=True, eq=False)
class Materials:
    """The inputs of one evaluation, and the folder that its files go to."""

    scenario: Scenario
    folder: Path
    town: Town
    roads: RoadNetwork  # the network as surveyed, which the refinement and the localizer are given
    mapping: Recording  # the drive that the map is made of
    drive: Recording  # the second drive, which is localized in the map

    @property
    def truth_folders(self) -> tuple[Path, ...]:
        """Folders that the truth can be read from: the recordings, and this scenario's results."""
        return self.mapping.folder.parent, self.folder

    @property
    def duration_s(self) -> float:
        """Duration of the mapping drive."""
        return float(self.mapping.samples.t_s[-1])

    def provenance(self, method: Method) -> dict[str, str]:
        """What a map file says about how it was made."""
        configuration = json.dumps(effective_configuration(self.scenario), sort_keys=True)
        return {"method": method.label, "scenario": configuration, "recording": self.mapping.folder.name}


def gather(scenario: Scenario, out: Path, *, truthless: bool = False) -> Materials:
    """The finished recordings of a scenario below ``out``, and its road network as surveyed. Makes the scenario's folder.

    Args:
        scenario: The scenario.
        out: Folder of the results.
        truthless: Whether drives of which the truth is not known are taken as well, as far as they go.

    Raises:
        HippodromeError: A recording cannot be read, or has no truth and is not to be taken without.
    """
    mapping, drive = RecordingPlan(scenario, "mapping", out), RecordingPlan(scenario, "localization", out)
    town = mapping.town()
    rng = np.random.default_rng([scenario.seed, 2])
    roads = with_survey_error(town.network, scenario.self_motion_noise.survey_error_m, rng)
    recordings = finish(mapping), finish(drive)
    for recording in recordings:
        if not truthless and (cause := why_unscored(recording)) is not None:
            raise HippodromeError(f"{recording.folder}: {cause}")
    folder = out / scenario.name
    folder.mkdir(parents=True, exist_ok=True)
    return Materials(scenario, folder, town, roads, *recordings)


def why_unscored(recording: Recording) -> str | None:
    """Why nothing can be scored on a recording: its truth is not known at all steps in the road network's frame. None: it is."""
    known = np.isfinite(recording.samples.poses_m).all(axis=1)
    if not known.all():
        share = f"is known for {known.mean():.0%} of its steps only" if known.any() else "is not known"
        return f"the truth of the drive {share}; import it with --truth and --truth-frame network to have errors"
    if getattr(recording, "manifest", {}).get("truth_frame", "network") != "network":
        cure = "import it with --truth-frame network if it lies there"
        return f"the truth of the drive lies in a frame of its own, not in the road network's; {cure}"
    return None


def truth_of(recording: Recording) -> Trajectory | None:
    """The truth of a recording, if methods can be scored by it."""
    return recording.ground_truth() if why_unscored(recording) is None else None


def true_start(drive: Recording) -> StartPose:
    """Where a drive really began, for methods that are told."""
    return StartPose(*(float(value) for value in drive.ground_truth().poses[0]))


def refine_config(scenario: Scenario, mode: RefineMode, survey_error_m: float | None = None) -> RefineConfig:
    """The scenario's configuration of the refinement in one mode, told how accurate the road network is.

    Surveyors state the accuracy of their networks, which is then taken as known exactly. A value that the scenario sets itself
    stands.

    Args:
        scenario: Where the configuration is from.
        mode: Mode of the refinement.
        survey_error_m: Standard deviation of the error of the network that is given, if it is not the scenario's own network.
    """
    config = scenario.refine
    if survey_error_m is None:
        survey_error_m = scenario.self_motion_noise.survey_error_m
    solver = config.route.solver
    stated = solver
    if solver.survey_sigma_m is None:
        stated = replace(solver, survey_sigma_m=survey_error_m, survey_freedom=None)
    return replace(config, mode=mode, route=replace(config.route, solver=stated))


@dataclass(frozen=True, slots=True, eq=False)
class ScoredTrajectory:
    """A method's trajectory and its errors."""

    trajectory: Trajectory
    alignment: AlignmentName  # how the trajectory was laid over the truth for its APE
    ape: Score
    rpe: Score  # between consecutive samples
    rpe_20m: Score  # between samples ``RPE_DELTA_M`` apart


def score_trajectory(trajectory: Trajectory, truth: Trajectory, alignment: AlignmentName) -> ScoredTrajectory:
    """APE and both RPEs of a trajectory. ``Method.alignment`` is how a method's trajectory is aligned.

    Raises:
        HippodromeError: The truth covers too little of the trajectory, or no two samples are ``RPE_DELTA_M`` apart.
    """
    return ScoredTrajectory(
        trajectory, alignment, ape(trajectory, truth, alignment), rpe(trajectory, truth), rpe(trajectory, truth, RPE_DELTA_M)
    )


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What one method came to on one scenario: its map of the first drive, and how the second was localized in it."""

    method: Method
    mapped: Mapped
    scored: ScoredTrajectory
    cpu_s: float  # of its map, together with the map that it builds on
    own_cpu_s: float  # of its map alone
    step_s: FloatArray  # (N,) from handing it an observation of the mapping drive until it was done with it; empty if it saw none
    map_bytes: int | None = None
    covered: float = 1.0  # share of the times at which it was to be scored for which it has a pose
    peak_rss_bytes: int | None = None  # of a process of its own, if it has one
    localization: Localization | None = None
    localized: LocalizationScore | None = None
    failure: str | None = None  # why it has no localization, if it should have one

    @property
    def trajectory(self) -> Trajectory:
        """Its trajectory at the scored times."""
        return self.scored.trajectory

    @property
    def refined(self) -> CognitiveMap | None:
        """Its topometric map, if it made one of our kind."""
        found = self.mapped.cognitive_map
        return found if found is not None and found.frame == "network" else None


@dataclass(frozen=True, slots=True, eq=False)
class Unscored:
    """What one method came to on a mapping drive without truth."""

    method: Method
    trajectory: Trajectory
    localization: Localization | None = None
