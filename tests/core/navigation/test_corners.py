"""Sharp corners: the wheels stay within the lanes, and what needs no help keeps its path."""

import math

import numpy as np
import pytest

from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.corners import best_corner, with_corners
from hippodrome.core.navigation.course import make_course
from hippodrome.core.navigation.navigator import Navigator
from hippodrome.core.navigation.types import DrivingState, Goal
from hippodrome.core.roads.paths import Piece, smooth_path
from tests.core.navigation.roads import Bicycle, arc, map_along, network_of

VEHICLE = NavigatorConfig().vehicle
HALF_WIDTH_M = 1.6


def corner_of(turn_deg, radius=2.0, lead=60.0):
    """A lane to the east, a bend to the right (negative) or left, and a lane after it."""
    side = math.copysign(1.0, turn_deg)
    begin = -90.0 * side
    bend = arc((lead, side * radius), radius, begin, begin + turn_deg)
    heading = math.radians(turn_deg)
    end = bend[-1] + lead * np.array([math.cos(heading), math.sin(heading)])
    return network_of([[(0.0, 0.0), (lead, 0.0)], bend, [bend[-1], end]], [(0, 1), (1, 2)], internal=(1,))


def pieces_of(network):
    return [Piece(lane, 0.0, float(network.lane_lengths_m()[lane]), False, 5.0) for lane in range(network.lane_count)]


def outside_m(network, poses, half_width_m=HALF_WIDTH_M):
    """How far the worst wheel is beyond the lanes."""
    lines = np.concatenate([network.lane_points_m(lane) for lane in range(network.lane_count)])
    a, step = lines[:-1], np.diff(lines, axis=0)
    worst = 0.0
    for x, y, heading in poses:
        for ahead in (0.0, 2.7):
            for aside in (-0.8, 0.8):
                wheel = np.array([x + ahead * math.cos(heading) - aside * math.sin(heading),
                                  y + ahead * math.sin(heading) + aside * math.cos(heading)])  # fmt: skip
                share = np.clip(np.sum((wheel - a) * step, axis=1) / np.maximum(np.sum(step**2, axis=1), 1e-9), 0.0, 1.0)
                apart = np.hypot(*(wheel - a - share[:, None] * step).T).min()
                worst = max(worst, float(apart) - half_width_m)
    return worst


def poses_of(path):
    """All but the last three metres, where the front wheels are beyond the end of the lane."""
    return np.column_stack([path.points_m, path.heading_rad])[:-12]


@pytest.mark.parametrize("turn_deg", [-75.0, -90.0, 90.0])
def test_all_wheels_stay_within_the_lanes_where_the_lanes_middle_is_too_sharp(turn_deg):
    network = corner_of(turn_deg)
    before = smooth_path(network, pieces_of(network))
    path = with_corners(network, pieces_of(network), before, VEHICLE)
    assert outside_m(network, poses_of(path)) < min(0.12, outside_m(network, poses_of(before)) + 1e-9)
    assert np.abs(path.curvature_1pm).max() <= 0.33
    assert np.abs(np.diff(path.heading_rad)).max() < 0.2  # no leap at the seams
    assert np.linalg.norm(np.diff(path.points_m, axis=0), axis=1).max() < 0.6


@pytest.mark.parametrize("turn_deg", [-90.0, 60.0, 110.0])
def test_a_corner_is_driven_so_slowly_that_the_wheels_can_follow(turn_deg):
    network, config = corner_of(turn_deg, radius=4.0), NavigatorConfig()
    course = make_course(network, pieces_of(network), 2, 40.0, config.drive, VEHICLE)
    wheels = np.arctan(VEHICLE.wheelbase_m * course.path.curvature_1pm)
    over_m = 1.0  # the wheels may be early and late by half of that
    turned = np.abs(wheels[4:] - wheels[:-4]) / over_m
    assert (turned * course.speed_mps[2:-2]).max() < VEHICLE.steering_rate_radps
    assert course.speed_mps.min() > 1.2


def test_of_ways_that_keep_clear_the_one_with_most_room_is_taken():
    network = corner_of(100.0, radius=5.0)
    corner = best_corner(network, (0, 1, 2), VEHICLE)
    assert corner is not None
    assert outside_m(network, corner.bend[:, :3], HALF_WIDTH_M - 0.2) == 0.0


def test_a_gentle_bend_keeps_its_path():
    network = corner_of(-30.0, radius=12.0)
    before = smooth_path(network, pieces_of(network))
    assert with_corners(network, pieces_of(network), before, VEHICLE) is before


def test_nothing_is_changed_where_lanes_are_too_short_to_swing_out():
    network = corner_of(-90.0, lead=8.0)
    assert best_corner(network, (0, 1, 2), VEHICLE) is None


def test_the_vehicle_drives_round_within_the_lanes():
    network, car = corner_of(-90.0), Bicycle((20.0, 0.0, 0.0))
    navigator = Navigator(map_along(network), network, NavigatorConfig(read_road=False, exact_poses=True), poses=car)
    navigator.set_goal(Goal(62.0, -45.0, -0.5 * math.pi))
    poses = []
    for _ in range(600):
        command = navigator.step(car.sense())
        if command.state is DrivingState.ARRIVED:
            break
        car.drive(command)
        poses.append(car.pose.copy())
    assert command.state is DrivingState.ARRIVED
    assert outside_m(network, poses) < 0.12


def test_a_plan_from_within_the_corner_ends_on_the_same_lane():
    network = corner_of(-90.0)
    pieces = [Piece(1, 1.0, float(network.lane_lengths_m()[1]), False, 2.0), Piece(2, 0.0, 50.0, False, 2.0)]
    before = smooth_path(network, pieces)
    assert with_corners(network, pieces, before, VEHICLE) is before
