"""The coupled networks against an extended Kalman filter that is given the same motions and injections."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from hippodrome.core import se2
from hippodrome.core.localization.beliefs.attractor import AttractorBelief
from hippodrome.core.localization.beliefs.config import BeliefConfig
from hippodrome.core.localization.beliefs.kalman import KalmanBelief
from hippodrome.core.localization.beliefs.motion import Motion, PoseMeasurement

CONFIG = BeliefConfig()
DT_S = 0.1


def drive(rng, steps):
    """Poses along random bends and what odometry of another unit says of the way between them."""
    turned, metres = np.cumsum(rng.normal(0.0, 0.004, steps)), rng.uniform(0.5, 0.9, steps)
    half = 0.5 * turned
    poses = se2.integrate(np.array([40.0, -20.0, 0.3]), np.stack([metres * np.cos(half), metres * np.sin(half), turned], axis=1))
    travelled = metres / 1.25 * (1.0 + rng.normal(0.0, 0.03, steps))
    return poses[-steps:], [Motion(float(m), float(t), DT_S) for m, t in zip(travelled, turned, strict=True)]


def seen(rng, pose):
    noise = CONFIG.injection
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    sigma = np.array([noise.along_m, noise.across_m, noise.heading_rad])
    return PoseMeasurement(pose + turn @ (sigma * rng.normal(size=3)), turn @ np.diag(sigma**2) @ turn.T)


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10_000))
def test_the_networks_hold_what_a_kalman_filter_would_from_the_first_challenge_on(seed):
    rng = np.random.default_rng(seed)
    beliefs = [kind.uniform(np.zeros(2), 0.0, CONFIG) for kind in (AttractorBelief, KalmanBelief)]
    poses, motions = drive(rng, 60)
    for i, (pose, motion) in enumerate(zip(poses, motions, strict=True)):
        beliefs = [belief.predict(motion) for belief in beliefs]
        if i % 4:
            continue
        measurement = seen(rng, pose)
        if i == 0:
            beliefs = [belief.challenge(measurement) for belief in beliefs]
        elif i < 20:
            beliefs = [belief.reinforce(measurement) for belief in beliefs]
        elif i == 20:
            beliefs = [belief.reinforce(measurement).adopt() for belief in beliefs]
        else:
            beliefs = [belief.inject(measurement) for belief in beliefs]
    attractor, kalman = beliefs
    assert_allclose(attractor.pose, kalman.pose, atol=0.05)
    assert attractor.log_scale == pytest.approx(kalman.log_scale, abs=0.01)
    assert_allclose(np.diag(attractor.covariance), np.diag(kalman.covariance), rtol=0.15)


def test_a_challenger_learns_the_scale_while_the_incumbent_keeps_its_own():
    rng = np.random.default_rng(4)
    poses, motions = drive(rng, 200)
    belief = AttractorBelief.uniform(np.zeros(2), 0.0, CONFIG).challenge(seen(rng, poses[0]))
    for pose, motion in zip(poses[1:], motions[1:], strict=True):
        belief = belief.predict(motion).reinforce(seen(rng, pose))
    assert belief.log_scale == 0.0
    assert belief.adopt().log_scale == pytest.approx(np.log(1.25), abs=0.03)
