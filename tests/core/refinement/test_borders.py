"""Parallel lanes are told apart by the borders that the camera read."""

import numpy as np

from hippodrome.core.refinement.borders import places_by_borders
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import UNSEEN_PERCENT

WIDTH_M, LENGTH_M = 3.2, 100.0
RIGHTMOST, INNER = (4, 99), (4, 6)  # per cent: the left and the right border are the edge of the road


def two_ways_of_two_lanes(internal=False):
    """Lanes 0 and 1 lead east, 1 to the left of 0; lanes 2 and 3 lead west."""
    north = WIDTH_M * np.array([0.0, 1.0, 2.0, 3.0])
    ends = [[[0.0, y], [LENGTH_M, y]] if lane < 2 else [[LENGTH_M, y], [0.0, y]] for lane, y in enumerate(north)]
    return RoadNetwork(
        lane_ids=("east_0", "east_1", "west_1", "west_0"),
        edge_ids=("east", "west"),
        lane_edge=np.array([0, 0, 1, 1], np.int32),
        is_internal=np.full(4, internal),
        width_m=np.full(4, WIDTH_M),
        speed_limit_mps=np.full(4, 8.0),
        points_m=np.array(ends).reshape(-1, 2),
        point_start=2 * np.arange(5, dtype=np.int32),
        successor=np.zeros(0, np.int32),
        successor_start=np.zeros(5, np.int32),
        left_lane=np.array([1, -1, -1, 2], np.int32),
        right_lane=np.array([-1, 0, 3, -1], np.int32),
    )


def told(north_m, edges, heading_rad=0.0, network=None):
    """Where keyframes in the middle of the road are put by one reading."""
    poses = np.array([[50.0, north_m, heading_rad]])
    places, known = places_by_borders(poses, np.array([edges], np.uint8), network or two_ways_of_two_lanes())
    return places[0].round(6).tolist(), bool(known[0])


def test_the_lane_whose_borders_were_read_is_told_wherever_the_keyframe_is():
    for north_m in (-0.5, 0.0, 1.7, WIDTH_M, WIDTH_M + 0.8):
        assert told(north_m, RIGHTMOST) == ([50.0, 0.0], True)
        assert told(north_m, INNER) == ([50.0, WIDTH_M], True)


def test_the_lanes_of_the_other_way_are_told_to_those_who_drive_it():
    assert told(2 * WIDTH_M, RIGHTMOST, np.pi) == ([50.0, round(3 * WIDTH_M, 6)], True)
    assert told(3 * WIDTH_M, INNER, np.pi) == ([50.0, round(2 * WIDTH_M, 6)], True)


def test_keyframes_whose_borders_tell_nothing_stay():
    for edges in ((UNSEEN_PERCENT, UNSEEN_PERCENT), (4, UNSEEN_PERCENT), (50, 50), (99, 99)):
        assert told(1.0, edges) == ([50.0, 1.0], False)
    assert told(1.0, RIGHTMOST, np.pi / 2) == ([50.0, 1.0], False)  # across the road
    assert told(1.0, RIGHTMOST, network=two_ways_of_two_lanes(internal=True)) == ([50.0, 1.0], False)  # in a junction
    assert told(80.0, RIGHTMOST) == ([50.0, 80.0], False)  # no road
