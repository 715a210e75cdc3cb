"""Segments of a route and their log-odds, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from hippodrome.core.matching.search.track import Track
from hippodrome.core.matching.segments import (
    RouteSegment,
    consistent_with_closures,
    route_segments,
    significant_segments,
    turning_rad,
)


def track(heading_rad):
    arc = np.arange(float(len(heading_rad)))
    return Track(arc, np.asarray(heading_rad, dtype=float), arc, 1.0)


def route(heading_rad, score_nats, log_scale=None, points_m=None):
    """As much of a route as the log-odds are taken from."""
    count = len(heading_rad)
    return SimpleNamespace(
        track=track(heading_rad),
        score_nats=np.asarray(score_nats, dtype=float),
        log_scale=np.zeros(count) if log_scale is None else np.asarray(log_scale, dtype=float),
        points_m=np.zeros((count, 2)) if points_m is None else points_m,
    )


def test_a_right_angle_counts_once_and_noise_not_at_all():
    corner = np.where(np.arange(40) < 20, 0.0, 0.5 * np.pi)
    assert turning_rad(track(corner)).sum() == pytest.approx(0.5 * np.pi - 0.15)
    assert turning_rad(track(0.07 * (-1.0) ** np.arange(40))).sum() == 0.0


def test_a_segment_is_credited_for_turns_and_debited_for_its_score():
    corner = np.where(np.arange(40) < 20, 0.0, 0.5 * np.pi)
    explained = np.arange(40) >= 10
    (found,) = route_segments(route(corner, np.full(40, -0.1)), explained, 6.0)
    assert (found.first, found.end) == (10, 40)
    assert found.log_odds_nats == pytest.approx(6.0 * (0.5 * np.pi - 0.15) - 0.1 * 29)  # the step onto the network does not count


def test_a_jump_of_the_scale_begins_another_segment():
    found = route_segments(route(np.zeros(20), np.zeros(20), np.where(np.arange(20) < 8, 0.0, 0.4)), np.ones(20, bool), 6.0)
    assert [(s.first, s.end) for s in found] == [(0, 8), (8, 20)]


def test_one_certain_segment_carries_the_others():
    found = [RouteSegment(0, 5, 3.0), RouteSegment(9, 20, 8.0), RouteSegment(30, 90, 40.0)]
    assert significant_segments(found, 24.0, 6.0, start_known=False) == found[1:]
    assert significant_segments(found[:2], 24.0, 6.0, start_known=False) == []
    assert significant_segments(found[:2], 24.0, 6.0, start_known=True) == found[:2]


def test_loop_closures_vote_down_the_segment_that_is_elsewhere():
    points = np.zeros((30, 2))
    points[20:] = 500.0  # the third visit to one place, matched elsewhere
    found = [RouteSegment(0, 10, 40.0), RouteSegment(10, 20, 40.0), RouteSegment(20, 30, 40.0)]
    again = np.arange(10)
    closures = SimpleNamespace(source=np.concatenate([again + 10, again + 20]), target=np.concatenate([again, again]))
    seen = route(np.zeros(30), np.zeros(30), points_m=points)
    assert consistent_with_closures(found, seen, closures, 30.0, 6, 0.34) == found[:2]
    assert consistent_with_closures(found, seen, closures, 30.0, 11, 0.34) == found  # too few to vote
