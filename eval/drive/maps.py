"""The map that missions are driven on: made of the scenario's own mapping drive, once for each scenario."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from hippodrome._files import PACKAGE, code_sha256
from hippodrome.core.mapping.mapper import Mapper
from hippodrome.core.refinement.refine import refine
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap
from hippodrome.eval.methods.materials import refine_config
from hippodrome.eval.methods.stages import map_recording
from hippodrome.proto.codec import load_map, save_map
from hippodrome.sim.record import RecordingPlan, finish
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.survey import with_survey_error

MAP_CODE: Final = (  # all code that a map comes from, beside that of its recording: who drives on it changes no map
    "core/*.py",
    *(f"core/{room}/**/*.py" for room in ("attractors", "mapping", "matching", "refinement", "roads", "solvers", "views")),
    "proto/**/*.py",
)


@dataclass(frozen=True, slots=True)
class MapTask:
    """A scenario whose mapping drive is recorded below ``out``."""

    scenario: Scenario
    out: Path

    def plan(self) -> RecordingPlan:
        return RecordingPlan(self.scenario, "mapping", self.out)

    def key(self) -> str:
        """A name for all that the map's bytes depend on."""
        kept = self.scenario.model_dump(mode="json", include={"mapper", "refine", "noise"})
        what = json.dumps([self.plan().content(), kept, code_sha256(PACKAGE, MAP_CODE)], sort_keys=True, default=str)
        return hashlib.sha256(what.encode()).hexdigest()[:16]

    def file(self) -> Path:
        """Where the map is, or will be."""
        return self.out / self.scenario.name / f"map-{self.key()}.pbstream"


def make_map(task: MapTask) -> Path:
    """The map's file; a map that is there is not made again.

    Raises:
        HippodromeError: no map can be made of the drive, or the refinement vouches for none of it.
    """
    file = task.file()
    if file.exists():
        return file
    file.parent.mkdir(parents=True, exist_ok=True)
    recording = finish(task.plan())
    semi_metric, _ = map_recording(recording.observations(), Mapper(task.scenario.mapper))
    refined = refine(semi_metric, surveyed(task.scenario, task.out), refine_config(task.scenario, "route"), None).cognitive_map
    save_map(file, refined, {"scenario": task.scenario.name, "recording": recording.folder.name})
    return file


def surveyed(scenario: Scenario, out: Path) -> RoadNetwork:
    """The road network as surveyed: what the refinement, the localizer and the navigator are given."""
    town = RecordingPlan(scenario, "mapping", out).town()
    rng = np.random.default_rng([scenario.seed, 2])
    return with_survey_error(town.network, scenario.self_motion_noise.survey_error_m, rng)


def read_map(file: Path) -> CognitiveMap:
    """The map of a scenario. Raises HippodromeError."""
    return load_map(file)[0]
