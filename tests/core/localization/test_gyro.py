"""The noise of a gyro, from its own signal."""

import numpy as np
import pytest

from hippodrome.core.localization.gyro import GyroNoise, update

LEAST = 1e-3


def estimates(yaw_rate):
    state, sigmas = GyroNoise(), []
    for sample in yaw_rate:
        state = update(state, sample, LEAST)
        sigmas.append(state.sigma_radps)
    return np.array(sigmas)


def turns(samples):
    """A vehicle at 10 Hz that turns off every 20 s: 0.5 rad/s within a second."""
    t = 0.1 * np.arange(samples)
    return 0.5 * np.exp(-(((t % 20.0) - 10.0) ** 2) / 2.0)


def test_the_noise_is_found_whatever_the_turns():
    rng = np.random.default_rng(0)
    sigmas = estimates(turns(3000) + 0.05 * rng.standard_normal(3000))
    assert np.argmax(sigmas > 0.04) < 150  # fifteen seconds
    assert sigmas[500:].mean() == pytest.approx(0.05, rel=0.1)
    assert 0.02 < sigmas[500:].min() <= sigmas[500:].max() < 0.1


def test_smooth_turns_are_no_noise():
    assert np.median(estimates(turns(3000))) == LEAST
    assert estimates(turns(3000)).max() < 0.02


def test_a_gyro_that_becomes_better_is_trusted_again():
    rng = np.random.default_rng(1)
    sigmas = estimates(np.concatenate([0.05 * rng.standard_normal(300), 0.005 * rng.standard_normal(300)]))
    assert sigmas[-1] < 0.01
