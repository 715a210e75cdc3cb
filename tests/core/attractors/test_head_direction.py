"""The ring: integration, conflict and hand-back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from hippodrome.core.attractors import head_direction
from hippodrome.core.attractors.config import AttractorConfig, paper_config
from hippodrome.core.se2 import wrap_compiled

CONFIG = AttractorConfig()
heading = st.floats(-3.1, 3.1)


@settings(deadline=None)  # numba compiles on first use
@given(heading, st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=30))
def test_integration_adds_the_turns(start, rates):
    state = head_direction.known(start, CONFIG)
    for rate in rates:
        state = head_direction.integrate(state, rate, 0.1)
    assert_allclose(wrap_compiled(state.mean_rad - start - 0.1 * sum(rates)), 0.0, atol=1e-9)


def test_start_holds_e_and_its_tenth():
    assert_allclose(head_direction.known(0.5, CONFIG).reliability, [100.0, 10.0])
    assert head_direction.read_out(head_direction.uniform(CONFIG))[1] < 1e-3


def test_motion_noise_widens_the_read_out():
    state = head_direction.integrate(head_direction.known(0.0, CONFIG), 0.0, 0.1, sq_sigma_rad=(0.02, 0.02))
    assert_allclose(1.0 / head_direction.read_out(state)[1], 1.0 / 110.0 + 0.02)


def test_bounded_injection_is_the_gaussian_product_and_reaches_both_populations():
    state = head_direction.inject(head_direction.known(0.2, CONFIG), 0.5, 55.0, CONFIG)
    assert_allclose(head_direction.read_out(state), (0.2 + 0.3 * 55.0 / 165.0, 165.0))
    assert_allclose(state.mean_rad, 0.3)


def test_paper_injection_leaves_the_integrator_alone():
    config = paper_config()
    state = head_direction.inject(head_direction.known(0.2, config), 0.5, 10.0, config)
    assert state.mean_rad[0] == pytest.approx(0.2)
    assert_allclose((state.mean_rad[1], state.reliability[1]), (0.35, 20.0))


def test_printed_inhibition_at_a_public_strength_forgets_an_injection_within_seconds():
    config = paper_config()
    state = head_direction.inhibit(head_direction.known(0.0, config), 0.1, config)
    state = head_direction.inject(state, 0.5, 10.0, config)
    moved = head_direction.read_out(state)[0]
    for _ in range(50):
        state = head_direction.inhibit(head_direction.integrate(state, 0.0, 0.1), 0.1, config)
    assert moved > 0.03
    assert head_direction.read_out(state)[0] < 1e-3


def test_a_first_injection_replaces_a_flat_belief():
    state = head_direction.inject(head_direction.uniform(CONFIG), 2.0, 50.0, CONFIG)
    assert_allclose(head_direction.read_out(state)[0], 2.0, atol=1e-4)


def test_conflict_keeps_two_beliefs_until_one_is_adopted():
    state = head_direction.challenge(head_direction.known(0.0, CONFIG), 2.0, 40.0)
    state = head_direction.stimulate(state, 2.2, 40.0)
    assert_allclose(state.mean_rad, [0.0, 2.1])
    won, lost = head_direction.adopt(state, 1, CONFIG), head_direction.adopt(state, 0, CONFIG)
    assert_allclose(head_direction.read_out(won), (2.1, 80.0))
    assert head_direction.read_out(lost)[0] == 0.0


def test_steps_do_not_touch_their_argument():
    state = head_direction.known(0.3, CONFIG)
    before = (state.mean_rad.copy(), state.reliability.copy())
    turned = head_direction.integrate(state, 1.0, 0.1, (0.1, 0.1))
    head_direction.inhibit(head_direction.inject(turned, 1.0, 10.0, CONFIG), 0.1, CONFIG)
    assert np.array_equal(state.mean_rad, before[0])
    assert np.array_equal(state.reliability, before[1])
