"""What is detected and logged: collisions and who is to blame, the wrong way, red signals, rights of way."""

import math

import libsumo
import numpy as np
import pytest

from hippodrome.core.navigation.types import Indicator, Lamp
from hippodrome.core.types import HippodromeError
from hippodrome.sim.loop.junction import comers
from hippodrome.sim.loop.radar import nearest_ahead, nearest_behind_m
from hippodrome.sim.loop.types import EventKind, LanePlace
from hippodrome.sim.loop.users import Users
from hippodrome.sim.loop.world import World
from hippodrome.sim.traffic import VEHICLE_SIZES_M
from tests.sim.loop import small


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    folder = tmp_path_factory.mktemp("crossing")
    with World(small.scenario(town=small.crossing(folder)), folder, draw=False) as opened:
        yield opened


@pytest.fixture(scope="module")
def signals_town(tmp_path_factory):
    folder = tmp_path_factory.mktemp("signals")
    return small.scenario(town=small.crossing(folder, "traffic_light")), folder


def events_of(world, sensed, steps, command):
    found = []
    for _ in range(steps):
        sensed = world.step(*command(sensed))
        found.extend(sensed.events)
    return sensed, found


def test_running_into_a_standing_car_is_at_fault(world):
    sensed = world.reset(1, LanePlace("w-c_0", 20.0))
    small.car("b900", ["w-c", "c-e"], 70.0, standing=True)
    sensed, found = events_of(world, sensed, 120, lambda s: (1.0, 0.0))
    assert [(e.kind, e.at_fault, e.other) for e in found][:1] == [(EventKind.COLLISION, True, "b900")]
    assert found[0].x_m == pytest.approx(70.0 - 120.0 - 4.3 - 3.6, abs=1.0)


def test_being_run_into_from_behind_is_not(world):
    sensed = world.reset(1, LanePlace("w-c_0", 40.0))
    small.car("b901", ["w-c", "c-e"], 15.0, 6.0)
    world.step(0.0, 0.0)
    libsumo.vehicle.setSpeedMode("b901", 0)
    libsumo.vehicle.setSpeed("b901", 6.0)
    _, found = events_of(world, sensed, 60, lambda s: (0.0, 0.0))
    assert [(e.kind, e.at_fault) for e in found] == [(EventKind.COLLISION, False)]


def test_wrong_way_is_seen(world):
    sensed = world.reset(1, LanePlace("c-w_0", 60.0))
    pose = world.ground.pose_at(sensed.truth.lane, 60.0)
    world.teleport((pose[0], pose[1], pose[2] + math.pi))
    _, found = events_of(world, sensed, 40, lambda s: (1.0, 0.0))
    assert EventKind.WRONG_WAY in {e.kind for e in found}


def test_leaving_lane_road_and_paving_is_seen_once_each(world):
    sensed = world.reset(1, LanePlace("w-c_0", 20.0))
    _, found = events_of(world, sensed, 60, lambda s: (1.0, -0.06))
    assert [e.kind for e in found[:3]] == [EventKind.KERB, EventKind.LEFT_LANE, EventKind.LEFT_ROAD]
    assert len(found) == 3


def test_driving_well_brings_no_event(world):
    for indicator in Indicator:
        sensed = world.reset(1, LanePlace("w-c_0", 50.0))
        for _ in range(250):
            sensed = world.step(*small.keeper(world, sensed, indicator, 5.0), indicator)
            assert sensed.events == ()
        edge = {Indicator.LEFT: "c-n", Indicator.STRAIGHT: "c-e", Indicator.RIGHT: "c-s"}[indicator]
        assert sensed.truth.lane_id == f"{edge}_0"


@pytest.mark.parametrize("position_m", [40.0, 50.0, 60.0])
def test_a_car_yields_to_the_ego(world, position_m):
    sensed = world.reset(1, LanePlace("w-c_0", position_m))
    small.car("b902", ["s-c", "c-n"], 40.0, 5.0)
    _, found = events_of(world, sensed, 200, lambda s: small.keeper(world, s, speed_mps=8.0, gap_m=-99.0))
    assert found == []


