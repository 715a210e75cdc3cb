"""Robust weights by hand."""

import numpy as np
import pytest

from hippodrome.core.solvers.robust import geman_mcclure_weight, student_weight


def test_geman_mcclure_by_hand():
    """Scale 3 sigma: residuals of 0, 3 and 9 sigma weigh 1, (9 / 18)^2 and (9 / 90)^2."""
    assert geman_mcclure_weight(np.array([0.0, 9.0, 81.0]), 9.0) == pytest.approx([1.0, 0.25, 0.01])


def test_student_by_hand():
    """4 degrees of freedom: residuals of 0, 1 and 4 sigma weigh 5 / 4, 5 / 5 and 5 / 20."""
    assert student_weight(np.array([0.0, 1.0, 16.0]), 0.25) == pytest.approx([1.25, 1.0, 0.25])


def test_infinite_freedom_is_the_normal_distribution():
    assert student_weight(np.array([0.0, 1.0, 400.0]), 0.0).tolist() == [1.0, 1.0, 1.0]


def test_one_degree_of_freedom_is_cauchy():
    assert student_weight(np.array([0.0, 1.0, 9.0]), 1.0) == pytest.approx([2.0, 1.0, 0.2])


@pytest.mark.parametrize(
    ("weight", "loss"),
    [
        (lambda sq: geman_mcclure_weight(sq, 9.0), lambda r: 0.5 * 9.0 * r**2 / (r**2 + 9.0)),
        (lambda sq: student_weight(sq, 0.25), lambda r: 0.5 * 5.0 * np.log1p(r**2 / 4.0)),
    ],
)
def test_weighted_squares_have_the_gradient_of_the_loss(weight, loss):
    r = np.array([0.3, 1.0, 2.5, 7.0])
    slope = (loss(r + 1e-6) - loss(r - 1e-6)) / 2e-6
    assert weight(r**2) * r == pytest.approx(slope, rel=1e-6)
