import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from hippodrome.sim.scene.conditions import apply_camera
from hippodrome.sim.scene.conditions_spec import Conditions


def _rng():
    return np.random.default_rng(5)


def _frame():
    return np.arange(12 * 40 * 3, dtype=np.uint32).reshape(12, 40, 3).astype(np.uint8)


def test_a_perfect_camera_changes_nothing():
    frame = _frame()
    assert np.array_equal(apply_camera(frame, Conditions(), _rng()), frame)


def test_gain_and_gamma_by_hand():
    frame = np.full((2, 20, 3), 100, np.uint8)
    out = apply_camera(frame, Conditions(gain=0.75, gamma=2.0), _rng())
    assert np.all(out == round(255 * (0.75 * 100 / 255) ** 2))
    assert np.all(apply_camera(frame, Conditions(gain=4.0), _rng()) == 255)


def test_noise_has_the_asked_spread_and_no_bias():
    out = apply_camera(np.full((60, 80, 3), 128, np.uint8), Conditions(noise_sigma=5.0), _rng()).astype(float)
    assert out.std() == pytest.approx(5.0, rel=0.05)
    assert out.mean() == pytest.approx(128.0, abs=0.3)


def test_motion_blur_smears_sideways_only():
    frame = np.zeros((5, 100, 3), np.uint8)
    frame[2, 50] = 250
    out = apply_camera(frame, Conditions(motion_blur=0.05), _rng())
    assert np.all(out[2, 48:53] == 50) and out[2].sum() == 5 * 50 * 3
    assert out[[0, 1, 3, 4]].sum() == 0


@given(gain=st.floats(0.1, 4.0), gamma=st.floats(0.3, 3.0), sigma=st.floats(0.0, 20.0), blur=st.floats(0.0, 0.2))
def test_camera_is_pure_and_repeatable(gain, gamma, sigma, blur):
    conditions = Conditions(gain=gain, gamma=gamma, noise_sigma=sigma, motion_blur=blur)
    frame = _frame()
    before = frame.copy()
    one, two = apply_camera(frame, conditions, _rng()), apply_camera(frame, conditions, _rng())
    assert np.array_equal(one, two) and np.array_equal(frame, before)
    assert one.shape == frame.shape and one.dtype == np.uint8


@pytest.mark.parametrize(
    "bad", [{"overcast": 1.5}, {"fog_visibility_m": 0.0}, {"season": "monsoon"}, {"gain": 0.0}, {"sunny": True}]
)
def test_bad_conditions_are_rejected(bad):
    with pytest.raises(ValidationError):
        Conditions(**bad)
