"""Lengths and adjacent lanes of networks known by hand."""

from dataclasses import replace

import numpy as np
import pytest

from tests.core.synthetic import lanes_of


@pytest.fixture
def three_lanes():
    """Lanes 0, 1 and 2 side by side, 0 on the right; lane 3 follows lane 1."""
    network = lanes_of([(0, 0), (10, 0)], [(0, 3), (10, 3)], [(0, 6), (10, 6)], [(10, 3), (20, 3)], successor=[(1, 3)])
    return replace(network, left_lane=np.array([1, 2, -1, -1], np.int32), right_lane=np.array([-1, 0, 1, -1], np.int32))


def test_lengths_of_a_bent_lane_and_a_lane_far_away():
    network = lanes_of([(0, 0), (3, 4), (3, 6)], [(103, 6), (103, 9)])
    assert network.running_length_m() == pytest.approx([0.0, 5.0, 7.0, 107.0, 110.0])  # a gap of 100 m between the lanes
    assert network.lane_lengths_m() == pytest.approx([7.0, 3.0])


def test_a_lane_has_at_most_two_adjacent_lanes_the_left_one_first(three_lanes):
    assert [three_lanes.adjacent_lanes(lane) for lane in range(4)] == [[1], [2, 0], [1], []]
    assert three_lanes.has_adjacent_lane().tolist() == [True, True, True, False]


def test_adjacency_is_symmetric_and_a_lane_is_not_adjacent_to_itself_or_to_the_next_but_one(three_lanes):
    a, b = np.array([0, 1, 1, 0, 1, 3], np.int32), np.array([1, 0, 2, 2, 1, 1], np.int32)
    assert three_lanes.are_adjacent(a, b).tolist() == [True, True, True, False, False, False]
    assert three_lanes.are_adjacent(b, a).tolist() == three_lanes.are_adjacent(a, b).tolist()


def test_nothing_is_adjacent_to_no_lane(three_lanes):
    """-1 stands both for "no adjacent lane" and for "off the network"; lane 3 has no adjacent lane, lane 2 no left one."""
    a, b = np.array([3, 2, -1, -1], np.int32), np.array([-1, -1, 3, -1], np.int32)
    assert three_lanes.are_adjacent(a, b).tolist() == [False, False, False, False]


def test_each_pair_of_adjacent_lanes_is_named_once(three_lanes):
    assert three_lanes.adjacent_pairs().tolist() == [[0, 1], [1, 2]]
    assert lanes_of([(0, 0), (1, 0)]).adjacent_pairs().shape == (0, 2)
