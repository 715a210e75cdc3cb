"""Map matching on roads known by hand: the right road, the estimates, and every break named."""

import numpy as np
import pytest

from hippodrome.core.matching.hmm.config import PaperMatchConfig
from hippodrome.core.matching.hmm.match import match
from hippodrome.core.roads.geometry import road_geometry
from hippodrome.core.types import MatchStatus
from tests.core.synthetic import grid_network, lanes_of, random_route, true_path

CONFIG = PaperMatchConfig(radius_m=20.0, route_slack_m=60.0)


def drive(x, y=1.0, heading=0.0):
    """Poses along given x at one y."""
    x = np.asarray(x, dtype=float)
    return np.column_stack([x, np.full(len(x), y), np.full(len(x), heading)])


def test_the_lane_of_the_driving_direction_wins_although_the_other_is_nearer():
    geometry = road_geometry(lanes_of([(0, 0), (200, 0)], [(200, 3), (0, 3)]))
    found = match(drive(np.arange(5.0, 195.0, 5.0), y=2.0), geometry, CONFIG)
    assert set(found.lane) == {0}
    assert found.position_m == pytest.approx(np.arange(5.0, 195.0, 5.0))
    assert found.breaks == ()
    assert found.sigma_z_m == pytest.approx(1.4826 * 2.0)
    assert found.beta_m == CONFIG.min_beta_m  # a clean drive: the floor


def test_vertices_far_from_any_road_are_a_named_break_and_the_rest_is_matched():
    geometry = road_geometry(lanes_of([(0, 0), (100, 0)], [(200, 0), (300, 0)]))
    poses = drive(np.arange(50.0, 260.0, 10.0))
    found = match(poses, geometry, CONFIG)
    far = (poses[:, 0] > 119.0) & (poses[:, 0] < 181.0)
    assert np.array_equal(found.lane < 0, far)
    assert np.array_equal(found.status == MatchStatus.OFF_NETWORK, far)
    assert np.isnan(found.matched_m[far]).all() and np.isfinite(found.matched_m[~far]).all()
    (stretch,) = found.breaks
    assert (stretch.first_vertex, stretch.last_vertex) == (int(far.argmax()), int(len(far) - 1 - far[::-1].argmax()))
    assert stretch.status is MatchStatus.OFF_NETWORK
    assert "20 m" in stretch.cause


def test_a_step_without_a_route_is_a_named_break_and_both_sides_are_matched():
    """Two roads end to end that do not connect."""
    geometry = road_geometry(lanes_of([(0, 0), (100, 0)], [(100.5, 0), (200, 0)]))
    config = PaperMatchConfig(radius_m=4.0, route_slack_m=60.0)
    found = match(drive(np.arange(2.0, 200.0, 8.0)), geometry, config)
    assert found.lane.tolist() == [0] * 13 + [1] * 12
    (step,) = found.breaks
    assert (step.first_vertex, step.last_vertex, step.status) == (12, 13, MatchStatus.NO_ROUTE)
    assert "no route" in step.cause


def test_a_lone_vertex_between_breaks_is_not_vouched_for():
    geometry = road_geometry(lanes_of([(0, 0), (100, 0)], [(158, 0), (162, 0)], [(220, 0), (300, 0)]))
    found = match(drive(np.arange(0.0, 300.0, 10.0)), geometry, PaperMatchConfig(radius_m=8.0, route_slack_m=60.0))
    assert found.status[16] == MatchStatus.NO_ROUTE
    assert found.lane[16] == -1
    assert [item.status for item in found.breaks] == [MatchStatus.OFF_NETWORK, MatchStatus.NO_ROUTE, MatchStatus.OFF_NETWORK]


def test_no_road_anywhere():
    geometry = road_geometry(lanes_of([(0, 0), (100, 0)]))
    found = match(drive(np.arange(5.0), y=900.0), geometry, CONFIG)
    assert (found.lane == -1).all()
    assert [(item.first_vertex, item.last_vertex) for item in found.breaks] == [(0, 4)]


def test_a_noisy_drive_through_a_town_finds_its_lanes():
    rng = np.random.default_rng(5)
    network = grid_network(rng)
    truth, lane = true_path(network, random_route(network, rng, 2500.0), rng)
    noise = np.cumsum(0.5 * rng.standard_normal((len(truth), 2)), axis=0)
    poses = truth + np.column_stack([noise - noise.mean(axis=0), np.zeros(len(truth))])
    found = match(poses, road_geometry(network), PaperMatchConfig())
    on_roads = ~network.is_internal[lane]
    assert np.mean(found.lane[on_roads] == lane[on_roads]) > 0.95
    error = np.linalg.norm(found.matched_m - poses[:, :2], axis=1)
    assert found.sigma_z_m == pytest.approx(1.4826 * np.median(error))
