"""The tori: unwrapping, several modules, injections in the caller's unit of length."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from hippodrome.core.attractors import grid_cells
from hippodrome.core.attractors.config import GRID_INFORMATION, AttractorConfig, paper_config

CONFIG = AttractorConfig(information=GRID_INFORMATION)
PERIODS = grid_cells.module_periods(97.0)
coordinate = st.floats(-3e3, 3e3)
position = st.tuples(coordinate, coordinate).map(np.array)


def test_periods_keep_their_ratios_in_any_unit():
    assert_allclose(PERIODS, [97.0, 131.0, 173.0])
    assert_allclose(grid_cells.module_periods(9.7), PERIODS / 10.0)


@settings(deadline=None)  # numba compiles on first use
@given(position)
def test_a_known_position_is_read_out_near_itself(true):
    read, reliability = grid_cells.read_out(grid_cells.known(true, PERIODS, CONFIG), true + np.array([30.0, -30.0]))
    assert_allclose(read, true, atol=1e-6)
    assert_allclose(reliability, 1.1, rtol=1e-3)  # E is one per square metre and axis, the calibration cells add their tenth


@settings(deadline=None)  # numba compiles on first use
@given(position, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_modules_together_find_the_sheet_a_kilometre_away(true, east, north):
    prior = true + 1000.0 * np.array([east, north])
    state = grid_cells.known(true, PERIODS, CONFIG)
    assert_allclose(grid_cells.read_out(state, prior, reach=1200.0)[0], true, atol=1e-6)


def test_a_single_torus_locks_to_the_wrong_sheet():
    true, period = np.array([10.0, 20.0]), np.array([150.0])
    read, _ = grid_cells.read_out(grid_cells.known(true, period, CONFIG), true + np.array([90.0, 0.0]), reach=1200.0)
    assert_allclose(read, true + np.array([150.0, 0.0]), atol=1e-6)


@settings(deadline=None)  # numba compiles on first use
@given(position, st.lists(st.tuples(st.floats(-3.1, 3.1), st.floats(0.0, 20.0)), min_size=1, max_size=40))
def test_integration_unwraps_every_step(start, motions):
    state, near, expected = grid_cells.known(start, PERIODS, CONFIG), start, start.copy()
    for heading, speed in motions:
        step = grid_cells.displacement(np.full(2, heading), speed, 0.5)
        state = grid_cells.integrate(state, step, np.zeros((2, 2)))
        near, _ = grid_cells.read_out(state, near)
        expected += 0.5 * speed * np.array([np.cos(heading), np.sin(heading)])
    assert_allclose(near, expected, atol=1e-6)


def test_motion_noise_widens_the_read_out_per_axis():
    state = grid_cells.integrate(grid_cells.known(np.zeros(2), PERIODS, CONFIG), np.zeros((2, 2)), np.tile([4.0, 0.0], (2, 1)))
    _, reliability = grid_cells.read_out(state, np.zeros(2))
    assert_allclose(1.0 / reliability, [1.0 / 1.1 + 4.0, 1.0 / 1.1], rtol=1e-3)


def test_bounded_injection_is_the_gaussian_product_per_axis():
    state = grid_cells.inject(grid_cells.known(np.zeros(2), PERIODS, CONFIG), np.array([3.0, -2.0]), np.array([1.1, 3.3]), CONFIG)
    read, reliability = grid_cells.read_out(state, np.zeros(2))
    assert_allclose(read, [1.5, -1.5], rtol=1e-3)
    assert_allclose(reliability, [2.2, 4.4], rtol=1e-3)


def test_paper_injection_pulls_the_read_out_by_its_share():
    config = paper_config(GRID_INFORMATION)
    state = grid_cells.inject(grid_cells.known(np.zeros(2), PERIODS, config), np.array([10.0, 0.0]), np.full(2, 0.1), config)
    mean = state.mean_rad[0, :, 0] * 97.0 / (2 * np.pi)
    assert_allclose(mean, [0.0, 5.0], atol=1e-2)  # calibration 0.1 against 0.1 injected
    assert_allclose(grid_cells.read_out(state, np.zeros(2))[0][0], 5.0 * 0.2 / 1.2, rtol=1e-2)


def test_populations_integrate_along_their_own_heading():
    state = grid_cells.challenge(grid_cells.known(np.zeros(2), PERIODS, CONFIG), np.array([500.0, 0.0]), np.ones(2))
    state = grid_cells.integrate(state, grid_cells.displacement(np.array([0.0, np.pi / 2]), 10.0, 1.0), np.zeros((2, 2)))
    incumbent, _ = grid_cells.population_belief(state, 0, np.zeros(2))
    challenger, _ = grid_cells.population_belief(state, 1, np.array([500.0, 0.0]))
    assert_allclose(incumbent, [10.0, 0.0], atol=1e-6)
    assert_allclose(challenger, [500.0, 10.0], atol=1e-6)
    won, _ = grid_cells.read_out(grid_cells.adopt(state, 1, CONFIG), np.array([500.0, 0.0]))
    assert_allclose(won, [500.0, 10.0], atol=1e-6)


def test_bounded_read_out_keeps_a_true_variance_and_paper_does_not():
    weak = np.full(2, 0.01)
    for config, expected in ((CONFIG, 0.01), (paper_config(GRID_INFORMATION), 1.0)):
        state = grid_cells.stimulate(grid_cells.uniform(PERIODS, config), np.array([5.0, 5.0]), weak)
        _, reliability = grid_cells.read_out(grid_cells.inhibit(state, 0.1, config), np.zeros(2))
        assert_allclose(reliability, expected, rtol=2e-2)
