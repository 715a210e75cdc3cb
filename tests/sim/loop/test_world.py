"""The world in the loop: the same again from the same seed, and a car that can be driven."""

import hashlib

import libsumo
import numpy as np
import pytest

from hippodrome.core.navigation.types import Indicator
from hippodrome.core.types import HippodromeError
from hippodrome.sim.loop.odometry import Odometry
from hippodrome.sim.loop.types import EventKind, LanePlace
from hippodrome.sim.loop.world import World
from hippodrome.sim.self_motion import NOISE_LEVELS, SelfMotionNoise
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
    with World(small.scenario(), tmp_path, draw=False) as world, pytest.raises(HippodromeError, match="m long"):
        world.reset(1, LanePlace(world.network.lane_ids[lane], 1e4))


def test_traffic_queues_behind_a_standing_ego(tmp_path):
    with World(small.scenario(town=small.crossing(tmp_path)), tmp_path, draw=False) as world:
        world.reset(1, LanePlace("w-c_0", 60.0))
        small.car("b900", ["w-c", "c-e"], 10.0, 8.0)
        for _ in range(200):
            sensed = world.step(0.0, 0.0)
            assert sensed.events == ()
        rear = 60.0 - 120.0 - 0.9
        assert libsumo.vehicle.getSpeed("b900") < 0.1
        assert 0.0 < rear - libsumo.vehicle.getPosition("b900")[0] < 4.0


def test_an_ego_that_sumo_took_away_is_put_back(tmp_path):
    with World(small.scenario(town=small.crossing(tmp_path)), tmp_path, draw=False) as world:
        sensed = world.reset(1, LanePlace("w-c_0", 60.0))
        libsumo.vehicle.remove("ego")
        sensed = world.step(1.0, 0.0)
        assert [event.kind for event in sensed.events] == [EventKind.PUT_BACK]
        sensed = world.step(1.0, 0.0)
        assert sensed.events == ()
        assert libsumo.vehicle.getLaneID("ego") == "w-c_0"
        assert world.put_back == 1


def test_off_the_road_and_back_again(tmp_path):
    with World(small.scenario(town=small.crossing(tmp_path)), tmp_path, draw=False) as world:
        world.reset(1, LanePlace("w-c_0", 60.0))
        world.teleport((500.0, 500.0, 1.0))
        sensed = world.step(1.0, 0.0)
        assert (sensed.truth.lane, sensed.truth.lane_id, sensed.truth.on_paving) == (-1, "", False)
        world.teleport((-60.0, -1.6, 0.0))
        for _ in range(3):
            sensed = world.step(1.0, 0.0)
        assert sensed.truth.lane_id == "w-c_0"
        assert libsumo.vehicle.getLaneID("ego") == "w-c_0"


def test_a_second_world_takes_over(tmp_path):
    one, two = World(small.scenario(), tmp_path), World(small.scenario(), tmp_path)
    one.reset(1)
    frame = two.reset(1).observation.frame
    with pytest.raises(HippodromeError, match="another world"):
        one.step(0.0, 0.0)
    np.testing.assert_array_equal(one.reset(1).observation.frame, frame)
    one.close()
    two.close()


def test_commands_that_are_no_numbers_are_refused(tmp_path):
    with World(small.scenario(), tmp_path, draw=False) as world:
        with pytest.raises(HippodromeError, match="before reset"):
            world.step(0.0, 0.0)
        world.reset(1)
        with pytest.raises(HippodromeError, match="not two finite numbers"):
            world.step(float("nan"), 0.0)


def test_a_network_without_lanes_in_junctions_is_crossed(tmp_path):
    town = small.crossing(tmp_path, options=("--no-internal-links=true",))
    with World(small.scenario(town=town), tmp_path, draw=False) as world:
        world.reset(1, LanePlace("w-c_0", 90.0))
        for _ in range(120):
            sensed = world.step(1.0, 0.0)
        assert sensed.truth.lane_id == "c-e_0"
        assert libsumo.vehicle.getLaneID("ego") == "c-e_0"


def test_a_town_that_keeps_left(tmp_path):
    town = small.crossing(tmp_path, options=("--lefthand=true",))
    with World(small.scenario(town=town), tmp_path, draw=False) as world:
        for indicator in Indicator:
            sensed = world.reset(1, LanePlace("w-c_0", 40.0))
            for _ in range(250):
                sensed = world.step(*small.keeper(world, sensed, indicator, 4.0), indicator)
                assert sensed.events == ()
            edge = {Indicator.LEFT: "c-n", Indicator.STRAIGHT: "c-e", Indicator.RIGHT: "c-s"}[indicator]
            assert sensed.truth.lane_id == f"{edge}_0"


def test_frames_follow_the_road_uphill(tmp_path):
    with World(small.scenario(town=small.crossing(tmp_path, hill_m=8.0)), tmp_path) as world:
        sensed = world.reset(1, LanePlace("w-c_0", 40.0))
        flat = world.reset(1, LanePlace("n-c_0", 40.0)).observation.frame
        assert world.town.heights_m is not None
        assert not np.array_equal(sensed.observation.frame, flat)


def test_noise_is_that_of_recorded_drives():
    noise = NOISE_LEVELS["harsh"]
    rng = np.random.default_rng(1)
    ratios, rates = [], []
    for _ in range(400):
        odometry = Odometry(noise, rng)
        sensed = np.array([odometry.sense(1.0, 0.02, 0.1) for _ in range(60)])
        ratios.append(np.log(sensed[:, 0].mean() / 10.0))
        rates.append(sensed[:, 1] - 0.2)
    assert np.mean(ratios) == pytest.approx(np.log(noise.units_per_metre), abs=0.05)
    spread = np.hypot(np.hypot(noise.units_per_metre_spread, noise.scale_wander), 0.3 * noise.scale_jump)
    assert np.std(ratios) == pytest.approx(spread, rel=0.25)
    white = np.deg2rad(noise.gyro_noise_deg_per_sqrt_s) / np.sqrt(0.1)
    assert np.std([rate - rate.mean() for rate in rates]) == pytest.approx(white, rel=0.1)


def test_exact_motion_is_sensed_exactly():
    odometry = Odometry(SelfMotionNoise(units_per_metre=2.0, units_per_metre_spread=0.0), np.random.default_rng(1))
    assert odometry.sense(0.5, 0.01, 0.1) == pytest.approx((10.0, 0.1))
