"""Lanes side by side are told apart by what lies beyond their borders."""

import numpy as np
import pytest

from hippodrome.core.reading.borders import CONTRADICTS, FITS, fit_of_borders

LANES_M = np.array([0.0, 3.2, 6.4, 9.6])  # left of the vehicle, which is in the rightmost of two lanes of its way


@pytest.mark.parametrize(
    ("left_edge", "right_edge", "fits", "contradicts"),
    [
        (0.04, 0.99, [0], [1]),  # the road ends on the right: the rightmost lane
        (0.04, 0.05, [1], [0]),  # it goes on at both sides
        (np.nan, 0.99, [0], [1]),
        (0.04, np.nan, [0, 1], []),  # both have a lane on their left
        (np.nan, np.nan, [0, 1], []),
    ],
)
def test_a_lane_fits_what_lies_beyond_its_borders(left_edge, right_edge, fits, contradicts):
    likelihood = [fit_of_borders(left_edge, right_edge, LANES_M[lane], LANES_M, 3.2) for lane in (0, 1)]
    assert [lane for lane in (0, 1) if likelihood[lane] > FITS] == fits
    assert [lane for lane in (0, 1) if likelihood[lane] < CONTRADICTS] == contradicts


def test_no_border_is_believed_without_doubt():
    assert np.isfinite(fit_of_borders(1.0, 0.0, 0.0, LANES_M, 3.2))
