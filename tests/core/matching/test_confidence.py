from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from hippodrome.core.matching.confidence import (
    distant_gap,
    far_probability,
    match_breaks,
    match_status,
    reject_displaced,
    reject_doubtful,
    reject_uncertain,
)
from hippodrome.core.matching.config import ConfidenceConfig
from hippodrome.core.matching.control import control_of
from hippodrome.core.matching.search.config import RouteSearchConfig
from hippodrome.core.matching.search.problem import search_problem
from hippodrome.core.matching.search.route import Route, RouteAlternatives, most_likely_drive, search_route
from hippodrome.core.matching.search.track import Track
from hippodrome.core.types import MatchStatus, StartPose
from tests.core.matching.drives import misplaced_m, random_drive, square_grid
from tests.core.synthetic import grid_network

CONFIG = ConfidenceConfig()


def alternatives(rival_log_scale=0.0):
    """Two moments: a rival 50 m away and 3 nats behind at the first; only a near one at the second."""
    points = np.array([[0.0, 0.0], [50.0, 0.0], [5.0, 0.0], [6.0, 0.0]], dtype=np.float32)
    nats = np.array([-10.0, -13.0, -10.0, -10.5], dtype=np.float32)
    return RouteAlternatives(np.array([0, 2, 4]), points, nats, np.array([0.0, rival_log_scale, 0.0, 0.0]))


def gap(log_scale, rivals):
    found = SimpleNamespace(points_m=np.array([[0.0, 0.0], [5.0, 0.0]]), log_scale=np.asarray(log_scale), alternatives=rivals)
    return distant_gap(found, CONFIG).tolist()


def test_the_gap_is_to_the_best_distant_alternative():
    assert gap([0.0, 0.0], alternatives()) == [3.0, np.inf]


def test_a_jump_in_scale_costs_more_on_a_drive_that_has_none():
    assert gap([0.0, 0.1], alternatives(rival_log_scale=0.3)) == [3.0 + CONFIG.steady_scale_nats, np.inf]
    assert gap([0.0, 0.3], alternatives(rival_log_scale=0.3)) == [3.0, np.inf]


def test_the_alternatives_tell_how_probably_a_place_is_far_off():
    """Where nothing tells how far along a road the vehicle is, the alternatives are spread along it."""
    points = np.array([[0.0, 0.0], [12.0, 0.0], [-50.0, 0.0], [0.0, 0.0], [8.0, 0.0]], dtype=np.float32)
    nats = np.log([1.0, 0.5, 0.5, 1.0, 1.0]).astype(np.float32)
    track = Track(np.array([0.0, 5.0]), np.zeros(2), np.array([0.0, 5.0]), 5.0)
    jumped = np.array([0.0, 0.0, 0.3, 0.0, 0.0])

    def found(log_scale):
        return SimpleNamespace(
            track=track, log_scale=np.array(log_scale), alternatives=RouteAlternatives(rows, points, nats, jumped)
        )

    rows, places, status = np.array([0, 3, 5]), np.zeros((2, 2)), np.full(2, MatchStatus.MATCHED, dtype=np.uint8)
    np.testing.assert_allclose(far_probability(found([0.0, 0.3]), places, CONFIG), [0.5, 0.0], atol=1e-6)
    steady = far_probability(found([0.0, 0.0]), places, CONFIG)[0]  # this odometer's scale does not jump
    np.testing.assert_allclose(steady, 1.0 / 3.0, atol=1e-3)
    doubted = reject_doubtful(status, found([0.0, 0.3]), places, CONFIG)
    assert doubted.tolist() == [MatchStatus.AMBIGUOUS, MatchStatus.MATCHED]
    moved = np.array([[9.0, 0.0], [9.0, 0.0]])  # the refinement found it between both: only the third is far off
    assert reject_doubtful(status, found([0.0, 0.0]), moved, CONFIG).tolist() == status.tolist()
    off = np.full(2, MatchStatus.OFF_NETWORK, dtype=np.uint8)
    assert reject_doubtful(off, found([0.0, 0.3]), places, CONFIG).tolist() == off.tolist()


