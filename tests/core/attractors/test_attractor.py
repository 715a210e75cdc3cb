"""The attractor's equations: hand-computed values, normalisation, limits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from pydantic import TypeAdapter, ValidationError
from scipy.stats import multivariate_normal, norm

from hippodrome.core.attractors import attractor
from hippodrome.core.attractors.config import AttractorConfig, paper_config
from hippodrome.core.se2 import wrap_compiled

angle = st.floats(-10.0, 10.0)
reliability = st.floats(1e-3, 1e3)


def shaped(*pairs):
    """(1 module, 2 populations, 1 axis) from (integrator, calibration)."""
    return np.array(pairs, dtype=float).reshape(1, 2, 1)


def test_belief_is_a_normal_density_on_the_circle():
    theta = np.linspace(-np.pi, np.pi, 721)
    assert_allclose(attractor.belief(theta, 0.5, 16.0)[360:], norm.pdf(theta[360:], 0.5, 0.25), rtol=1e-9)
    across_the_seam = attractor.belief(-np.pi + 0.1, np.pi - 0.1, 16.0)
    assert_allclose(across_the_seam, norm.pdf(0.2, 0.0, 0.25))


@settings(deadline=None)  # numba compiles on first use
@given(angle, st.floats(10.0, 1e3))
def test_belief_sums_to_one_over_the_ring(mu, r):
    theta = np.linspace(0.0, 2 * np.pi, 4000, endpoint=False)
    assert_allclose(attractor.belief(theta, mu, r).sum() * 2 * np.pi / 4000, 1.0, rtol=1e-6)


def test_belief_2d_falls_off_along_both_axes():
    reference = multivariate_normal(mean=[0.3, -0.2], cov=np.diag([1 / 25.0, 1 / 4.0]))
    for x, y in [(0.3, -0.2), (0.5, 0.1), (0.1, 0.9)]:
        assert_allclose(attractor.belief_2d(x, y, 0.3, -0.2, 25.0, 4.0), reference.pdf([x, y]))


def test_global_inhibition_by_hand():
    assert attractor.total_information(60.0, 20.0) == 80.0
    assert_allclose(attractor.global_inhibition(60.0, 20.0, 100.0), (75.0, 25.0))
    assert_allclose(attractor.limited_inhibition(60.0, 20.0, 100.0), (60.0, 20.0))
    assert_allclose(attractor.limited_inhibition(150.0, 50.0, 100.0), (75.0, 25.0))


def test_mutual_inhibition_by_hand():
    assert_allclose(attractor.mutual_inhibition(60.0, 20.0, 0.1, 0.2, 1e-3), (58.0, 8.0))
    assert_allclose(attractor.mutual_inhibition(60.0, 5.0, 0.1, 0.2, 1e-3), (59.5, 1e-3))


def test_injection_and_read_out_by_hand():
    assert_allclose(attractor.inject(1.0, 10.0, 2.0, 30.0), (1.75, 40.0))
    assert_allclose(attractor.read_out(1.0, 30.0, 2.0, 10.0), (1.25, 40.0))


def test_means_combine_across_the_seam():
    mean, _ = attractor.inject(np.pi - 0.1, 10.0, -np.pi + 0.1, 10.0)
    assert_allclose(abs(mean), np.pi, atol=1e-12)


@settings(deadline=None)  # numba compiles on first use
@given(angle, angle, reliability, reliability)
def test_read_out_lies_between_the_populations_and_does_not_depend_on_their_names(a, b, ra, rb):
    mean, total = attractor.read_out(a, ra, b, rb)
    assert_allclose(total, ra + rb)
    apart = abs(wrap_compiled(b - a))
    assert abs(wrap_compiled(mean - a)) <= apart + 1e-9
    if apart < 3.1:  # at opposite headings the shorter arc is a matter of rounding
        swapped, _ = attractor.read_out(b, rb, a, ra)
        assert_allclose(wrap_compiled(mean - swapped), 0.0, atol=1e-9)


@settings(deadline=None)  # numba compiles on first use
@given(angle, reliability, angle, reliability, angle)
def test_injection_commutes_with_rotation(mu, r, mu_inject, r_inject, rotation):
    if abs(wrap_compiled(mu_inject - mu)) > 3.1:
        return
    mean, _ = attractor.inject(mu, r, mu_inject, r_inject)
    turned, _ = attractor.inject(mu + rotation, r, mu_inject + rotation, r_inject)
    assert_allclose(wrap_compiled(turned - mean - rotation), 0.0, atol=1e-8)


@settings(deadline=None)  # numba compiles on first use
@given(reliability, reliability, st.floats(1e-6, 10.0))
def test_forgetting_adds_variance_to_a_shared_belief(r_inte, r_cali, sq_sigma):
    inte, cali = attractor.forget(0.4, r_inte, 0.4, r_cali, sq_sigma, sq_sigma)
    assert_allclose(1.0 / (inte + cali), 1.0 / (r_inte + r_cali) + sq_sigma, rtol=1e-9)


def test_forgetting_in_conflict_fades_each_belief_alone():
    inte, cali = attractor.forget(0.0, 100.0, 2.0, 25.0, 0.01, 0.01)
    assert_allclose((1 / inte, 1 / cali), (0.02, 0.05))


@settings(deadline=None)  # numba compiles on first use
@given(st.floats(0.0, 6.0), reliability, reliability, st.integers(1, 50))
def test_paper_mode_holds_the_total_at_e(conflict, r_inte, r_cali, ticks):
    config = paper_config(100.0)
    r = shaped(r_inte, r_cali)
    for _ in range(ticks):
        r = attractor.inhibit(shaped(0.0, conflict), r, 0.1, config, np.array([100.0]))
    assert_allclose(r.sum(), 100.0)
    assert (r > 0.0).all()


def test_paper_mode_destroys_the_uniform_start_and_bounded_keeps_it():
    flat = shaped(1e-4, 1e-4)
    assert attractor.inhibit(shaped(0, 0), flat, 0.1, paper_config(), np.array([100.0])).sum() == pytest.approx(100.0)
    assert_allclose(attractor.inhibit(shaped(0, 0), flat, 0.1, AttractorConfig(), np.array([100.0])), flat)


def test_bounded_inhibition_spares_agreement_and_settles_conflict():
    config, total = AttractorConfig(inhibition_calibration=0.1, inhibition_integrator=0.1), np.array([100.0])
    agreeing = attractor.inhibit(shaped(0.3, 0.3), shaped(60.0, 20.0), 0.1, config, total)
    assert_allclose(agreeing, shaped(60.0, 20.0))
    fighting = shaped(60.0, 20.0)
    for _ in range(100):
        fighting = attractor.inhibit(shaped(0.0, 1.5), fighting, 0.1, config, total)
    assert fighting[0, 1, 0] < 1e-3 < 50.0 < fighting[0, 0, 0]


def test_bounded_inhibition_does_not_depend_on_the_tick_rate():
    config, total, mean = AttractorConfig(), np.array([100.0]), shaped(0.0, 1.5)
    slow, fast = shaped(60.0, 20.0), shaped(60.0, 20.0)
    for _ in range(20):
        slow = attractor.inhibit(mean, slow, 0.1, config, total)
    for _ in range(200):
        fast = attractor.inhibit(mean, fast, 0.01, config, total)
    assert_allclose(slow, fast, rtol=5e-3)


def test_unknown_keys_are_rejected():
    with pytest.raises(ValidationError):
        TypeAdapter(AttractorConfig).validate_python({"inhibition": 0.2})
