"""Eq. (8) and sigma_z by hand and against SciPy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from hippodrome.core.matching.hmm.emission import estimate_sigma_z_m, log_emission


def test_eq_8_by_hand():
    """sigma 2: 1 / (2 sqrt(2 pi)) at 0 m; that times exp(-0.5) at one sigma, 2 m."""
    assert np.exp(log_emission(np.array([0.0, 2.0]), 2.0)) == pytest.approx([0.1994711402, 0.1209853623])


@given(distance=st.floats(0.0, 200.0), sigma=st.floats(0.1, 50.0))
def test_eq_8_is_a_normal_density(distance, sigma):
    assert log_emission(np.array([distance]), sigma)[0] == pytest.approx(norm.logpdf(distance, scale=sigma), rel=1e-9, abs=1e-9)


def test_sigma_z_by_hand():
    assert estimate_sigma_z_m(np.array([1.0, 100.0, 2.0])) == pytest.approx(2.9652)


def test_sigma_z_of_normal_distances_is_their_deviation():
    distance = np.abs(3.0 * np.random.default_rng(0).standard_normal(20_000))
    assert estimate_sigma_z_m(distance) == pytest.approx(3.0, rel=0.02)
