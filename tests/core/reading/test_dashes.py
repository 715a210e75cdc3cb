"""Dashes along a lane's borders as two frames see them, and how far apart the frames are by them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hippodrome.core.reading import RoadReader
from hippodrome.core.reading.dashes import LEFT, RIGHT, ahead_by_paint, shared_borders
from hippodrome.core.reading.types import RoadReading
from tests.core.reading.painted import camera, road

VIEW = camera()


def paint(**painted):
    """The paint along both borders of a painted road."""
    reader = RoadReader(VIEW)
    return reader.paint(reader.read(road(VIEW, **painted)))


@pytest.mark.parametrize("apart_m", [-2.0, -1.1, 0.0, 0.7, 2.6, 4.0])
@pytest.mark.parametrize("offset_m", [0.0, 0.3])
def test_dashes_tell_how_far_apart_two_frames_are(apart_m, offset_m):
    behind, ahead = paint(along_m=4.0), paint(along_m=4.0 + apart_m, offset_m=offset_m, heading_rad=0.02)
    assert ahead_by_paint(behind[LEFT], ahead[LEFT], apart_m + 0.9, 2.5) == pytest.approx(apart_m, abs=0.2)


def test_a_border_without_dashes_tells_nothing():
    solid, none = paint(lines=((-1.4, 0), (1.6, 0))), paint()[RIGHT]
    assert math.isnan(ahead_by_paint(solid[LEFT], solid[LEFT], 0.0, 2.0))
    assert math.isnan(ahead_by_paint(none, none, 0.0, 2.0))


def test_what_lies_too_far_from_where_it_is_expected_is_not_told():
    """Dashes repeat, so that nothing at the rim of the search is believed."""
    behind, ahead = paint(along_m=4.0)[LEFT], paint(along_m=8.0)[LEFT]
    assert math.isnan(ahead_by_paint(behind, ahead, 0.0, 2.0))


def test_without_a_lane_there_is_no_paint():
    reader = RoadReader(VIEW)
    assert not reader.paint(RoadReading()).any()
    assert not reader.paint(reader.read(np.zeros((120, 160, 3), np.uint8))).any()
    assert not reader.paint(replace(reader.read(road(VIEW)), curvature_1pm=0.08)).any()


def test_beside_a_lane_its_border_is_seen_from_the_other_side():
    """One vehicle in the right lane of two, the other in the left one: they share the dashes between them."""
    right = paint(lines=((-1.4, 0), (1.6, 9), (4.8, 0)))
    left = paint(lines=((-4.6, 0), (-1.6, 9), (1.6, 0)), along_m=1.5)
    ((of_right, of_left),) = shared_borders(3.2)
    assert (of_right, of_left) == (LEFT, RIGHT)
    assert ahead_by_paint(right[of_right], left[of_left], 1.0, 2.0) == pytest.approx(1.5, abs=0.2)
    assert shared_borders(-3.2) == ((RIGHT, LEFT),)
    assert shared_borders(0.2) == ((LEFT, LEFT), (RIGHT, RIGHT))
    assert shared_borders(1.6) == shared_borders(6.4) == ()
