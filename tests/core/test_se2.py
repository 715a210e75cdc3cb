"""SE(2) obeys the group axioms, and dead reckoning composes motions one by one."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from hippodrome.core import se2

coordinate = st.floats(-1e3, 1e3)
pose = st.tuples(coordinate, coordinate, st.floats(-3.1, 3.1)).map(np.array)


def assert_same_pose(a, b):
    assert_allclose(a[..., :2], b[..., :2], atol=1e-8)
    assert_allclose(se2.wrap(a[..., 2] - b[..., 2]), 0.0, atol=1e-10)


@given(pose, pose, pose)
def test_composition_is_associative(a, b, c):
    assert_same_pose(se2.compose(se2.compose(a, b), c), se2.compose(a, se2.compose(b, c)))


@given(pose, pose)
def test_between_undoes_compose(a, b):
    assert_same_pose(se2.between(a, se2.compose(a, b)), b)
    assert_same_pose(se2.compose(a, se2.inverse(a)), np.zeros(3))


def test_wrap_keeps_pi_and_moves_minus_pi():
    assert_allclose(se2.wrap(np.array([np.pi, -np.pi, 3 * np.pi, 0.5])), [np.pi, np.pi, np.pi, 0.5])


@given(pose, st.lists(pose, min_size=1, max_size=8).map(np.array))
def test_integration_composes_one_motion_after_another(start, motions):
    expected = start
    for motion, reached in zip(motions, se2.integrate(start, motions), strict=True):
        expected = se2.compose(expected, motion)
        assert_same_pose(reached, expected)


@given(st.floats(-20.0, 20.0))
@settings(deadline=None)  # the first call compiles
def test_the_three_ways_to_wrap_agree(angle_rad):
    wrapped = float(se2.wrap(np.array(angle_rad)))
    assert se2.wrap_compiled(angle_rad) == pytest.approx(wrapped, abs=1e-12)
    assert abs(math.remainder(se2.wrap_near_zero(angle_rad) - wrapped, 2.0 * math.pi)) < 1e-12
