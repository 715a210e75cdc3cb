"""One small town, driven, drawn and evaluated once for all end-to-end tests, on real SUMO and real GL."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from hippodrome.eval.cli import main
from hippodrome.sim.record import RecordingPlan
from hippodrome.sim.recording import Recording, open_recording
from hippodrome.sim.scenario import load_scenario

SCENARIO = """\
name: hamlet
seed: 3
town: {kind: grid, width_m: 190, height_m: 190, road_km: 1.3}
camera: {rate_hz: 5}
mapping:
  tour: {length_m: 1500}
  traffic: {vehicles: 4}
localization:
  tour: {length_m: 500}
  traffic: {vehicles: 4}
"""


@dataclass(frozen=True)
class Run:
    """A finished ``hippodrome eval``."""

    scenario: Path
    out: Path
    status: int

    def recording(self, role: str) -> Recording:
        return open_recording(RecordingPlan(load_scenario(self.scenario), role, self.out).folder())


@pytest.fixture(scope="session")
def run(tmp_path_factory) -> Run:
    folder = tmp_path_factory.mktemp("e2e")
    scenario = folder / "hamlet.yaml"
    scenario.write_text(SCENARIO)
    status = main(["eval", str(scenario), "--workers", "2", "--out", str(folder / "two")])
    return Run(scenario, folder / "two", status)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a recording and its road network, whole; tests break copies of them."""
    from tests.subjects import net, recording  # which import the simulator, where a test asks for it

    folder = tmp_path_factory.mktemp("made")
    recording(folder)
    net(folder)
    return folder
