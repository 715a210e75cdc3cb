import numpy as np
import pytest

from hippodrome.core.refinement.noise import (
    FLOORS,
    Noise,
    rescaled,
    variance_factors,
)


def test_freedom_used_up_by_the_solution_is_counted():
    residual = np.array([[1.0, 2.0], [1.0, 2.0], [1.0, 2.0], [1.0, 2.0]]) * 0.5
    ratio = variance_factors(residual, 4, np.array([2.0, 0.0]))
    assert ratio.tolist() == [0.5, 1.0]  # 4 x 0.25 / (4 - 2); 4 x 1 / 4


def test_a_straight_line_fit_gives_back_the_sigma_that_made_it():
    rng = np.random.default_rng(0)
    design = np.column_stack([np.ones(500), np.linspace(0.0, 1.0, 500)])
    data = design @ [1.0, 2.0] + 0.3 * rng.standard_normal(500)
    guess = 1.0
    for _ in range(20):
        whitened = design / guess
        covariance = np.linalg.inv(whitened.T @ whitened)
        residual = (data / guess - whitened @ covariance @ whitened.T @ data / guess)[:, None]
        used = np.array([np.einsum("ni,ij,nj->", whitened, covariance, whitened)])
        guess *= float(np.sqrt(variance_factors(residual, 500, used)[0]))
    assert guess == pytest.approx(0.3, rel=0.07)


def test_one_round_changes_a_sigma_by_a_factor_of_two_at_most():
    ratio = variance_factors(100.0 * np.ones((50, 1)), 50, np.zeros(1))
    assert ratio.tolist() == [4.0]
    noise = rescaled(Noise(), np.full(4, 4.0), np.full(2, 4.0), None)
    assert noise.along == pytest.approx(2.0 * Noise().along)
    assert noise.lateral_m == pytest.approx(2.0 * Noise().lateral_m)


def test_sigmas_keep_their_floors_and_closures_their_bounds():
    noise = Noise()
    for _ in range(30):
        noise = rescaled(noise, np.full(4, 0.25), np.full(2, 0.25), 1e-9)
    assert {name: getattr(noise, name) for name in FLOORS} == FLOORS
    assert noise.closure_factor == pytest.approx(0.2)


def test_bends_are_looser_than_straights():
    lateral, heading = Noise(lateral_m=0.1, lane_heading_rad=0.05).road_sigmas(
        np.array([0.0, 0.1, 0.0]), np.array([0.0, 0.0, 2.0])
    )
    np.testing.assert_allclose(lateral, [0.1, np.hypot(0.1, 0.2), np.hypot(0.1, 2.0)])
    np.testing.assert_allclose(heading, [0.05, np.hypot(0.05, 0.1), 0.05])
