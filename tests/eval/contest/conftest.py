"""A drive round a circle without simulator: what a contest needs of materials."""

from types import SimpleNamespace

import numpy as np
import pytest

from hippodrome.core import se2
from hippodrome.core.types import Observation, Trajectory
from hippodrome.sim.scenario import Scenario
from tests.eval.contest.entrants import ENTRANTS

STEP_S, STEPS, SPEED_MPS, RADIUS_M = 0.1, 600, 5.0, 40.0


class Drive:
    """A recording: three times round a circle at a constant speed, a grey frame at every second step."""

    def __init__(self, folder):
        self.folder = folder
        t_s = STEP_S * (1 + np.arange(STEPS))
        turn = SPEED_MPS / RADIUS_M * t_s
        poses = np.column_stack([RADIUS_M * np.sin(turn), RADIUS_M * (1.0 - np.cos(turn)), se2.wrap(turn)])
        number = np.where(np.arange(STEPS) % 2 == 0, np.arange(STEPS) // 2, -1)
        self.samples = SimpleNamespace(t_s=t_s, poses_m=poses, frame=number, observation=self.step)
        self.manifest = {}

    def step(self, i, frame):
        return Observation(float(self.samples.t_s[i]), STEP_S, SPEED_MPS, SPEED_MPS / RADIUS_M, frame)

    def frame(self, number, side=""):
        return np.full((12, 16, 3), (2 * number + bool(side)) % 256, np.uint8)  # the right image is brighter by one

    def observations(self):
        for i, number in enumerate(self.samples.frame):
            yield self.step(i, self.frame(number) if number >= 0 else None)

    def self_motion(self):
        return (Observation(o.t_s, o.dt_s, o.speed, o.yaw_rate_radps) for o in self.observations())

    def ground_truth(self):
        return Trajectory(self.samples.t_s, self.samples.poses_m)


@pytest.fixture
def materials(tmp_path):
    folder = tmp_path / "results"
    folder.mkdir()
    recordings = tmp_path / "recordings"
    (recordings / "one").mkdir(parents=True)
    (recordings / "one/truth.txt").write_text("the truth\n")
    drive = Drive(recordings / "one")
    return SimpleNamespace(scenario=Scenario(name="circle"), folder=folder, mapping=drive, drive=drive, roads="the roads",
                           duration_s=STEPS * STEP_S, truth_folders=(recordings, folder),
                           provenance=lambda method: {"method": method.label})  # fmt: skip


@pytest.fixture
def entrants(tmp_path, monkeypatch):
    """The module of that name with the classes of ``ENTRANTS``, where modules are looked for."""
    (tmp_path / "entrants.py").write_text(ENTRANTS)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
