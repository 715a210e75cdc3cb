"""Eq. (9) and beta by hand and against SciPy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import expon

from hippodrome.core.matching.hmm.transition import distance_difference_m, estimate_beta_m, log_transition


def test_eq_9_by_hand():
    """beta 2: 1/2 at 0 m, exp(-1)/2 at 2 m; no route, no probability."""
    assert np.exp(log_transition(np.array([0.0, 2.0, np.inf]), 2.0)) == pytest.approx([0.5, 0.1839397206, 0.0])


def test_d_t_by_hand():
    assert distance_difference_m(np.array([5.0, 5.0]), np.array([7.5, np.inf])).tolist() == [2.5, np.inf]


@given(difference=st.floats(0.0, 200.0), beta=st.floats(0.1, 50.0))
def test_eq_9_is_an_exponential_density(difference, beta):
    expected = expon.logpdf(difference, scale=beta)
    assert log_transition(np.array([difference]), beta)[0] == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_beta_by_hand():
    assert estimate_beta_m(np.array([0.1, 0.6931471806, 50.0])) == pytest.approx(1.0)


def test_beta_of_exponential_differences_is_their_mean():
    assert estimate_beta_m(np.random.default_rng(0).exponential(4.0, 20_000)) == pytest.approx(4.0, rel=0.03)
