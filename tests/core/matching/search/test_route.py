from dataclasses import replace

import numpy as np
import pytest

from hippodrome.core.matching.search import coarse, states
from hippodrome.core.matching.search import passes as search_passes
from hippodrome.core.matching.search.config import RouteSearchConfig
from hippodrome.core.matching.search.route import search_route
from hippodrome.core.matching.search.track import make_track, scale_range
from hippodrome.core.types import HippodromeError, StartPose, Visits
from tests.core.matching.drives import misplaced_m, random_drive, square_grid, visits_along
from tests.core.roads.test_lane_graph import lanes_network
from tests.core.synthetic import grid_network

CONFIG = RouteSearchConfig()


@pytest.fixture(scope="module")
def town():
    return grid_network(np.random.default_rng(4), columns=3, rows=4)


@pytest.fixture(scope="module")
def drive(town):
    return random_drive(town, 5, 1200.0, turn_noise_rad=0.004)


def test_unknown_start_and_scale_are_found(town, drive):
    visits, poses, _ = drive
    route = search_route(visits, town, CONFIG)
    assert misplaced_m(route, poses).max() < 6.0
    np.testing.assert_allclose(route.log_scale, np.log(2.0), atol=0.1)


def test_alternatives_are_the_good_ones_and_the_best_is_among_them(town, drive):
    alternatives = search_route(drive[0], town, CONFIG).alternatives
    assert alternatives.through_nats.min() >= -CONFIG.margin_nats
    np.testing.assert_allclose(np.maximum.reduceat(alternatives.through_nats, alternatives.row_start[:-1]), 0.0, atol=1e-2)


def test_a_large_table_of_states_changes_no_answer(town, drive, monkeypatch):
    once = search_route(drive[0], town, CONFIG)
    monkeypatch.setattr(states, "_MANY_STATES", 1)
    again = search_route(drive[0], town, CONFIG)
    np.testing.assert_array_equal(again.points_m, once.points_m)
    np.testing.assert_array_equal(again.alternatives.through_nats, once.alternatives.through_nats)


def test_a_drive_searched_in_sections_gives_the_same_answer(town, drive, monkeypatch):
    visits, poses, _ = drive
    once = search_route(visits, town, CONFIG, StartPose(*poses[0]))
    monkeypatch.setattr(search_passes, "_MAX_ROWS", 20_000)
    parts = search_route(visits, town, CONFIG, StartPose(*poses[0]))
    np.testing.assert_array_equal(parts.points_m, once.points_m)
    np.testing.assert_array_equal(parts.score_nats, once.score_nats)
    np.testing.assert_array_equal(parts.alternatives.row_start, once.alternatives.row_start)
    np.testing.assert_allclose(parts.alternatives.through_nats, once.alternatives.through_nats, atol=1e-3)


def test_a_network_searched_in_parts_gives_the_same_answer(town, drive, monkeypatch):
    whole = search_route(drive[0], town, CONFIG)
    monkeypatch.setattr(coarse, "_MOST_STATES", 9_000)
    parted = search_route(drive[0], town, CONFIG)
    assert parted.total_nats == pytest.approx(whole.total_nats, abs=0.01)
    np.testing.assert_allclose(parted.points_m, whole.points_m, atol=1.0)


def test_the_unit_of_length_does_not_matter(town, drive):
    visits, _, _ = drive
    tiny = replace(visits, motion=visits.motion * [1e-3, 1e-3, 1.0])
    route, scaled = (search_route(v, town, CONFIG) for v in (visits, tiny))
    np.testing.assert_array_equal(route.lane, scaled.lane)
    np.testing.assert_allclose(scaled.log_scale - route.log_scale, np.log(1e3), atol=1e-6)


def test_the_frame_of_the_network_does_not_matter(town, drive):
    visits, _, _ = drive
    cos, sin = np.cos(2.0), np.sin(2.0)
    moved = replace(town, points_m=town.points_m @ np.array([[cos, sin], [-sin, cos]]) + [1e4, -3e3])
    here, there = search_route(visits, town, CONFIG), search_route(visits, moved, CONFIG)
    assert np.mean(here.lane == there.lane) > 0.98  # a place at a lane's end may round to either lane
    assert here.total_nats == pytest.approx(there.total_nats, rel=0.2)  # bins fall otherwise on the lanes


