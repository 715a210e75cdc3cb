"""Streets without views are learnt as they are driven, moved to where they were seen, and recognised."""

import math

import numpy as np
import pytest

from hippodrome.core.navigation.placing import LanePlace
from hippodrome.core.navigation.streets import Sight, StreetMemory, likeliest, smoothed
from hippodrome.core.navigation.track import begun, moved, with_pose
from hippodrome.core.views.config import ViewCellConfig

ALONG = np.array([1.0, 0.0])


def frame_at(x_m):
    """What is seen at a place of a street: houses as bars of grey whose edges come nearer, and wander out of the picture."""
    rng = np.random.default_rng(5)
    frame = np.full((120, 160, 3), 60, dtype=np.uint8)
    for house_m, grey in zip(range(4, 400, 4), rng.integers(70, 250, 99), strict=True):
        ahead = house_m - x_m
        if ahead > 2.0:
            edge, high = int(min(80, 240 / ahead)), int(min(50, 300 / ahead))
            side = slice(80 + edge, 80 + edge + 12) if grey % 2 else slice(max(68 - edge, 0), max(80 - edge, 0))
            frame[60 - high : 60 + high // 2, side] = grey
    return frame


def drive(memory, scale=1.0, variance=0.04, length_m=150):
    """Drives along a street, of whose metres the vehicle counts ``scale`` each, and is told the place at its end; the track."""
    track = begun(np.array([0.0, 0.0, 0.0]), np.diag([variance, 0.01, 1e-4]))
    errors = []
    for k in range(1, length_m + 1):
        track = moved(track, scale, 0.0, 0.015)
        place = LanePlace(0, float(track.pose[0]), 0.0, 0.0)
        track, sigma_m = memory.step(track, place, frame_at(float(k)), scale, 0.0, 0.015)
        errors.append((track.pose[0] - k, sigma_m))
    track = with_pose(track, np.array([float(length_m), 0.0, 0.0]), np.diag([0.01, 0.01, 1e-4]))
    memory.step(track, None, None, 0.0, 0.0, 0.015)
    return np.array(errors)


def test_the_second_time_a_street_is_known_ground():
    memory = StreetMemory(ViewCellConfig())
    first = drive(memory, scale=1.02)
    assert np.isnan(first[:, 1]).all() and abs(first[-1, 0]) == pytest.approx(3.0)
    assert memory.count > 50
    second = drive(memory, scale=0.98)
    heard = np.isfinite(second[:, 1])
    assert heard[70:140].mean() > 0.3
    assert abs(second[139, 0]) < 1.0  # 2.8 m without the views
    assert np.nanmin(second[:, 1]) < 1.2 and np.abs(second[heard, 0] / second[heard, 1]).max() < 2.0  # and it is honest


def test_a_place_that_is_known_well_needs_no_views():
    memory = StreetMemory(ViewCellConfig())
    drive(memory, length_m=30)
    assert memory.count == 0


def test_a_view_is_moved_by_its_share_of_what_the_end_told():
    sight = Sight(0, 50.0, 1.0, np.zeros(4, dtype=np.float32), ALONG, np.zeros((3, 2)))
    sums_m = np.array([[50.0, 0.0], [1.0, 0.0], [-2.0, 9.0]])  # corrections across the street are none of its business
    half = smoothed(sight, sums_m, 0.01)
    assert half.position_m == pytest.approx(50.0 - 2.0 / (1.0 + 1.0 + 0.2 + 0.01))
    assert half.variance_m2 == pytest.approx(1.0 - 1.0 / 2.21)
    assert smoothed(sight, np.array([[500.0, 0.0], [1.0, 0.0], [0.0, 0.0]]), 0.01) is None


def test_a_pose_that_jumps_or_is_lost_tells_nothing_of_the_views_before():
    for lost in (True, False):
        memory = StreetMemory(ViewCellConfig())
        track = begun(np.array([0.0, 0.0, 0.0]), np.diag([4.0, 0.01, 1e-4]))
        for k in range(20):
            track = moved(track, 1.0, 0.0)
            memory.step(track, LanePlace(0, float(k), 0.0, 0.0), frame_at(float(k)), 1.0, 0.0, 0.015)
        sure = begun(np.array([60.0, 0.0, 0.0]), np.diag([0.01, 0.01, 1e-4]))
        memory.step(None if lost else sure, None, None, 0.0, 0.0, 0.015)
        memory.step(sure, None, None, 0.0, 0.0, 0.015)
        assert memory.count == 0


@pytest.mark.parametrize("kind", ["unlike", "twins", "at the rim"])
def test_views_that_are_not_clear_tell_nothing(kind):
    rng = np.random.default_rng(3)
    views, off_m = rng.standard_normal((9, 64)).astype(np.float32), np.arange(-8.0, 9.0, 2.0)
    views[7] = views[2] if kind == "twins" else views[7]
    seen = {"unlike": rng.standard_normal(64).astype(np.float32), "twins": views[2], "at the rim": views[0]}[kind]
    assert likeliest(views, off_m, seen)[0] == -1
    assert not math.isnan(likeliest(views, off_m, views[4])[1]) and likeliest(views, off_m, views[4])[0] == 4
