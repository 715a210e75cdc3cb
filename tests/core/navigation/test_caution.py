"""How fast to go where the road may bend away before the way does that is driven."""

import math

import numpy as np
import pytest

from hippodrome.core.navigation.border import CELL_M, OTHER, PAINT, ROAD, UNKNOWN
from hippodrome.core.navigation.caution import (
    GUESSED_MPS,
    TURN_MPS,
    edge_share,
    guess_mps,
    leads_off_road,
    seems_road,
    seen_ahead,
    turn_mps,
)
from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.speed import in_sight_mps

AHEAD = np.column_stack([np.arange(1.0, 14.0, 0.5), np.zeros(26), np.zeros(26)])


class Town:
    """Ground that is told by a function of place in the vehicle's axes."""

    def __init__(self, kind, is_shown=lambda x, y: True):
        self.kind, self.is_shown, self.pose = kind, is_shown, np.zeros(3)

    def kinds_at(self, points_m):
        return np.array([self.kind(x, y) for x, y in points_m], dtype=np.uint8)

    def in_view(self, points_m):
        return np.array([self.is_shown(x, y) for x, y in points_m])

    def around(self, reach_m):
        half = int(reach_m / CELL_M)
        middles = CELL_M * (np.arange(2 * half) - half + 0.5)
        cells = np.array([[self.kind(x, y) for y in middles] for x in middles], dtype=np.uint8)
        return cells, np.full(2, -CELL_M * half)

    def off_road_share(self, points_m):
        kinds = self.kinds_at(points_m)
        return float(np.mean(kinds[kinds != UNKNOWN] == OTHER))


def street(x, y, side, kerb_end_m, seen_m):
    if x > seen_m:
        return UNKNOWN
    return PAINT if 1.3 < side * y < 1.7 and x < kerb_end_m else ROAD


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_where_the_border_ends_it_slows_down_until_the_road_is_seen_to_go_on(side):
    speeds = [turn_mps(Town(lambda x, y, e=end: street(x, y, side, e, 11.0)), AHEAD, side) for end in (9.0, 7.0, 5.0)]
    assert all(np.diff(speeds) < 0.0) and TURN_MPS < speeds[-1] < 4.0
    assert turn_mps(Town(lambda x, y: street(x, y, side, 5.0, 20.0)), AHEAD, side) == math.inf  # a side street
    assert turn_mps(Town(lambda x, y: street(x, y, side, 30.0, 11.0)), AHEAD, side) == math.inf
    assert turn_mps(Town(lambda x, y: ROAD), AHEAD, side) == math.inf


def test_before_what_lies_across_the_way_it_is_slow_enough_to_turn():
    across = Town(lambda x, y: OTHER if x > 8.0 else ROAD)
    assert turn_mps(across, AHEAD, -1.0) == pytest.approx(TURN_MPS)
    assert leads_off_road(across, AHEAD) and not seems_road(across, AHEAD)
    assert turn_mps(across, AHEAD[:1], -1.0) == math.inf


def test_a_way_seems_road_where_enough_of_it_was_seen():
    assert seems_road(Town(lambda x, y: ROAD), AHEAD)
    assert not seems_road(Town(lambda x, y: ROAD if x < 4.0 else UNKNOWN), AHEAD)
    assert not leads_off_road(Town(lambda x, y: ROAD), AHEAD[:2])


def test_of_a_sharp_corner_counts_what_the_camera_can_show():
    bend = -0.32 * np.clip(np.arange(2.0, 8.1, 0.5) - 3.0, 0.0, None)  # to the right, at full lock
    corner = np.column_stack([2.0 + np.cumsum(0.5 * np.cos(bend)), np.cumsum(0.5 * np.sin(bend)), bend])

    def is_shown(x, y):
        return y > -1.2

    def seen(x, y):
        return ROAD if is_shown(x, y) else UNKNOWN

    assert not seems_road(Town(seen), corner) and seems_road(Town(seen, is_shown), corner)
    assert not seems_road(Town(lambda x, y: UNKNOWN if x > 4.5 else seen(x, y), is_shown), corner)
    assert not seems_road(Town(lambda x, y: OTHER if x > 5.5 else seen(x, y), is_shown), corner)
    assert not seems_road(Town(lambda x, y: ROAD if x < 3.0 else UNKNOWN, lambda x, y: x < 3.0), corner)


def test_a_way_over_the_painted_edge_is_no_road_though_the_pavement_has_the_level_of_asphalt():
    fog = Town(lambda x, y: PAINT if -1.4 < y < -1.2 else ROAD)
    beside = AHEAD - np.array([0.0, 1.0, 0.0])
    assert seems_road(fog, AHEAD) and not seems_road(fog, beside)
    assert not seems_road(fog, AHEAD - np.array([0.0, 0.5, 0.0])) and seems_road(fog, AHEAD - np.array([0.0, 0.3, 0.0]))
    dashes = Town(lambda x, y: PAINT if -1.4 < y < -1.2 and x % 9.0 < 3.0 else ROAD)
    assert seems_road(dashes, beside) and edge_share(dashes, AHEAD + np.array([500.0, 0.0, 0.0])) == 0.0


def test_a_way_is_seen_up_to_where_it_was_not_seen_or_is_no_road():
    ahead = AHEAD[2:]
    for kind in (UNKNOWN, OTHER):
        walks, far_m = seen_ahead(Town(lambda x, y, k=kind: ROAD if x < 10.0 else k), ahead, 2.0)
        assert walks and far_m == pytest.approx(9.0, abs=1.1)
    assert seen_ahead(Town(lambda x, y: ROAD), ahead, 2.0) == (True, pytest.approx(13.5))
    assert seen_ahead(Town(lambda x, y: ROAD if x < 5.0 else UNKNOWN), ahead, 2.0)[0] is False
    assert seen_ahead(Town(lambda x, y: ROAD), ahead[:3], 2.0) == (False, 0.0)
    rows = Town(lambda x, y: ROAD if x < 8.0 or x % 1.0 < 0.5 else UNKNOWN)  # far ahead the rows of a frame lie apart
    assert seen_ahead(rows, ahead, 2.0) == (True, pytest.approx(13.5))


def test_a_way_that_all_places_share_is_driven_as_far_as_it_is_seen_and_another_one_at_a_walk():
    config = NavigatorConfig()
    speeds = [guess_mps(True, road_m, config) for road_m in (0.0, 6.0, 8.0, 10.0, 12.0, 14.0, 99.0)]
    assert speeds[0] == GUESSED_MPS and speeds[-1] == config.drive.search_mps and all(np.diff(speeds) >= 0.0)
    assert GUESSED_MPS < speeds[3] < config.drive.search_mps
    assert guess_mps(False, 99.0, config) == GUESSED_MPS


def test_from_the_speed_in_sight_the_vehicle_stops_in_sight():
    drive = NavigatorConfig().drive
    for distance_m in (2.0, 5.0, 10.0, 20.0):
        speed = in_sight_mps(distance_m, drive)
        assert speed / drive.speed_gain_1ps + 0.5 * speed**2 / drive.braking_mps2 == pytest.approx(distance_m)
    assert in_sight_mps(-1.0, drive) == 0.0
