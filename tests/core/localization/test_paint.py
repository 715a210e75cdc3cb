"""Dashes that the map has seen as a measurement of how far along the road the vehicle is."""

from dataclasses import replace

import numpy as np
import pytest

from hippodrome.core.localization.paint import APART_M, LEAST_KNOWN_M, PaintSense
from hippodrome.core.reading import RoadReader
from hippodrome.core.reading.dashes import NO_PAINT, SIGMA_M
from hippodrome.core.types import LaneReadings
from tests.core.looped_world import Pictures, topometric_map
from tests.core.reading.painted import camera, road

VIEW = camera()
SURE = np.diag([0.5**2, 0.3**2, 0.03**2])


def paint(along_m, lines=((-1.4, 0), (1.6, 9), (4.6, 0))):
    reader = RoadReader(VIEW)
    return reader.paint(reader.read(road(VIEW, along_m=along_m, lines=lines)))


def street(painted=True, sigma_m=0.0):
    """A map of a street along x with visits each 5 m, all in one lane at y = 0."""
    plain = topometric_map(Pictures(0), np.random.default_rng(0), span_m=60.0)
    count = len(plain.poses)
    poses = np.column_stack([5.0 * np.arange(count), np.zeros(count), np.zeros(count)])
    seen, unseen = np.zeros(count, np.float32), np.full(count, np.inf, np.float32)
    lane = LaneReadings(seen, unseen, seen, unseen, seen, seen, seen, unseen, np.zeros(count, np.uint8))
    lane = replace(lane, paint=np.stack([paint(x) if painted else NO_PAINT for x in poses[:, 0]]))
    covariance = np.tile(np.diag([sigma_m**2, 0.0, 0.0]), (count, 1, 1))
    return replace(plain, poses=poses, covariance=covariance, visits=replace(plain.visits, lane=lane))


def measured(sense, at_m, believed, lines=((-1.4, 0), (1.6, 9), (4.6, 0)), covariance=SURE):
    return sense.measure(lambda: paint(at_m, lines), np.array(believed), covariance)


@pytest.mark.parametrize("at_m", [20.0, 22.4, 27.1])
@pytest.mark.parametrize("wrong_m", [-1.2, 0.8])
def test_dashes_tell_the_place_along_the_road_and_nothing_else(at_m, wrong_m):
    told = measured(PaintSense(street(sigma_m=0.2)), at_m, (at_m + wrong_m, 0.1, 0.02))
    assert told.pose == pytest.approx([at_m, 0.1, 0.02], abs=0.25)
    sigma = np.sqrt(np.diag(told.covariance))
    assert sigma[0] == pytest.approx(np.hypot(SIGMA_M, 0.2), rel=0.2, abs=2.1)  # turned by the heading, across leaks in
    assert sigma[1] > 50.0 and sigma[2] == pytest.approx(1.0)
    np.linalg.cholesky(told.covariance)


def test_from_the_lane_beside_the_line_between_both_tells_it():
    told = measured(PaintSense(street()), 23.0, (22.2, 3.2, 0.0), lines=((-4.6, 0), (-1.6, 9), (1.6, 0)))
    assert told.pose[0] == pytest.approx(23.0, abs=0.25)


@pytest.mark.parametrize(
    ("painted", "believed", "sigma_m"),
    [
        (False, (20.5, 0.0, 0.0), 0.5),  # a map without paint
        (True, (20.5, 0.0, 0.0), LEAST_KNOWN_M + 0.1),  # one dash may be taken for the next
        (True, (20.5, 30.0, 0.0), 0.5),  # the map does not reach there
        (True, (20.5, 0.0, 3.1), 0.5),  # nor this way
        (True, (17.0, 0.0, 0.0), 0.3),  # more sigmas off than can be
    ],
)
def test_nothing_is_told_where_it_might_be_wrong(painted, believed, sigma_m):
    sense = PaintSense(street(painted))
    assert measured(sense, 20.0, believed, covariance=np.diag([sigma_m**2, 0.1, 0.001])) is None


def test_paint_is_asked_for_again_only_after_some_way():
    sense = PaintSense(street())
    assert measured(sense, 20.0, (20.3, 0.0, 0.0)) is not None
    assert sense.measure(pytest.fail, np.array([20.3, 0.0, 0.0]), SURE) is None
    sense.move(APART_M)
    assert measured(sense, 22.5, (22.3, 0.0, 0.0)) is not None


def test_maps_from_before_paint_was_kept_tell_nothing():
    old = street()
    for lane in (None, replace(old.visits.lane, paint=None)):
        assert measured(PaintSense(replace(old, visits=replace(old.visits, lane=lane))), 20.0, (20.3, 0.0, 0.0)) is None
