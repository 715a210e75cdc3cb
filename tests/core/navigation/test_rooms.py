"""Room about the vehicle: on the network's lanes, on the ground that was seen, and where a turn would end there."""

import math

import numpy as np
import pytest

from hippodrome.core.navigation.config import VehicleShape
from hippodrome.core.navigation.escape import _far_lane
from hippodrome.core.navigation.rooms import before_obstacle, room_on_roads, room_on_seen_ground
from hippodrome.core.navigation.sight import Ground
from hippodrome.core.navigation.turning import Clearance, plan_turn
from hippodrome.core.roads.geometry import road_geometry
from hippodrome.core.views.odometry import CameraGeometry
from tests.core.navigation.roads import street

ROAD, OTHER = 1, 2


def at(room, *points):
    return room(np.array(points, dtype=float))


def test_room_on_roads_ends_where_the_lanes_do_and_not_between_them():
    room = room_on_roads(road_geometry(street()), np.array([30.0, -1.6, 0.0]))
    assert at(room, (30, -1.6), (30, 0.0), (30, 2.8), (30, 3.6), (90, 0)) == pytest.approx([1.6, 3.2, 0.4, -0.4, -4.0], abs=0.15)
    barred = before_obstacle(room, np.array([30.0, -1.6, 0.0]), 5.0)
    assert at(barred, (34, 0.0), (36, 0.0)) == pytest.approx([1.0, -1.0], abs=0.01)


def seen_street(low_m, high_m, behind_m=-9.0, ahead_m=9.0):
    """A ground that has been seen to be road between two lines along x, and grass beyond them."""
    ground = Ground(CameraGeometry())
    axis = 0.2 * (np.arange(400) + 0.5) - 40.0
    x, y = np.meshgrid(axis, axis, indexing="ij")
    ground._cells[(x > behind_m) & (x < ahead_m)] = OTHER
    ground._cells[(x > behind_m) & (x < ahead_m) & (y > low_m) & (y < high_m)] = ROAD
    return ground


def test_room_on_seen_ground_ends_at_grass_and_where_nothing_was_seen():
    room = room_on_seen_ground(seen_street(-1.6, 4.8))
    assert at(room, (0, 1.6), (0, 4.4), (0, 5.4), (8.0, 1.6), (10.0, 1.6)) == pytest.approx([3.2, 0.4, -0.6, 1.0, -1.0], abs=0.25)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_turn_on_seen_ground_ends_in_the_far_lane(side):
    low_m, high_m = (-1.6, 4.8) if side < 0.0 else (-4.8, 1.6)
    ground = seen_street(low_m, high_m)
    room = room_on_seen_ground(ground)
    line = _far_lane(room, ground.pose, side, 1.6)
    assert line[1] == pytest.approx(-side * 3.2, abs=0.4) and abs(line[2]) == pytest.approx(math.pi)
    legs = plan_turn(ground.pose.tolist(), line.tolist(), room, VehicleShape(), Clearance(0.1, -0.25))
    assert legs is not None
    assert sum(leg.turned_rad for leg in legs) == pytest.approx(-side * math.pi)
