"""A tiny town whose mapping drive is recorded and mapped once for all tests of missions."""

import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from hippodrome.core.navigation.types import Goal
from hippodrome.eval.drive.drivers import Cockpit
from hippodrome.eval.drive.maps import MapTask, make_map, surveyed
from hippodrome.eval.drive.missions import Mission, pose_of
from hippodrome.eval.drive.rows import RowSpec
from hippodrome.eval.drive.run import DriveRequest
from hippodrome.eval.drive.task import missions_of
from hippodrome.eval.pool import worker_pool
from hippodrome.eval.run import make_recordings
from hippodrome.sim.loop.world import World
from hippodrome.sim.record import RecordingPlan
from hippodrome.sim.render.probe import require_gl
from hippodrome.sim.scenario import Scenario, load_scenario
from tests.eval.report.conftest import browser  # noqa: F401  # of the pages

TOWN = """
name: hamlet
seed: 5
town: {kind: grid, width_m: 130, height_m: 130, road_km: 0.8}
camera: {rate_hz: 5}
noise: paper
mapping:
  tour: {length_m: 500}
  traffic: {vehicles: 0}
localization:
  tour: {length_m: 300}
  traffic: {vehicles: 2}
"""


@dataclass(frozen=True)
class Hamlet:
    """The town: its scenario, the folder with its recording, and its map."""

    file: Path
    out: Path
    scenario: Scenario
    map_file: Path

    def request(self, out: Path, **changed) -> DriveRequest:
        """What drives one mission with its true pose into a folder of its own."""
        if not out.exists():
            out.mkdir()
            for name in ("recordings", "towns"):
                (out / name).symlink_to(self.out / name)
            (out / "hamlet").mkdir()
            shutil.copy(self.map_file, out / "hamlet")
        return replace(DriveRequest([self.file], None, None, 1, ["truth"], 1, out), **changed)

    def mission(self) -> Mission:
        """Its first mission."""
        return missions_of(self.scenario, self.map_file, self.out, 1)[0]

    def cockpit(self, row: RowSpec) -> Cockpit:
        """What the driver of a row is made of."""
        roads, mission = surveyed(self.scenario, self.out), self.mission()
        goal = Goal(*pose_of(roads, mission.goal_lane, mission.goal_m))
        return Cockpit(self.scenario, row, self.map_file, roads, goal)

    def world(self) -> World:
        """The town in the loop."""
        return World(self.scenario, self.out)


@pytest.fixture(scope="session")
def hamlet(tmp_path_factory):
    require_gl()
    folder = tmp_path_factory.mktemp("hamlet")
    (folder / "hamlet.yaml").write_text(TOWN)
    scenario, out = load_scenario(folder / "hamlet.yaml"), folder / "out"
    with worker_pool(1) as pool:
        make_recordings([RecordingPlan(scenario, "mapping", out)], pool)
        (map_file,) = pool.run("map", make_map, [MapTask(scenario, out)])
    return Hamlet(folder / "hamlet.yaml", out, scenario, map_file)