def test_each_status_has_its_reason():
    steps = 100
    rows = np.arange(2 * steps + 1)[::2][: steps + 1]
    points = np.zeros((steps, 2))
    rivals = np.tile(np.array([[0.0, 0.0], [99.0, 0.0]], dtype=np.float32), (steps, 1))
    through = np.zeros((steps, 2), dtype=np.float32)
    through[:, 1] = np.where(np.arange(steps) < 30, -3.0, -20.0)
    lane = np.where(np.arange(steps) >= 90, -1, 0).astype(np.int32)
    score = np.where((np.arange(steps) > 50) & (np.arange(steps) < 80), -4.0, -0.1)
    nothing = np.zeros(steps)
    weaving = np.cumsum(np.where(np.arange(steps) // 10 % 2, 0.3, -0.3))  # turns that roads explain
    route = Route(
        track=Track(nothing, weaving, nothing, 1.0),
        points_m=points,
        lane=lane,
        position_m=nothing,
        log_scale=nothing,
        heading_offset_rad=nothing,
        score_nats=score,
        total_nats=0.0,
        alternatives=RouteAlternatives(rows, rivals, through.ravel(), np.zeros(2 * steps)),
    )
    status = match_status(
        route, lambda first, end, least_nats, settled_nats: -1e3, replace(CONFIG, certain_samples=20)
    )  # no mirrored drive fits: evidence enough
    assert set(status[:30]) == {MatchStatus.AMBIGUOUS}
    assert status[35] == MatchStatus.MATCHED
    assert set(status[55:75]) == {MatchStatus.OFF_NETWORK}
    assert set(status[90:]) == {MatchStatus.OFF_NETWORK}
    assert set(np.flatnonzero(~route.explained(1.5))) > set(range(51, 80)) | set(range(90, 100))
    assert not route.settles(10, 1.5)


def test_breaks_name_every_run_with_its_cause():
    found = match_breaks(np.array([0, 1, 1, 2, 0, 0, 1], dtype=np.uint8))
    assert [(b.first_vertex, b.last_vertex, b.status) for b in found] == [
        (1, 2, MatchStatus.AMBIGUOUS),
        (3, 3, MatchStatus.OFF_NETWORK),
        (6, 6, MatchStatus.AMBIGUOUS),
    ]
    assert all(b.cause for b in found)
    assert match_breaks(np.zeros(4, dtype=np.uint8)) == ()


def searched(visits, network, start=None):
    """The route of a drive and the status of its samples."""
    config = RouteSearchConfig()
    problem = search_problem(visits, network, config)
    route = most_likely_drive(problem, config, start)
    return route, match_status(route, control_of(problem, config, route), CONFIG, start_known=start is not None)


def test_a_self_similar_grid_is_ambiguous_without_a_prior_and_matched_with_one():
    network = square_grid(columns=3, rows=3)
    visits, poses, _ = random_drive(network, 3, 500.0)
    assert np.all(searched(visits, network)[1] == MatchStatus.AMBIGUOUS)
    told, status = searched(visits, network, StartPose(*poses[0]))
    assert np.mean(status == MatchStatus.MATCHED) > 0.85  # the last straight shows no scale: it may end 30 m farther
    assert misplaced_m(told, poses).max() < 6.0


def test_what_is_accepted_is_right_on_short_drives_too():
    network = grid_network(np.random.default_rng(2), columns=3, rows=3)
    accepted = 0
    for seed in range(4):
        visits, poses, _ = random_drive(network, seed, 350.0, turn_noise_rad=0.004)
        route, status = searched(visits, network)
        matched = status == MatchStatus.MATCHED
        accepted += matched.any()
        assert misplaced_m(route, poses)[matched].max(initial=0.0) < 15.0
    assert accepted > 0


def test_another_town_and_the_mirrored_drive_are_not_matched():
    """Drives through one town, offered another of the same make: nothing is vouched for, and every vertex has its cause."""
    for seed in (3, 4):
        network = grid_network(np.random.default_rng(seed), columns=3, rows=3)
        visits, _, _ = random_drive(network, seed, 800.0, turn_noise_rad=0.004)
        elsewhere = grid_network(np.random.default_rng(30 + seed), columns=3, rows=3)
        turned = replace(visits, motion=visits.motion * [1.0, -1.0, -1.0])
        for other, town in ((visits, elsewhere), (turned, network), (turned, elsewhere)):
            status = searched(other, town)[1]
            assert not np.any(status == MatchStatus.MATCHED)
            assert sum(b.last_vertex - b.first_vertex + 1 for b in match_breaks(status)) == len(status)


def test_a_vertex_that_may_be_anywhere_along_its_road_is_ambiguous():
    status = np.full(3, MatchStatus.MATCHED, dtype=np.uint8)
    slanting = np.array([[5.0, 4.9], [4.9, 5.0]])  # 3.15 m along the diagonal
    covariance = np.stack([np.diag([8.9, 1.0]), np.diag([1.0, 9.1]), slanting])
    assert reject_uncertain(status, covariance, CONFIG).tolist() == [MatchStatus.MATCHED, *[MatchStatus.AMBIGUOUS] * 2]


def test_a_vertex_that_the_refinement_drags_away_becomes_ambiguous():
    network = grid_network(np.random.default_rng(2), columns=3, rows=3)
    visits, poses, _ = random_drive(network, 0, 350.0)
    route = search_route(visits, network, RouteSearchConfig(), StartPose(*poses[0]))
    status = np.full(len(poses), MatchStatus.MATCHED, dtype=np.uint8)
    assert np.array_equal(reject_displaced(status, route, poses[:, :2], CONFIG), status)
    dragged = poses + np.where(np.arange(len(poses)) == 5, 20.0, 0.0)[:, None]
    assert np.flatnonzero(reject_displaced(status, route, dragged[:, :2], CONFIG)).tolist() == [5]
