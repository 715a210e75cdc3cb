"""Keyframes come by travel and turn, in any unit of length, and never from a vehicle that stands."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hippodrome.core.types import Observation
from hippodrome.core.views import keyframes
from hippodrome.core.views.config import KeyframeConfig

CONFIG = KeyframeConfig()


def keyframes_of(speeds, yaw_rates=None, dt_s=0.1):
    """Indices of the observations at which a view is due, and the raw motions between them."""
    state, due, motions = keyframes.start(), [], []
    yaw_rates = np.zeros(len(speeds)) if yaw_rates is None else yaw_rates
    for i, (speed, yaw_rate) in enumerate(zip(speeds, yaw_rates, strict=True)):
        state = keyframes.advance(state, Observation(dt_s * (i + 1), dt_s, float(speed), float(yaw_rate), None), CONFIG)
        if keyframes.is_due(state, CONFIG):
            due.append(i)
            motions.append(state.motion)
            state = keyframes.restart(state)
    return due, np.array(motions).reshape(-1, 3)


def test_at_constant_speed_a_view_comes_every_interval():
    due, motions = keyframes_of(np.full(600, 4.2))
    assert_allclose(np.diff(due), 6)
    assert_allclose(motions[1:], [[4.2 * 0.6, 0.0, 0.0]] * (len(due) - 1), atol=1e-9)


def test_the_unit_of_length_changes_nothing():
    rng = np.random.default_rng(1)
    speeds = np.abs(5.0 + 3.0 * np.sin(np.arange(2000) / 70) + rng.normal(size=2000))
    due, motions = keyframes_of(speeds)
    tripled, large = keyframes_of(3.0 * speeds)
    assert due == tripled
    assert_allclose(large, motions * [3.0, 3.0, 1.0], rtol=1e-9)


def test_a_standing_vehicle_has_no_views_even_with_a_noisy_gyro_and_speedometer():
    rng = np.random.default_rng(2)
    speeds = np.concatenate([np.full(300, 5.0), 0.05 * np.abs(rng.normal(size=2000)), np.full(300, 5.0)])
    yaw_rates = np.concatenate([np.zeros(300), 0.02 + 0.05 * rng.normal(size=2000), np.zeros(300)])
    due, _ = keyframes_of(speeds, yaw_rates)
    assert not [i for i in due if 310 <= i < 2295]
    assert len(due) > 80


def test_before_the_first_motion_nothing_is_due():
    assert keyframes_of(np.zeros(50))[0] == []


def test_a_turn_brings_views_before_travel_does():
    speeds, yaw_rates = np.full(200, 5.0), np.zeros(200)
    yaw_rates[100:120] = 0.8
    due, _ = keyframes_of(speeds, yaw_rates)
    gaps = np.diff([i for i in due if 100 <= i <= 120])
    assert gaps.max() <= 3  # 10 deg at 0.8 rad/s take 0.22 s


def test_raw_motion_is_kept_while_standing():
    speeds = np.concatenate([np.full(100, 5.0), np.full(100, 0.01), np.full(20, 5.0)])
    due, motions = keyframes_of(speeds)
    assert_allclose(motions[:, 0].sum(), speeds[: due[-1] + 1].sum() * 0.1, rtol=1e-9)


def test_the_arc_s_chord_agrees_with_a_fine_integration():
    steps = 10_000
    heading = np.cumsum(np.full(steps, 1.3 / steps)) - 0.65 / steps
    expected = [np.sum(np.cos(heading)) * 2.0 / steps, np.sum(np.sin(heading)) * 2.0 / steps, 1.3]
    assert_allclose(keyframes.arc_motion(2.0, 1.3), expected, atol=1e-6)


def test_impossible_settings_are_rejected():
    with pytest.raises(ValueError, match="view step"):
        KeyframeConfig(interval_s=0.0)
