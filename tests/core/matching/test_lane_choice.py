"""Where a line's lane may be the wrong one of several, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from hippodrome.core.matching.lane_choice import (
    UNKNOWN_LANE_SIGMA_M,
    near_lane_changes,
    on_parallel_lanes,
    unknown_lane_sigma_m,
)
from hippodrome.core.matching.route_line import RouteLine
from tests.core.synthetic import lanes_of


@pytest.fixture
def network():
    """Lanes 0 and 1 side by side, 1 on the left; lane 2 follows lane 1."""
    roads = lanes_of([(0, 0), (50, 0)], [(0, 3), (50, 3)], [(50, 3), (90, 3)], successor=[(1, 2)])
    return replace(roads, left_lane=np.array([1, -1, -1], np.int32), right_lane=np.array([-1, 0, -1], np.int32))


def line(lane):
    """A sample every 10 m."""
    arc = 10.0 * np.arange(len(lane))
    points = np.column_stack([arc, np.zeros(len(lane))])
    return RouteLine(arc, points, np.zeros(len(lane)), np.array(lane, np.int32), np.zeros(len(lane)))


def test_only_lanes_with_an_adjacent_one_are_parallel(network):
    assert on_parallel_lanes(line([0, 0, 1, 2, -1]), network).tolist() == [True, True, True, False, False]


def test_samples_near_a_change_to_an_adjacent_lane(network):
    """The change lies between 20 and 30 m; a successor (1 to 2) and leaving the network (2 to -1) are no lane changes."""
    near = near_lane_changes(line([0, 0, 0, 1, 1, 1, 2, -1]), network)
    assert near.tolist() == [False, True, True, True, False, False, False, False]
    assert not near_lane_changes(line([1, 1, 2, -1, 0]), network).any()


def test_the_lateral_sigma_is_that_of_the_next_sample(network):
    sigma = unknown_lane_sigma_m(line([0, 0, 2]), np.array([-5.0, 5.0, 10.5, 40.0]), np.array([True, True, False]))
    assert sigma.tolist() == [UNKNOWN_LANE_SIGMA_M, UNKNOWN_LANE_SIGMA_M, 0.0, 0.0]