def test_scale_wander_and_jumps_are_followed(town):
    rng = np.random.default_rng(8)
    _, poses, _ = random_drive(town, 6, 1500.0)
    units = 0.5 * np.exp(0.2 * (np.arange(len(poses)) // 150 % 2) + 0.05 * np.sin(np.arange(len(poses)) / 60.0))
    route = search_route(visits_along(poses, units, turn_noise_rad=0.01, rng=rng), town, CONFIG)
    assert np.percentile(misplaced_m(route, poses), 95) < 8.0
    assert misplaced_m(route, poses).max() < 20.0  # a straight end shows no scale


def test_stops_and_uneven_spacing_change_nothing(town, drive):
    _, poses, _ = drive
    rng = np.random.default_rng(1)
    keep = np.sort(rng.choice(len(poses), 2 * len(poses) // 3, replace=False))
    stopping = np.sort(np.concatenate([keep, rng.choice(keep, 40)]))  # a repeated pose is a stop
    route = search_route(visits_along(poses[stopping]), town, CONFIG)
    assert misplaced_m(route, poses[stopping]).max() < 8.0


def test_the_driving_side_is_respected(town, drive):
    visits, _, lanes = drive
    route = search_route(visits, town, CONFIG)
    nearest = np.clip(np.searchsorted(route.track.visit_arc, route.track.arc), 0, len(lanes) - 1)
    on_road = ~town.is_internal[lanes[nearest]] & ~town.is_internal[route.lane]
    assert np.mean(route.lane[on_road] == lanes[nearest][on_road]) > 0.97


def test_a_u_turn_at_a_dead_end_is_followed():
    there = [(0.0, 0.0), (60.0, 0.0), (110.0, 40.0), (200.0, 40.0)]
    back = [(x, y + 3.2) for x, y in reversed(there)]
    network = lanes_network([there, [there[-1], (203.0, 41.6), back[0]], back], [[1], [2], []])
    points = np.concatenate([_resampled(there), _resampled(back)])
    visits = visits_along(_with_headings(points))
    route = search_route(visits, network, CONFIG)
    assert misplaced_m(route, points).max() < 8.0
    assert route.lane[0] == 0
    assert route.lane[-1] == 2


def test_a_lane_change_is_followed():
    left = [(0.0, 3.2), (150.0, 3.2), (200.0, 60.0), (200.0, 200.0)]  # only the left lane leads on to the north
    right = [(0.0, 0.0), (150.0, 0.0), (210.0, -50.0), (210.0, -200.0)]
    network = lanes_network(
        [left[:2], right[:2], left[1:], right[1:]], [[2], [3], [], []], left=[-1, 0, -1, -1], right=[1, -1, -1, -1]
    )
    points = np.concatenate([_resampled([(0.0, 0.0), (60.0, 0.0)]), _resampled([(90.0, 3.2), *left[1:]])])
    route = search_route(visits_along(_with_headings(points)), network, CONFIG, StartPose(0.0, 0.0, 0.0, sigma_m=0.5))
    assert route.lane[0] == 1
    assert route.lane[-1] == 2
    assert misplaced_m(route, points).max() < 6.0


def _resampled(points):
    """Every 5 m along a polyline."""
    points = np.array(points)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    s = np.arange(0.0, along[-1], 5.0)
    return np.column_stack([np.interp(s, along, points[:, axis]) for axis in (0, 1)])


def _with_headings(points):
    step = np.gradient(points, axis=0)
    return np.column_stack([points, np.arctan2(step[:, 1], step[:, 0])])


def test_a_start_pose_decides_what_geometry_cannot():
    network = square_grid()
    visits, poses, _ = random_drive(network, 3, 1200.0)
    route = search_route(visits, network, CONFIG, StartPose(*poses[0]))
    assert misplaced_m(route, poses).max() < 6.0


def test_a_drive_that_begins_off_the_network_is_found_with_a_start_pose(town, drive):
    _, poses, _ = drive
    yard = np.column_stack([np.linspace(-80.0, 0.0, 16), np.zeros(16), np.zeros(16)])[:-1]
    ahead = poses[0] + np.zeros_like(yard)
    before = np.column_stack([ahead[:, :2] + yard[:, :1] * [np.cos(poses[0, 2]), np.sin(poses[0, 2])], ahead[:, 2]])
    before[:, :2] += 40.0 * (yard[:, :1] / -80.0) * [-np.sin(poses[0, 2]), np.cos(poses[0, 2])]
    whole = _with_headings(np.concatenate([before[:, :2], poses[:200, :2]]))
    route = search_route(visits_along(whole), town, CONFIG, StartPose(*whole[0]))
    late = route.track.arc > route.track.visit_arc[40]
    assert misplaced_m(route, whole)[late].max() < 8.0


def test_a_drive_without_motion_is_refused(town):
    still = Visits(np.arange(5.0), np.arange(5, dtype=np.int32), np.zeros((5, 3)))
    with pytest.raises(HippodromeError, match="never moved"):
        search_route(still, town, CONFIG)


def test_the_track_keeps_headings_at_even_lengths():
    motion = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 0.0, 0.0], [4.0, 0.0, 0.4]])
    track = make_track(Visits(np.array([0.0, 1.0, 9.0, 10.0]), np.arange(4, dtype=np.int32), motion), 2.0)
    np.testing.assert_allclose(track.visit_arc, [0.0, 4.0, 4.0, 8.0 + 4.0 * (0.2 / np.sin(0.2) - 1.0)])
    np.testing.assert_allclose(track.heading_rad[:3], 0.0)
    assert track.heading_rad[-1] == pytest.approx(0.4, abs=0.01)


def test_scales_come_from_speeds_and_limits():
    network = lanes_network([[(0, 0), (100, 0)]], [[]])  # 10 m/s
    motion = np.column_stack([np.full(11, 4.0), np.zeros(11), np.zeros(11)])
    low, typical, high = scale_range(Visits(np.arange(11.0), np.arange(11, dtype=np.int32), motion), network)
    assert typical == pytest.approx(2.5)
    assert low < 0.25 * typical
    assert high > 1.3 * typical
