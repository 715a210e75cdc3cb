"""Drives in the loop, written as recordings like all others."""

import numpy as np
import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.sim.loop.world import World
from hippodrome.sim.record import read_drive
from hippodrome.sim.recording import open_recording
from hippodrome.sim.traffic import traffic_at
from tests.sim.loop import small


def test_a_drive_is_read_back_as_it_was(tmp_path):
    with World(small.scenario(vehicles=4, camera={"rate_hz": 5}), tmp_path) as world:
        with world.recording(tmp_path / "drive"):
            sensed = [world.reset(2)]
            for _ in range(40):
                sensed.append(world.step(*small.keeper(world, sensed[-1])))
        world.step(0.0, 0.0)
    recording = open_recording(tmp_path / "drive")
    steps = list(recording)
    assert len(steps) == 41
    assert recording.frame_count == 21
    for (observation, truth), was in zip(steps, sensed, strict=True):
        assert observation.speed == was.observation.speed
        assert truth == was.truth.ground_truth()
        assert (observation.frame is None) == (was.observation.frame is None)
        if observation.frame is not None:
            np.testing.assert_array_equal(observation.frame, was.observation.frame)
    drive = read_drive(tmp_path / "drive" / "drive.npz")
    np.testing.assert_allclose(traffic_at(drive.traffic, 2.0)[0], sensed[20].traffic)


def test_nothing_is_overwritten_and_an_empty_drive_is_none(tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "something").write_text("")
    with World(small.scenario(), tmp_path, draw=False) as world:
        with pytest.raises(HippodromeError, match="nothing is overwritten"), world.recording(tmp_path / "full"):
            pass
        with pytest.raises(HippodromeError, match="no drive was made"), world.recording(tmp_path / "empty"):
            pass
        with world.recording(tmp_path / "off"):
            world.reset(1)
            world.teleport((-500.0, -500.0, 0.0))
            for _ in range(3):
                world.step(1.0, 0.0)
    recording = open_recording(tmp_path / "off")
    assert recording.samples.ground_truth(3).lane_id == ""
    assert recording.manifest["role"] == "loop"
    assert {event["kind"] for event in recording.manifest["events"]} == {"kerb", "left road"}
