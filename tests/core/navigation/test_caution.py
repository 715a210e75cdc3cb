"""How fast to go where the road may bend away before the way does that is driven."""

import math

import numpy as np
import pytest

from hippodrome.core.navigation.border import OTHER, PAINT, ROAD, UNKNOWN
from hippodrome.core.navigation.caution import TURN_MPS, leads_off_road, seems_road, turn_mps

AHEAD = np.column_stack([np.arange(1.0, 14.0, 0.5), np.zeros(26), np.zeros(26)])


class Town:
    """Ground that is told by a function of place in the vehicle's axes."""

    def __init__(self, kind, is_shown=lambda x, y: True):
        self.kind, self.is_shown = kind, is_shown

    def kinds_at(self, points_m):
        return np.array([self.kind(x, y) for x, y in points_m], dtype=np.uint8)

    def in_view(self, points_m):
        return np.array([self.is_shown(x, y) for x, y in points_m])

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