def test_the_ego_takes_the_right_of_way_and_is_told_that_the_way_is_not_free(world):
    sensed = world.reset(1, LanePlace("s-c_0", 70.0))
    small.car("b903", ["w-c", "c-e"], 30.0, 8.0)
    free, found = [], []
    for _ in range(120):
        sensed = world.step(*small.keeper(world, sensed, speed_mps=5.0, gap_m=-99.0))
        free.append(sensed.radar.way_is_free)
        found.extend(sensed.events)
    assert not all(free)
    assert EventKind.RIGHT_OF_WAY in {e.kind for e in found}


def test_who_waits_until_the_way_is_free_takes_nothing(world):
    sensed = world.reset(1, LanePlace("s-c_0", 70.0))
    for k, position in enumerate((0.0, 30.0, 60.0)):
        small.car(f"b91{k}", ["w-c", "c-e"], position, 8.0)
    found = []
    for _ in range(400):
        accel, steering = small.keeper(world, sensed, speed_mps=5.0)
        rest = world.ground.lane_length_m(sensed.truth.lane) - sensed.truth.lane_position_m - 3.6
        if sensed.truth.lane_id == "s-c_0" and not sensed.radar.way_is_free and rest < 8.0:
            accel = -3.0
        sensed = world.step(accel, steering)
        found.extend(sensed.events)
    assert found == []
    assert sensed.truth.lane_id in ("c-n_0", "n-c_0")


def test_a_red_light_run_is_seen_and_a_green_one_is_none(signals_town):
    scenario, folder = signals_town
    kinds, lamps = {}, {}
    with World(scenario, folder, draw=False) as world:
        for arm in "ws":
            sensed = world.reset(1, LanePlace(f"{arm}-c_0", 80.0))
            lamps[arm] = sensed.radar.lamp
            _, found = events_of(world, sensed, 100, lambda s: small.keeper(world, s))
            kinds[arm] = [e.kind for e in found]
    assert set(lamps.values()) == {Lamp.GREEN, Lamp.RED}
    for arm, lamp in lamps.items():
        assert kinds[arm] == ([EventKind.RED_LIGHT] if lamp == Lamp.RED else [])


def test_a_closed_street_is_barred_and_traffic_goes_elsewhere(tmp_path):
    scenario = small.scenario(vehicles=6)
    with World(scenario, tmp_path, draw=False) as world:
        lane = int(np.flatnonzero(~world.network.is_internal)[3])
        edge, start = world.network.edge_ids[world.network.lane_edge[lane]], world.network.lane_ids[lane]
    with World(scenario, tmp_path, draw=False, closed=[edge]) as world:
        sensed = world.reset(1, LanePlace(start, 2.0))
        gaps = []
        for _ in range(700):
            sensed = world.step(*small.keeper(world, sensed))
            gaps.append(sensed.radar.gap_m)
            on_it = [name for name in libsumo.vehicle.getIDList() if libsumo.vehicle.getRoadID(name) == edge]
            assert set(on_it) <= {"ego", f"closed-{start}"}
        assert gaps[-1] == pytest.approx(3.0, abs=1.0)
        assert sensed.truth.speed_mps < 0.2
    with pytest.raises(HippodromeError, match="no road 'nowhere'"):
        World(scenario, tmp_path, draw=False, closed=["nowhere"])


def test_the_radar_follows_the_steering_and_looks_no_further_than_a_right_angle():
    pose = (0.0, 0.0, 0.0)

    def gap(x, y, curvature):
        users = Users(("a",), np.array([1]), np.array([0], np.uint8), np.array([[x, y, 0.0]]), np.array([2.0]))
        return nearest_ahead(pose, curvature, users)

    assert gap(23.6 + 2.15, 0.0, 0.0) == (pytest.approx(20.0), pytest.approx(2.0))
    assert gap(20.0, 4.0, 0.0)[0] == math.inf
    assert gap(20.0, 4.0, 2.0 * 4.0 / (20.0**2 + 4.0**2))[0] < 20.0
    assert gap(-20.0, 0.0, 0.0)[0] == math.inf
    assert gap(0.0, 10.0, 0.2)[0] == math.inf


