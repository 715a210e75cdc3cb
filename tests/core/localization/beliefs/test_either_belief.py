"""Both beliefs by hand: the coupled networks, and the Kalman filter that is their yardstick."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hippodrome.core.localization.beliefs.attractor import AttractorBelief
from hippodrome.core.localization.beliefs.kalman import KalmanBelief
from hippodrome.core.localization.beliefs.motion import Motion, PoseMeasurement
from hippodrome.core.localization.localizer import LocalizerConfig


def measured(x, y, heading):
    return PoseMeasurement(np.array([x, y, heading]), np.diag([1.0, 0.25, 0.01]))


@pytest.mark.parametrize("belief_type", [AttractorBelief, KalmanBelief])
def test_measurements_along_a_straight_teach_the_scale(belief_type):
    belief = belief_type.uniform(np.zeros(2), np.log(2.0), LocalizerConfig()).challenge(measured(0.0, 0.0, 0.0)).adopt()
    for k in range(1, 40):
        for _ in range(6):
            belief = belief.predict(Motion(0.4, 0.0, 0.1))  # 1 m each at the true 2.5 m per unit
        belief = belief.inject(measured(6.0 * k, 0.0, 0.0))
    assert_allclose(belief.pose, [234.0, 0.0, 0.0], atol=0.15)
    assert np.exp(belief.log_scale) == pytest.approx(2.5, rel=0.01)


def test_networks_and_filter_give_the_same_gaussian():
    """Off the networks' limit E, injections with cross-covariances and hand-back are a Kalman update, through turns as well."""
    beliefs = []
    for belief_type in (AttractorBelief, KalmanBelief):
        belief = belief_type.uniform(np.zeros(2), 0.0, LocalizerConfig()).challenge(measured(0.0, 0.0, 0.0)).adopt()
        for k in range(1, 15):
            for _ in range(5):
                belief = belief.predict(Motion(1.0, 0.02, 0.1))
            theta = 0.1 * k
            belief = belief.inject(measured(50.0 * np.sin(theta) + 0.3, 50.0 * (1.0 - np.cos(theta)), theta))
        beliefs.append(belief)
    ours, yardstick = beliefs
    assert_allclose(ours.pose, yardstick.pose, atol=1e-3)
    assert_allclose(ours.covariance, yardstick.covariance, atol=1e-3)
    assert ours.log_scale == pytest.approx(yardstick.log_scale, abs=1e-4)


@pytest.mark.parametrize("belief_type", [AttractorBelief, KalmanBelief])
def test_a_challenger_moves_along_its_own_heading_and_snaps_when_adopted(belief_type):
    belief = belief_type.uniform(np.zeros(2), 0.0, LocalizerConfig()).challenge(measured(0.0, 0.0, 0.0)).adopt()
    belief = belief.challenge(measured(300.0, 40.0, np.pi / 2))
    for _ in range(10):
        belief = belief.predict(Motion(1.0, 0.0, 0.1))
    assert_allclose(belief.pose, [10.0, 0.0, 0.0], atol=0.1)
    assert belief.sq_distance(measured(300.0, 50.0, np.pi / 2), challenger=True) < 1.0
    assert_allclose(belief.adopt().pose, [300.0, 50.0, np.pi / 2], atol=0.1)


@pytest.mark.parametrize("make", [KalmanBelief.uniform, AttractorBelief.uniform])
def test_backwards_undoes_what_forwards_did(make):
    belief = make(np.zeros(2), 0.0, LocalizerConfig())
    belief = belief.inject(PoseMeasurement(np.array([0.0, 0.0, 0.3]), np.diag([0.01, 0.01, 1e-4])))
    begin = belief.pose
    there = [Motion(0.3, 0.02, 0.1)] * 40
    for motion in [*there, *(Motion(-m.travelled, -m.turned_rad, m.dt_s) for m in there)]:
        belief = belief.predict(motion)
    assert_allclose(belief.pose, begin, atol=0.02)
    assert np.linalg.eigvalsh(belief.covariance).min() > 0.0
