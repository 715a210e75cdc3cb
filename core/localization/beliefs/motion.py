"""Motion and measurement of the state (x_m, y_m, heading_rad, log_scale), linearised. Covariances of the state are (4, 4).

The networks and the Kalman filter share these equations. An error in the heading becomes an error of the position across the
track, and an error in the scale becomes one along it: both show in the cross-covariances.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from hippodrome.core.localization.beliefs.config import MotionNoise
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray


@dataclass(frozen=True, slots=True)
class Motion:
    """Self-motion over one observation."""

    travelled: float  # path length, in map units of this drive
    turned_rad: float
    dt_s: float
    gyro_rad_per_sqrt_s: float = 0.0  # random walk of the heading as estimated from the gyro's own signal


@dataclass(frozen=True, slots=True, eq=False)
class PoseMeasurement:
    """A pose in the network frame that a recognised view tells: ``pose`` (3,), ``covariance`` (3, 3) in m, m, rad."""

    pose: FloatArray
    covariance: FloatArray


def predicted_covariance(
    covariance: FloatArray, heading_rad: float, log_scale: float, motion: Motion, noise: MotionNoise
) -> FloatArray:
    """Covariance (4, 4) of the state after a motion: the prediction step of an extended Kalman filter.

    Args:
        covariance: covariance (4, 4) of the state before the motion.
        heading_rad: heading of the state before the motion.
        log_scale: ln(metres per map unit) of the state before the motion.
        motion: the self-motion.
        noise: the noise of the self-motion; its gyro noise is raised to what the motion itself shows.
    """
    east_m, north_m = displacement_m(heading_rad, log_scale, motion)
    random_walk = max(noise.gyro_rad_per_sqrt_s, motion.gyro_rad_per_sqrt_s)
    sq_heading = random_walk**2 * motion.dt_s + (noise.gyro_gain * motion.turned_rad) ** 2
    sq_scale = noise.scale_walk_per_sqrt_m**2 * math.hypot(east_m, north_m)
    predicted: FloatArray = _predicted(covariance, east_m, north_m, noise.speed**2 / motion.dt_s, sq_heading, sq_scale)
    return predicted


@njit(cache=True)
def _predicted(
    covariance: FloatArray, east_m: float, north_m: float, sq_speed: float, sq_heading: float, sq_scale: float
) -> FloatArray:
    """J P J^T + Q, the predicted covariance (4, 4) of (x, y, heading, log scale).

    The Jacobian J turns a heading error into a position error to the left of the step, and a scale error into one along it. Q
    holds the variance along the step, from the speed's relative variance, and those added to heading and scale.
    """
    left = covariance.copy()  # J P
    for k in range(4):
        left[0, k] += east_m * covariance[3, k] - north_m * covariance[2, k]
        left[1, k] += north_m * covariance[3, k] + east_m * covariance[2, k]
    both = left.copy()  # (J P) J^T
    for k in range(4):
        both[k, 0] += east_m * left[k, 3] - north_m * left[k, 2]
        both[k, 1] += north_m * left[k, 3] + east_m * left[k, 2]
    both[0, 0] += sq_speed * east_m * east_m
    both[0, 1] += sq_speed * east_m * north_m
    both[1, 0] += sq_speed * east_m * north_m
    both[1, 1] += sq_speed * north_m * north_m
    both[2, 2] += sq_heading
    both[3, 3] += sq_scale
    return both


def displacement_m(heading_rad: float, log_scale: float, motion: Motion) -> tuple[float, float]:
    """Step to the east and to the north: x += cos(theta) v dt, y += sin(theta) v dt, theta that of the chord of the turn."""
    distance_m, chord_rad = motion.travelled * math.exp(log_scale), heading_rad + 0.5 * motion.turned_rad
    return distance_m * math.cos(chord_rad), distance_m * math.sin(chord_rad)


def innovation(pose: FloatArray, measurement: PoseMeasurement) -> FloatArray:
    """Measured pose (3,) minus the believed ``pose`` (3,), the heading along the shorter arc."""
    difference: FloatArray = measurement.pose - pose
    difference[2] = wrap_compiled(difference[2])
    return difference


def kalman_update(covariance: FloatArray, difference: FloatArray, measurement: PoseMeasurement) -> tuple[FloatArray, FloatArray]:
    """Kalman update by a measured pose.

    Args:
        covariance: covariance (4, 4) of the state before the update.
        difference: the innovation (3,).
        measurement: the measured pose; only its covariance is read.

    Returns:
        The shift (4,) of the state, and its covariance (4, 4) after the update.
    """
    shift, updated = _kalman_update(covariance, difference, measurement.covariance)
    return shift, updated


@njit(cache=True)
def _kalman_update(covariance: FloatArray, difference: FloatArray, noise: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gain K = P H^T S^-1, then Joseph's form (I - K H) P (I - K H)^T + K R K^T, which stays symmetric.

    H picks the first three numbers of the state.
    """
    cross = np.ascontiguousarray(covariance[:, :3])  # P H^T
    gain = np.ascontiguousarray(np.linalg.solve(cross[:3] + noise, cross.T).T)
    rest = np.eye(4)
    rest[:, :3] -= gain
    return gain @ difference, rest @ covariance @ rest.T + gain @ noise @ gain.T
