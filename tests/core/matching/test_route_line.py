"""Lines through routes known by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from hippodrome.core.matching.route_line import route_line
from tests.core.synthetic import lanes_of


def route(lane, position_m, points_m, step_m):
    """As much of a route as its line is made of."""
    count = len(lane)
    return SimpleNamespace(
        lane=np.array(lane, np.int32),
        position_m=np.array(position_m, dtype=float),
        points_m=np.array(points_m, dtype=float),
        log_scale=np.zeros(count),
        track=SimpleNamespace(step=step_m),
    )


def test_a_line_follows_the_lanes_around_a_corner():
    """From 6 m on the first lane to 4 m on the next: 8 m, in legs of 4 m each."""
    network = lanes_of([(0, 0), (10, 0)], [(10, 0), (10, 10)], successor=[(0, 1)])
    line, arc = route_line(route([0, 1], [6.0, 4.0], [(6, 0), (10, 4)], 8.0), network)
    assert arc == pytest.approx([0.0, 8.0])
    assert line.arc_m == pytest.approx(0.25 + 0.5 * np.arange(16))
    assert line.lane.tolist() == [0] * 8 + [1] * 8
    assert line.points_m[[0, -1]] == pytest.approx(np.array([(6.25, 0.0), (10.0, 3.75)]))


def test_a_lane_change_enters_the_adjacent_lane_beside_the_vehicle():
    """In a bend: from 4 of 8 m one enters the inner lane at 2 of 4 m, and drives on to its end."""
    network = lanes_of([(0, 0), (8, 0)], [(0, 3), (4, 3)])
    network = replace(network, left_lane=np.array([1, -1], np.int32), right_lane=np.array([-1, 0], np.int32))
    line, arc = route_line(route([0, 1], [4.0, 4.0], [(4, 0), (4, 3)], 2.0), network)
    assert arc == pytest.approx([0.0, 2.0])
    assert line.lane.tolist() == [1] * 4
    assert line.position_m == pytest.approx([2.25, 2.75, 3.25, 3.75])


def test_off_the_network_a_line_runs_straight():
    network = lanes_of([(0, 0), (10, 0)])
    line, arc = route_line(route([0, -1, -1], [10.0, np.nan, np.nan], [(10, 0), (13, 4), (13, 5)], 5.0), network)
    assert arc == pytest.approx([0.0, 5.0, 6.0])
    assert set(line.lane.tolist()) == {-1}
    assert line.points_m[0] == pytest.approx([10.15, 0.2])
