"""The world in the loop: the same again from the same seed, and a car that can be driven."""

import hashlib

import numpy as np
import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.sim.loop.types import LanePlace
from hippodrome.sim.loop.world import World
from tests.sim.loop import small


def fingerprint(sensed):
    o = sensed.observation
    frame = b"" if o.frame is None else o.frame.tobytes()
    return hashlib.sha256(
        repr((o.t_s, o.speed, o.yaw_rate_radps, sensed.radar, sensed.truth, sensed.events)).encode() + frame
    ).hexdigest()


def driven(world, seed, steps):
    sensed = world.reset(seed)
    prints = [fingerprint(sensed)]
    for _ in range(steps):
        sensed = world.step(*small.keeper(world, sensed))
        prints.append(fingerprint(sensed))
    return prints


def test_same_seed_and_commands_give_the_same_bytes(tmp_path):
    scenario = small.scenario(vehicles=8)
    with World(scenario, tmp_path) as world:
        first, again, other = driven(world, 5, 60), driven(world, 5, 60), driven(world, 6, 3)
    assert first == again
    assert first[:4] != other
    with World(scenario, tmp_path) as world:
        assert driven(world, 5, 20) == first[:21]
    assert len(set(first)) == len(first)


@pytest.mark.parametrize("kind", ["grid", "rural", "radial"])
def test_a_lane_keeper_stays_in_its_lane(tmp_path, kind):
    town = {"kind": kind, "width_m": 200, "height_m": 200, "road_km": 1.6}
    with World(small.scenario(vehicles=5, town=town), tmp_path, draw=False) as world:
        sensed = world.reset(1)
        for _ in range(400):
            sensed = world.step(*small.keeper(world, sensed))
            assert sensed.truth.lane >= 0
            assert sensed.truth.wheel_outside_m < 0.6
        assert sensed.truth.driven_m > 50.0
        assert world.put_back == 0


def test_the_start_is_where_it_was_told(tmp_path):
    with World(small.scenario(), tmp_path, draw=False) as world:
        lane = int(np.flatnonzero(~world.network.is_internal)[0])
        truth = world.reset(1, LanePlace(world.network.lane_ids[lane], 6.0)).truth
        assert truth.lane == lane
        assert truth.lane_position_m == pytest.approx(6.0, abs=0.01)
        assert truth.offset_m == pytest.approx(0.0, abs=0.01)
        with pytest.raises(HippodromeError, match="no lane 'nowhere'"):
            world.reset(1, LanePlace("nowhere", 6.0))
