"""Who may say that the goal is reached: witnesses of the place, and how well it is known along the way."""

import math

import numpy as np
import pytest

from hippodrome.core.navigation.track import begun, with_found
from hippodrome.core.navigation.witnesses import Witnesses, heard

SURE = np.diag([0.01, 0.01, 1e-4])


def driven(metres, told_off=None, end_off_m=math.nan, drift=0.015, before=None, heading=0.0):
    """The witnesses after a straight way, on which views say that the vehicle is ``told_off`` (ahead, left) from its pose."""
    now = Witnesses() if before is None else before
    for k in range(metres):
        track = begun(np.array([float(k), 0.0, heading]), SURE)
        told = None if told_off is None else track.pose + np.array([*told_off, 0.0])
        now = heard(now, track, 1.0, drift, told, end_off_m)
    return now


@pytest.mark.parametrize(
    ("told_off", "share", "fits", "vouches"),
    [
        (None, 1.0, 0.95, True),
        (None, 1.0, 0.80, False),
        (None, 0.6, 0.85, False),
        ((0.5, 0.0), 1.0, 0.80, True),  # fog: the ground fits badly, and all views are recognised
        ((0.5, 0.0), 0.1, 0.80, False),  # the hypotheses are elsewhere
        ((8.0, 0.0), 1.0, 0.95, False),  # views that say another place
        ((0.0, 3.2), 1.0, 0.95, False),  # or another lane
    ],
)
def test_an_arrival_needs_more_for_its_place_than_against_it(told_off, share, fits, vouches):
    assert driven(100, told_off).vouch(share, fits) is vouches


def test_what_was_heard_long_ago_fades():
    near, far = driven(60, (0.0, 0.0)), driven(400, before=driven(60, (0.0, 0.0)))
    assert far.views < 0.2 * near.views


def test_ends_of_lanes_speak_for_a_place_and_against_one():
    assert driven(10, end_off_m=0.3).ends > 0.8 and driven(10, end_off_m=3.0).ends < -0.8


def test_a_pose_is_not_better_along_the_way_than_what_was_measured_and_driven_since():
    track = begun(np.array([0.0, 0.0, 0.0]), SURE)
    fresh, far = driven(20, (0.0, 0.0)), driven(200, before=driven(20, (0.0, 0.0)))
    assert fresh.along_sigma_m(track, 3.0) < 0.7
    assert far.along_sigma_m(track, 5.0) == pytest.approx(math.sqrt(0.36 + 3.0**2 + 0.8), abs=0.1)
    assert far.along_sigma_m(track, 2.0) == 2.0  # the hypotheses know it better
    assert far.reckoned_sigma_m(0.5 * math.pi) < 0.7  # what was driven across is read from the lanes
    assert Witnesses().along_sigma_m(track, 2.4) == 2.4


def test_hypotheses_that_know_the_place_along_worse_than_dead_reckoning_tell_it_across_only():
    wide, near = np.diag([2.0, 0.04, 1e-3]), np.diag([0.04, 0.04, 1e-3])
    fresh = driven(20, (0.0, 0.0))
    assert fresh.know_better(wide, 0.0) and not fresh.know_better(near, 0.0) and not Witnesses().know_better(wide, 0.0)
    track, found = begun(np.zeros(3), np.diag([0.25, 0.25, 1e-3])), np.array([2.0, 1.0, 0.0])
    told, across = with_found(track, found, wide), with_found(track, found, wide, across_only=True)
    assert told.pose[0] > 0.2 and across.pose[0] < 0.01 and across.pose[1] == pytest.approx(told.pose[1]) and told.pose[1] > 0.8
    assert across.along_sigma_m == pytest.approx(0.5, abs=0.001)
