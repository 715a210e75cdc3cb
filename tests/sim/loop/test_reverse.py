"""Backwards: the car's kinematics, what is sensed of it, what counts as wrong, and others that let it turn round."""

import math

import gymnasium
import libsumo
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from hippodrome.core.navigation.types import Indicator
from hippodrome.sim.loop.car import BACKWARDS_MPS, Car
from hippodrome.sim.loop.env import EnvOptions, TownEnv
from hippodrome.sim.loop.types import EventKind, LanePlace
from hippodrome.sim.loop.world import World
from tests.sim.loop import small

FULL_LOCK_RAD = math.radians(42.0)


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    folder = tmp_path_factory.mktemp("crossing")
    with World(small.scenario(town=small.crossing(folder)), folder, draw=False) as opened:
        yield opened


def backwards(world, steps, steering_rad=0.0, speed_mps=1.5):
    found, sensed = [], None
    for _ in range(steps):
        speed = sensed.truth.speed_mps if sensed is not None else 0.0
        sensed = world.step(2.0 * (speed_mps + speed), steering_rad, reverse=True)
        found.extend(sensed.events)
    return sensed, found


def test_it_backs_along_a_line_by_half_a_t_squared():
    car = Car(0.0, 0.0, 0.0)
    car.drive(1.0, 0.0, 2.0, reverse=True)
    assert car.speed_mps == pytest.approx(-2.0)
    assert car.pose_m[0] == pytest.approx(-2.0, abs=0.06) and car.pose_m[1] == 0.0
    car.drive(-8.0, 0.0, 2.0, reverse=True)
    assert car.speed_mps == 0.0
    assert car.pose_m[0] == pytest.approx(-2.25, abs=0.08)


def test_it_backs_round_the_circle_of_its_wheels():
    car = Car(0.0, 0.0, 0.0)
    car.drive(0.0, FULL_LOCK_RAD, 1.0, reverse=True)  # the wheels are turned while it stands
    car.drive(0.5, FULL_LOCK_RAD, 2.0, reverse=True)
    radius = 2.7 / math.tan(FULL_LOCK_RAD)
    assert math.dist(car.pose_m[:2], (0.0, radius)) == pytest.approx(radius, abs=0.01)
    assert -0.45 < car.pose_m[2] < -0.25  # its tail goes left, so that its nose goes right: a metre of 3 m


def test_another_gear_brakes_first_and_backwards_has_a_limit():
    car = Car(0.0, 0.0, 0.0)
    car.drive(2.0, 0.0, 2.0)
    assert car.speed_mps == pytest.approx(4.0)
    car.drive(2.0, 0.0, 1.0, reverse=True)
    assert car.speed_mps == pytest.approx(2.0)
    car.drive(-2.0, 0.0, 1.0, reverse=True)
    assert car.speed_mps == pytest.approx(0.0, abs=1e-9)
    car.drive(4.0, 0.0, 5.0, reverse=True)
    assert car.speed_mps == pytest.approx(-BACKWARDS_MPS)
    car.drive(4.0, 0.0, 0.5)
    assert car.speed_mps == pytest.approx(-BACKWARDS_MPS + 2.0)


def test_backing_in_the_own_lane_is_no_event_until_it_is_long(world):
    sensed = world.reset(1, LanePlace("w-c_0", 70.0))
    sensed, found = backwards(world, 120)
    assert found == [] and sensed.truth.speed_mps == pytest.approx(-1.5, abs=0.1)
    assert sensed.observation.speed < 0.0 and sensed.truth.driven_m == pytest.approx(17.0, abs=1.0)
    assert sensed.truth.lane_position_m == pytest.approx(70.0 - sensed.truth.driven_m, abs=0.1)
    assert [e.kind for e in backwards(world, 50)[1]] == [EventKind.WRONG_WAY]


def test_backing_into_somebody_is_at_fault_and_the_gap_was_told(world):
    world.reset(1, LanePlace("w-c_0", 60.0))
    small.car("b900", ["w-c", "c-e"], 50.0, standing=True)  # its front, as SUMO counts
    sensed, found = backwards(world, 5, speed_mps=0.0)
    rear_m, front_m = -60.0 - 0.9, -120.0 + 50.0
    assert sensed.radar.gap_behind_m == pytest.approx(rear_m - front_m, abs=1.0)
    assert sensed.radar.gap_m == math.inf
    sensed, found = backwards(world, 120)
    assert [(e.kind, e.at_fault, e.text) for e in found] == [(EventKind.COLLISION, True, "backed into another vehicle")]


def test_others_stop_behind_it_and_for_it_while_it_turns_round(world):
    for edges, position_m in ((["w-c", "c-e"], 30.0), (["e-c", "c-w"], 60.0)):
        world.reset(1, LanePlace("w-c_0", 80.0))
        small.car("b901", edges, position_m, 6.0)
        found, driven_m = [], 0.0
        for _ in range(190):  # its nose goes into the lane of those who come towards it, its tail stays in the own one
            goes_on = driven_m < 2.2
            sensed = world.step(1.0 if goes_on else -3.0, FULL_LOCK_RAD, Indicator.LEFT, reverse=not goes_on)
            driven_m = sensed.truth.driven_m
            found += sensed.events
        assert "b901" in libsumo.vehicle.getIDList()
        assert libsumo.vehicle.getSpeed("b901") < 0.1
        assert EventKind.COLLISION not in {e.kind for e in found}


def test_a_car_on_its_way_is_told_and_a_standing_one_is_not(world):
    world.reset(1, LanePlace("w-c_0", 80.0))
    small.car("b902", ["c-w"], 12.0, 6.0)
    sensed = world.step(-1.0, 0.0)
    assert 0.0 < sensed.radar.moving_m < 50.0
    world.reset(1, LanePlace("w-c_0", 80.0))
    small.car("b903", ["c-w"], 12.0, standing=True)
    world.step(-1.0, 0.0)
    assert world.step(-1.0, 0.0).radar.moving_m == math.inf


def test_the_same_reversing_gives_the_same_bytes(tmp_path):
    with World(small.scenario(vehicles=6), tmp_path, draw=False) as town:
        prints = []
        for _ in range(2):
            town.reset(4)
            prints.append([repr(town.step(1.0, 0.3 * math.sin(k), reverse=k % 20 > 8).truth) for k in range(60)])
    assert prints[0] == prints[1]


def test_a_policy_can_reverse_where_it_is_let(tmp_path):
    env = TownEnv(small.scenario(), tmp_path, options=EnvOptions(radar=True, indicators=True, reverse=True))
    assert env.action_space.shape == (4,)
    observed, _ = env.reset(seed=1)
    assert {"gap_behind_m", "moving_m"} <= set(observed)
    for _ in range(20):
        observed, *_, info = env.step(np.array([0.4, 0.0, 0.0, -1.0]))
    assert observed["speed"][0] < 0.0 and info["truth"]["speed_mps"] < -1.0
    check_env(env, skip_render_check=True)
    env.close()
    plain = gymnasium.make("hippodrome.envs:hippodrome/Town-v0", scenario=small.scenario(), root=tmp_path, radar=True)
    assert plain.action_space.shape == (2,) and "gap_behind_m" not in plain.observation_space.spaces
    plain.close()
