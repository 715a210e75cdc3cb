"""The plan: times by hand, detours, what is unmapped, and what cannot be reached."""

import math

import numpy as np
import pytest

from hippodrome.core.navigation.config import PlanConfig
from hippodrome.core.navigation.routes import mapped_lanes, place_to_turn, road_times, route, time_left_s, times_to_goal
from tests.core.navigation.roads import map_along, network_of, ring, street, two_ways

CONFIG = PlanConfig(speed_share=1.0, unmapped_factor=2.0)


def planned(network, mapped=None, closed=(), goal=(4, 50.0)):
    roads = road_times(network, np.ones(network.lane_count, dtype=bool) if mapped is None else mapped, CONFIG)
    return roads, times_to_goal(roads, *goal, closed, CONFIG)


def test_the_time_to_the_goal_is_length_over_speed():
    roads, times = planned(two_ways())
    assert time_left_s(roads, times, 0, 20.0) == pytest.approx((30.0 + 100.0 + 50.0) / 10.0)
    assert time_left_s(roads, times, 4, 10.0) == pytest.approx(4.0)


def test_a_closed_road_is_driven_around():
    roads, times = planned(two_ways(), closed={1})
    lanes = [piece.lane for piece in route(roads, times, 0, 0.0, 5.0, CONFIG)]
    assert lanes == [0, 2, 3, 4]


def test_an_unmapped_road_is_avoided_where_the_way_round_is_not_much_longer():
    network = network_of(
        [[(0, 0), (50, 0)], [(50, 0), (150, 0)], [(50, 0), (100, 30)], [(100, 30), (150, 0)], [(150, 0), (250, 0)]],
        [(0, 1), (0, 2), (1, 4), (2, 3), (3, 4)],
    )
    mapped = np.ones(5, dtype=bool)
    assert [p.lane for p in route(*planned(network, mapped), 0, 0.0, 5.0, CONFIG)] == [0, 1, 4]
    mapped[1] = False
    assert [p.lane for p in route(*planned(network, mapped), 0, 0.0, 5.0, CONFIG)] == [0, 2, 3, 4]


def test_what_cannot_be_reached_has_no_route():
    roads, times = planned(two_ways(), closed={1, 2})
    assert route(roads, times, 0, 0.0, 5.0, CONFIG) is None
    assert math.isinf(time_left_s(roads, times, 0, 0.0))


def test_a_goal_behind_on_the_same_lane_is_reached_round_the_block():
    roads, times = planned(ring(), goal=(0, 20.0))
    assert [p.lane for p in route(roads, times, 0, 50.0, 5.0, CONFIG)][:8] == [0, 4, 1, 5, 2, 6, 3, 7]


def test_a_lane_change_is_made_in_time_for_the_lane_that_leads_on():
    lines = [[(0, 0), (100, 0)], [(0, 3.2), (100, 3.2)], [(100, 3.2), (200, 3.2)]]
    network = network_of(lines, [(1, 2)], left=[1, -1, -1], right=[-1, 0, -1], edges=[0, 0, 1])
    pieces = route(*planned(network, goal=(2, 50.0)), 0, 10.0, 8.0, CONFIG)
    assert [(piece.lane, piece.side_step) for piece in pieces] == [(0, False), (1, True), (2, False)]


def test_a_lane_is_mapped_where_vertices_lie_all_along_it():
    network = two_ways()
    known = map_along(network)
    known.poses = known.poses[(known.poses[:, 0] < 151.0) & (np.abs(known.poses[:, 1]) < 1.0)]
    assert mapped_lanes(network, known, 12.0).tolist() == [True, True, False, False, False]


def test_turning_round_is_a_way_only_where_it_is_asked_for_and_costs_what_it_is_said_to():
    network = street(80.0)
    roads, times = planned(network, goal=(2, 10.0))
    assert time_left_s(roads, times, 0, 30.0) == math.inf
    opposite = (1, 0, -1)
    turning = times_to_goal(roads, 2, 10.0, (), CONFIG, opposite)
    assert turning.from_begin_s[0] == pytest.approx(CONFIG.turn_round_s + 1.0)  # at its beginning, and 10 m
    assert turning.from_begin_s[1] == times.from_begin_s[1]
    assert place_to_turn(roads, turning, 0, 30.0, opposite, CONFIG) == (0, 30.0)


def test_where_only_a_later_street_has_two_ways_one_turns_there():
    lines = [[(-60, -1.6), (0, -1.6)], [(0, -1.6), (80, -1.6)], [(80, 1.6), (0, 1.6)], [(0, 1.6), (0, 90)]]
    network = network_of(lines, [(0, 1), (2, 3)])
    roads, times = planned(network, goal=(3, 50.0))
    assert time_left_s(roads, times, 0, 10.0) == math.inf
    turning = times_to_goal(roads, 3, 50.0, (), CONFIG, (-1, 2, 1, -1))
    assert place_to_turn(roads, turning, 0, 10.0, (-1, 2, 1, -1), CONFIG) == (1, 0.0)
