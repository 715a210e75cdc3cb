"""The stop line in rows of brightness."""

import math

import numpy as np

from hippodrome.core.reading.ends import stop_line

ALONG_M = 3.0 + 112.0 / np.arange(40.0, 8.0, -1.0)  # (R,) of rows, the nearest first, for a camera 3 m ahead of the axle
ROAD, PAINT = 90.0, 110.0


def rows(first, last):
    levels = np.full(len(ALONG_M), ROAD)
    levels[first : last + 1] += PAINT
    return levels


def test_a_bar_across_the_lane_is_told():
    near_m, variance_m2 = stop_line(rows(12, 13), ALONG_M, 3.0, PAINT, 0.4)
    assert ALONG_M[11] < near_m < ALONG_M[14] and variance_m2 < 0.1


def test_a_bar_whose_end_is_not_seen_is_none():
    for length in (1, 2, 3):
        last = len(ALONG_M) - 1
        near_m, variance_m2 = stop_line(rows(last - length + 1, last), ALONG_M, 3.0, PAINT, 0.4)
        assert math.isnan(near_m) and variance_m2 == math.inf