def test_the_radar_sees_whom_the_outer_corner_swings_into():
    def users(x, y, heading=0.0):
        return Users(("a",), np.array([1]), np.array([0], np.uint8), np.array([[x, y, heading]]), np.array([0.0]))

    pose, lock = (0.0, 0.0, 0.0), 1.0 / 3.0
    assert nearest_ahead(pose, lock, users(5.0, -2.2, 0.5 * math.pi))[0] < 1.0  # the front right corner comes there
    assert nearest_ahead(pose, lock, users(5.6, -2.2, 0.5 * math.pi))[0] == math.inf
    beside = users(1.5, -2.4)  # parallel, half a metre beside: no way to back with the wheels at full lock
    assert nearest_behind_m(pose, 0.0, beside) == math.inf
    assert nearest_behind_m(pose, lock, beside) < 2.0
    assert nearest_behind_m(pose, lock, users(1.5, -4.5)) == math.inf


def test_who_waits_is_passed_by_a_hands_breadth_where_the_ego_hardly_moves():
    def gap(aside_m, other_mps, own_mps):
        users = Users(("a",), np.array([1]), np.array([0], np.uint8), np.array([[12.0, aside_m, 0.0]]), np.array([other_mps]))
        return nearest_ahead((0.0, 0.0, 0.0), 0.0, users, own_mps=own_mps)[0]

    beside_m = 0.5 * (1.8 + float(VEHICLE_SIZES_M[0, 1]))
    assert gap(beside_m + 0.1, 0.0, 0.2) == math.inf
    assert gap(beside_m + 0.0, 0.0, 0.2) < 10.0
    assert gap(beside_m + 0.1, 2.0, 0.2) < 10.0  # who drives has the whole room
    assert gap(beside_m + 0.1, 0.0, 2.0) < 10.0  # and so has who stands, where the ego is faster
    assert gap(beside_m + 0.2, 0.0, 1.9) < 10.0 and gap(beside_m + 0.2, 0.0, 1.0) == math.inf


def test_who_is_in_another_junction_is_as_far_as_the_road_between_is_long(tmp_path):
    with World(small.scenario(), tmp_path, draw=False) as world:
        network, ways, rights = world.network, world.ways, world._rights
        lane_of = {name: lane for lane, name in enumerate(network.lane_ids)}
        world.reset(1)
        before, way, onward = next(
            (lane, one, two)
            for lane in range(network.lane_count)
            if not network.is_internal[lane] and world.ground.lane_length_m(lane) > 30.0
            for one in ways.out_of(lane)
            if one.inside
            for two in ways.out_of(one.target)
            if two.inside and network.lane_edge[two.target] != network.lane_edge[lane]
        )
        edges = [network.edge_ids[network.lane_edge[lane]] for lane in (before, way.target, onward.target)]
        small.car("b930", edges, libsumo.lane.getLength(network.lane_ids[before]) - 12.0, 5.0)
        junction, lengths = rights.junction_of[onward.inside[0]], [world.ground.lane_length_m(k) for k in range(len(lane_of))]
        told, inside = [], []
        for _ in range(120):
            libsumo.simulationStep()
            if "b930" not in libsumo.vehicle.getIDList():
                continue
            x, y = libsumo.vehicle.getPosition("b930")
            users = Users(("b930",), np.array([1]), np.array([0], np.uint8), np.array([[x, y, 0.0]]), np.array([5.0]))
            found = comers(junction, users, (x, y), rights, lane_of, lengths)
            if found and not found[0].is_inside:
                told.append(found[0].distance_m)
                inside.append(libsumo.vehicle.getLaneID("b930").startswith(":"))
    assert any(inside) and not all(inside)
    assert np.abs(np.diff(told)).max() < 2.0  # it comes nearer as it drives, and never all at once
