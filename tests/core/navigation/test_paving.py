"""The raster of what is paved: lanes, and what lies between their ends at a junction."""

import numpy as np

from hippodrome.core.navigation.paving import LEVEL_M, paving
from tests.core.navigation.roads import arc, network_of


def level_m(raster, x, y):
    cell = np.floor((np.array([x, y]) - raster.corner_m) / raster.cell_m).astype(int)
    return LEVEL_M * float(raster.levels[tuple(cell)])


def corner():
    """A street to the east, a corner of 8 m, and a street to the north."""
    lines = [[(0.0, 0.0), (50.0, 0.0)], [(58.0, 8.0), (58.0, 58.0)], arc((50.0, 8.0), 8.0, -90, 0)]
    return network_of(lines, [(0, 2), (2, 1)], internal=(2,))


def test_a_lane_is_paved_as_broad_as_it_is():
    raster = paving(corner())
    assert abs(level_m(raster, 25.0, 0.0) - 1.6) < 0.25
    assert abs(level_m(raster, 25.0, 2.6) + 1.0) < 0.25
    assert level_m(raster, 25.0, 30.0) < -9.0


def test_the_inner_corner_of_a_junction_is_paved_and_the_outer_one_is_rounded():
    raster = paving(corner())
    assert level_m(raster, 55.5, 2.5) > 0.5  # on the way through
    assert level_m(raster, 59.0, -1.0) < 0.0  # beyond its outer border, where both roads' borders would meet
    assert level_m(raster, 48.0, 6.0) < -2.0
