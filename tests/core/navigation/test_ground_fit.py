"""The place along the way by the ground: on a street, at its mouth, and where a mouth is not to be seen."""

import math

import numpy as np
import pytest

from hippodrome.core.navigation.border import OTHER, ROAD, UNKNOWN
from hippodrome.core.navigation.ground_fit import FLOOR_M, GroundFit, on_this_side, posterior
from hippodrome.core.navigation.paving import paving
from hippodrome.core.navigation.track import begun, moved
from tests.core.navigation.test_paving import corner

EAST = np.array([1.0, 0.0])


class SeenFrom:
    """Ground as it looks from a true pose: what is paved is road, up to so far ahead."""

    def __init__(self, raster, x_m, y_m=0.0, far_m=11.0):
        self.raster, self.place, self.far_m = raster, np.array([x_m, y_m]), far_m

    def kinds_at(self, points_m):
        cells = np.floor((points_m + self.place - self.raster.corner_m) / self.raster.cell_m).astype(int)
        kinds = np.where(self.raster.levels[cells[:, 0], cells[:, 1]] > 1, ROAD, OTHER).astype(np.uint8)
        kinds[points_m[:, 0] > self.far_m] = UNKNOWN
        return kinds


def fitted(true_m, believed_m, sigma_m, weight=0.1):
    raster = paving(corner())
    pose = np.array([believed_m, 0.0, 0.0])
    return GroundFit(raster).fit(pose, EAST, sigma_m, SeenFrom(raster, true_m), weight)


def test_a_street_tells_nothing_of_the_place_along_it():
    fit = fitted(20.0, 21.0, 1.0)
    assert abs(fit.shift_m) < 0.1 and math.sqrt(fit.variance_m2) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("believed_m", [42.0, 44.0, 47.0])
def test_a_mouth_tells_where_the_vehicle_is(believed_m):
    fit = fitted(45.0, believed_m, 2.0, weight=0.3)
    assert fit.shift_m == pytest.approx(45.0 - believed_m, abs=0.25) and FLOOR_M**2 <= fit.variance_m2 < 0.2


def test_a_mouth_that_is_not_to_be_seen_is_farther_on():
    fit = fitted(36.0, 44.0, 3.0)  # the street goes on as far as one sees, to 47 m: its end at 50 m is beyond
    assert -12.0 < fit.shift_m < -3.0 and fit.variance_m2 > 0.5


def test_a_step_is_taken_every_half_a_metre_and_not_askew_in_a_turn():
    raster = paving(corner())
    track = moved(begun(np.array([42.0, 0.0, 0.0]), np.diag([1.0, 0.01, 1e-4])), 0.1, 0.0)
    fit, ground = GroundFit(raster), SeenFrom(raster, 44.0)
    assert fit.step(track, ground, 0.3) is track
    assert fit.step(track, ground, 0.3).pose[0] > 42.2
    turned = begun(np.array([44.0, 0.0, 1.0]), np.diag([1.0, 0.01, 1e-4]))
    assert fit.step(turned, ground, 0.6) is turned


def test_places_by_hand():
    shifts = np.array([-1.0, 0.0, 1.0])
    fit = posterior(shifts, np.array([50.0, 50.0, 0.0]), 1.0)
    assert fit.shift_m == pytest.approx(1.0) and fit.variance_m2 == pytest.approx(FLOOR_M**2)
    both = posterior(shifts, np.array([0.0, 50.0, 0.0]), 1.0)  # two mouths alike leave it as unsure as it was
    assert both.shift_m == pytest.approx(0.0) and both.variance_m2 == pytest.approx(1.0)


def test_no_road_is_believed_beyond_what_is_none():
    row = np.array([[ROAD, OTHER, ROAD, ROAD, ROAD, OTHER, ROAD]], dtype=np.uint8)
    assert on_this_side(row).tolist() == [[UNKNOWN, OTHER, ROAD, ROAD, ROAD, OTHER, UNKNOWN]]
