"""Segments of a route and the evidence for them, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from hippodrome.core.matching.search.track import Track
from hippodrome.core.matching.segments import (
    RouteSegment,
    consistent_with_closures,
    route_segments,
    significant_segments,
    with_evidence,
)


def track(heading_rad):
    arc = np.arange(float(len(heading_rad)))
    return Track(arc, np.asarray(heading_rad, dtype=float), arc, 1.0)


def route(heading_rad, score_nats, log_scale=None, points_m=None):
    """As much of a route as the evidence is taken from."""
    count = len(heading_rad)
    return SimpleNamespace(
        track=track(heading_rad),
        score_nats=np.asarray(score_nats, dtype=float),
        log_scale=np.zeros(count) if log_scale is None else np.asarray(log_scale, dtype=float),
        points_m=np.zeros((count, 2)) if points_m is None else points_m,
        lane=np.zeros(count, dtype=np.int32),
    )


def known_evidence(segment):
    return segment.evidence_nats


def test_a_segment_is_a_run_of_explained_samples():
    explained = np.isin(np.arange(20), [2, 3, 4, 9, 10])
    assert [(s.first, s.end) for s in route_segments(route(np.zeros(20), np.zeros(20)), explained)] == [(2, 5), (9, 11)]


def test_a_segment_is_judged_by_its_mirror_image_less_the_choice_of_it():
    corner = np.where(np.arange(40) < 20, 0.0, 0.5 * np.pi)
    asked = []

    def control(first, end, least_nats, settled_nats):
        asked.append((first, end, least_nats, settled_nats))
        return -30.0

    drive, whole, half = route(corner, np.full(40, -0.1)), RouteSegment(0, 40), RouteSegment(10, 30)
    (found,) = with_evidence([whole], drive, control, 50.0)
    assert found.evidence_nats == pytest.approx(30.0 - 2.0 * 3.9)  # the step that leads to the first sample does not count
    assert asked[0] == (0, 40, pytest.approx(-2.0 * 3.9 - 50.0), pytest.approx(-2.0 * 3.9))
    (found,) = with_evidence([half], drive, control, 50.0)
    assert found.evidence_nats == pytest.approx(30.0 - 2.0 * 1.9 - 4.0 * np.log(2.0))


@pytest.mark.parametrize(
    ("whole", "window", "evidence", "asked"),
    [(-200.0, None, 9.0, 1), (-85.0, -60.0, 9.0, 2), (-85.0, -30.0, 5.0, 2), (-35.0, None, -45.0, 1)],
    ids=["the whole is evident", "the window is", "neither is", "chance explains the whole as well"],
)
def test_the_whole_is_tried_first_and_then_the_turns_around_one_place(whole, window, evidence, asked):
    """A drive of 400 samples costs 40 nats and is held to 80, its 120 samples that turn most to 24."""
    answers = iter([whole, window])
    drive, parts = route(np.where(np.arange(400) < 200, 0.0, 0.5 * np.pi), np.full(400, -40.0 / 399.0)), []

    def control(first, end, least_nats, settled_nats):
        parts.append((first, end))
        return next(answers)

    (found,) = with_evidence([RouteSegment(0, 400)], drive, control, 9.0)
    assert found.evidence_nats == pytest.approx(evidence)
    assert len(parts) == asked
    assert parts[0] == (0, 400)


def test_what_does_not_turn_is_no_evidence_and_is_not_searched():
    def control(first, end, least_nats, settled_nats):
        raise AssertionError("searched")

    assert with_evidence([RouteSegment(0, 40)], route(np.zeros(40), np.zeros(40)), control, 8.0)[0].evidence_nats == 0.0


def test_short_gaps_carry_certainty_on_and_jumps_of_the_scale_do_not():
    found = [RouteSegment(0, 5), RouteSegment(9, 20), RouteSegment(20, 30), RouteSegment(60, 90, 40.0), RouteSegment(95, 99)]
    assert (
        significant_segments(found, known_evidence, 10, 8.0, 3.0, start_known=False) == found[3:]
    )  # 30 samples are too long a gap
    assert significant_segments(found, known_evidence, 10, 8.0, 3.0, start_known=True) == [*found[:2], *found[3:]]


def test_a_jump_of_the_scale_begins_another_segment():
    found = route_segments(route(np.zeros(20), np.zeros(20), np.where(np.arange(20) < 8, 0.0, 0.4)), np.ones(20, bool))
    assert [(s.first, s.end) for s in found] == [(0, 8), (8, 20)]


def test_one_certain_segment_carries_the_others():
    found = [RouteSegment(0, 5, 3.0), RouteSegment(19, 30, 8.0), RouteSegment(50, 90, 40.0)]
    assert significant_segments(found, known_evidence, 10, 24.0, 6.0, start_known=False) == found[1:]
    assert significant_segments(found[:2], known_evidence, 10, 24.0, 6.0, start_known=False) == []
    assert significant_segments(found[:2], known_evidence, 10, 24.0, 6.0, start_known=True) == found[:2]


def test_a_short_segment_is_never_certain_by_itself():
    found = [RouteSegment(0, 5, 40.0), RouteSegment(20, 60, 2.0)]
    assert significant_segments(found, known_evidence, 10, 8.0, 3.0, start_known=False) == []
    assert significant_segments(found, known_evidence, 5, 8.0, 3.0, start_known=False) == found[:1]


def test_only_what_decides_is_asked_for():
    asked = []

    def evidence(segment):
        asked.append(segment)
        return segment.evidence_nats

    found = [RouteSegment(0, 5, 2.0), RouteSegment(30, 90, 40.0), RouteSegment(95, 160, 40.0)]
    assert significant_segments(found, evidence, 10, 8.0, 3.0, start_known=False) == found[1:]
    assert asked == [found[2], found[0]]  # the one between is parted from the last by 25 m only
    asked.clear()
    assert significant_segments(found[:1], evidence, 10, 8.0, 3.0, start_known=False) == []
    assert asked == []  # too short to be certain, and no other one is


def test_loop_closures_vote_down_the_segment_that_is_elsewhere():
    points = np.zeros((30, 2))
    points[20:] = 500.0  # the third visit to one place, matched elsewhere
    found = [RouteSegment(0, 10, 40.0), RouteSegment(10, 20, 40.0), RouteSegment(20, 30, 40.0)]
    again = np.arange(10)
    closures = SimpleNamespace(source=np.concatenate([again + 10, again + 20]), target=np.concatenate([again, again]))
    seen = route(np.zeros(30), np.zeros(30), points_m=points)
    assert consistent_with_closures(found, seen, closures, 30.0, 6, 0.34) == found[:2]
    assert consistent_with_closures(found, seen, closures, 30.0, 11, 0.34) == found  # too few to vote
