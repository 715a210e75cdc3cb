"""Turning round in a street: the legs stay on the paving, and the navigator drives them, and only where it has to."""

import math
from itertools import pairwise

import numpy as np
import pytest

from hippodrome.core.navigation.config import NavigatorConfig, VehicleShape
from hippodrome.core.navigation.navigator import Navigator
from hippodrome.core.navigation.turning import Clearance, Leg, is_clear, plan_turn, poses_along
from hippodrome.core.navigation.types import DrivingState, Goal, Radar
from tests.core.navigation.roads import GREY, Bicycle, arc, map_along, network_of, street

VEHICLE = VehicleShape()


def between(low_m, high_m, end_m=math.inf):
    """Room in a straight street from y = low to y = high, that is barred at x = end."""
    return lambda points: np.minimum(np.minimum(points[:, 1] - low_m, high_m - points[:, 1]), end_m - points[:, 0])


def end_of(pose, legs):
    for leg in legs:
        pose = poses_along(pose, leg)[-1]
    return pose


def test_a_leg_backwards_is_the_arc_of_its_radius():
    poses = poses_along((0.0, 0.0, 0.0), Leg(0.25, -2.0))
    assert poses[-1] == pytest.approx([-4.0 * math.sin(0.5), 4.0 - 4.0 * math.cos(0.5), -0.5])
    assert np.hypot(poses[:, 0], poses[:, 1] - 4.0) == pytest.approx(4.0)


@pytest.mark.parametrize("width_m", [6.0, 6.4, 7.0, 8.0, 10.0, 13.0])
@pytest.mark.parametrize("askew_rad", [-0.1, 0.0, 0.1])
def test_a_turn_stays_on_the_paving_with_all_of_the_body(width_m, askew_rad):
    room, pose = between(-0.25 * width_m, 0.75 * width_m), (0.0, 0.0, askew_rad)
    legs = plan_turn(pose, (0.0, 0.5 * width_m, math.pi), room, VEHICLE, Clearance(0.1, 0.0))
    assert legs is not None and len(legs) <= 7
    for leg in legs:
        poses = poses_along(pose, leg, 0.05)
        assert is_clear(poses[1:], room, VEHICLE, Clearance(0.08, -0.03)).all()
        assert abs(leg.curvature_1pm) <= math.tan(VEHICLE.max_steering_rad) / VEHICLE.wheelbase_m
        pose = poses[-1]
    assert abs(math.remainder(pose[2] - math.pi, math.tau)) < 1e-6
    assert abs(pose[1] - 0.5 * width_m) < 1.0
    assert all(a.length_m * b.length_m < 0.0 for a, b in pairwise(legs) if a.curvature_1pm)


def test_where_the_turning_circle_fits_it_is_one_leg_and_where_nothing_fits_none():
    wide = plan_turn((0.0, 0.0, 0.0), (0.0, 6.5, math.pi), between(-2.0, 9.0), VEHICLE)
    assert wide is not None and len(wide) == 1 and wide[0].length_m > 0.0
    assert plan_turn((0.0, 0.0, 0.0), (0.0, 2.0, math.pi), between(-1.2, 3.0), VEHICLE, Clearance(0.1, 0.0)) is None


def test_it_turns_to_the_side_on_which_the_line_is():
    for side in (1.0, -1.0):
        legs = plan_turn((0.0, 0.0, 0.0), (0.0, 3.2 * side, math.pi), between(-4.8, 4.8), VEHICLE)
        assert sum(leg.turned_rad for leg in legs) == pytest.approx(side * math.pi)


def test_before_a_barrier_it_backs_first_and_never_reaches_it():
    room, pose = between(-1.6, 4.8, 4.2), (0.0, 0.0, 0.0)
    legs = plan_turn(pose, (0.0, 3.2, math.pi), room, VEHICLE, Clearance(0.2, 0.0))
    assert legs is not None and legs[0].length_m < 0.0
    assert end_of(pose, legs)[0] < 4.2


def drive(navigator, car, seconds, radar):
    reasons, rows = set(), []
    for _ in range(round(10 * seconds)):
        command = navigator.step(car.sense(GREY, 1e-4), radar(car))
        reasons.add(command.reason)
        if command.state is DrivingState.ARRIVED and car.speed == 0.0:
            break
        car.drive(command)
        rows.append([*car.pose, car.speed])
    return command, reasons, np.array(rows)


def started(network, pose, goal):
    car = Bicycle(pose)
    navigator = Navigator(map_along(network), network, NavigatorConfig(read_road=False, exact_poses=True), poses=car)
    navigator.set_goal(goal)
    return navigator, car


@pytest.mark.parametrize("width", [3.2, 5.0])
def test_it_turns_round_where_the_goal_lies_behind_it_and_no_way_leads_there(width):
    network = street(width=width)
    navigator, car = started(network, (20.0, -0.5 * width, 0.0), Goal(-20.0, 0.5 * width, math.pi))
    command, reasons, rows = drive(navigator, car, 120.0, lambda car: Radar())
    assert command.state is DrivingState.ARRIVED and "turns round" in reasons
    assert car.pose[:2] == pytest.approx([-20.0, 0.5 * width], abs=1.0)
    room = between(-width, width)
    assert is_clear(rows[:, :3], room, VEHICLE, Clearance(0.05, -0.3)).all()


def closed_street():
    """Lane 0 leads east to lane 2, which holds the goal; lane 1 leads back west, and by a long way round to lane 2."""
    r = 8.0
    lines = [
        [(0.0, -1.6), (80.0, -1.6)], [(80.0, 1.6), (0.0, 1.6)], [(80.0, -1.6), (140.0, -1.6)],
        arc((0.0, 1.6 + r), r, 270, 180), [(-r, 1.6 + r), (-r, 42.0)], arc((0.0, 42.0), r, 180, 90),
        [(0.0, 42.0 + r), (60.0, 42.0 + r)], arc((60.0, 42.0), r, 90, 0), [(60.0 + r, 42.0), (60.0 + r, 6.4)],
        arc((68.0 + r, 6.4), r, 180, 270),
    ]  # fmt: skip
    return network_of(lines, [(0, 2), (1, 3), (3, 4), (4, 5), (5, 6), (6, 7), (7, 8), (8, 9), (9, 2)])


def barrier(at_m):
    def radar(car):
        ahead = at_m - car.pose[0] - 3.6 if math.cos(car.pose[2]) > 0.7 and abs(car.pose[1] + 1.6) < 1.5 else math.inf
        return Radar(ahead, car.speed) if ahead >= 0.0 else Radar()

    return radar


def test_before_a_barrier_in_the_street_it_turns_round_after_a_while_and_comes_by_another_way():
    navigator, car = started(closed_street(), (10.0, -1.6, 0.0), Goal(120.0, -1.6, 0.0))
    command, reasons, rows = drive(navigator, car, 60.0, barrier(50.0))
    assert "turns round" in reasons and rows[:, 0].max() < 50.0 - 3.6
    command, *_ = drive(navigator, car, 150.0, barrier(50.0))
    assert command.state is DrivingState.ARRIVED
    assert car.pose[:2] == pytest.approx([120.0, -1.6], abs=1.0)


def test_before_a_barrier_with_no_way_round_it_halts():
    navigator, car = started(street(), (20.0, -1.6, 0.0), Goal(70.0, -1.6, 0.0))
    command, reasons, _ = drive(navigator, car, 70.0, barrier(60.0))
    assert command.state is DrivingState.HALTED and "blocked" in command.reason
    assert "turns round" not in reasons and car.speed == 0.0


def test_it_waits_until_nobody_moves_near():
    network = street()
    navigator, car = started(network, (20.0, -1.6, 0.0), Goal(-20.0, 1.6, math.pi))
    command, _, rows = drive(navigator, car, 30.0, lambda car: Radar(moving_m=9.0))
    assert command.reason.startswith("waits until nobody") and abs(rows[-1, 2]) < 0.05
    command, *_ = drive(navigator, car, 90.0, lambda car: Radar())
    assert command.state is DrivingState.ARRIVED


def test_a_search_that_stands_backs_off_and_spaces_its_attempts(monkeypatch):
    navigator, car = started(street(), (20.0, -1.6, 0.0), Goal(70.0, -1.6, 0.0))
    drive(navigator, car, 4.0, lambda car: Radar())
    escape, crowded = navigator._escape, Radar(gap_behind_m=0.5)
    assert not escape.no_road(5.0, False, Radar()) and not escape.no_road(12.0, True, Radar())
    monkeypatch.setattr(escape, "_turn", lambda gap_m: False)  # no room for it
    tried = [k for k in range(100, 400) if escape.no_road(0.1 * k, False, crowded) or escape._again_s == 0.1 * k + 5.0]
    assert tried[:3] == [100, 150, 200]
    assert not escape.is_under_way
    assert escape.no_road(41.0, False, Radar()) and escape.is_under_way
    command = escape.step(Radar(), 0.1)
    assert command.reverse and command.reason == "backs off"
