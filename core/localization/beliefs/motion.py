"""Motion model of both pose beliefs, linearised: how an error in heading or scale becomes one of position.

The state is (x_m, y_m, heading_rad, log_scale); its covariance is (4, 4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from hippodrome.core.localization.config import Injection, MotionNoise
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray


@dataclass(frozen=True, slots=True)
class Motion:
    """Self-motion over one observation."""

    travelled: float  # map units of this drive
    turned_rad: float
    dt_s: float
    gyro_rad_per_sqrt_s: float = 0.0  # what the signal itself shows of its noise


def predicted_covariance(
    covariance: FloatArray, heading_rad: float, log_scale: float, motion: Motion, noise: MotionNoise
) -> FloatArray:
    """Covariance (4, 4) after ``motion`` from a state of that heading and scale."""
    along = displacement_m(heading_rad, log_scale, motion)
    walk = max(noise.gyro_rad_per_sqrt_s, motion.gyro_rad_per_sqrt_s)
    sq_heading = walk**2 * motion.dt_s + (noise.gyro_gain * motion.turned_rad) ** 2
    sq_scale = noise.scale_walk_per_sqrt_m**2 * math.hypot(*along)
    grown: FloatArray = _grown(covariance, along[0], along[1], noise.speed**2 / motion.dt_s, sq_heading, sq_scale)
    return grown


@njit(cache=True)
def _grown(
    covariance: FloatArray, east_m: float, north_m: float, sq_speed: float, sq_heading: float, sq_scale: float
) -> FloatArray:
    """J P J^T + Q, where J adds heading and scale errors, turned about or drawn along the step, to x and y."""
    moved = covariance.copy()
    for k in range(4):
        moved[0, k] += east_m * covariance[3, k] - north_m * covariance[2, k]
        moved[1, k] += north_m * covariance[3, k] + east_m * covariance[2, k]
    grown = moved.copy()
    for k in range(4):
        grown[k, 0] += east_m * moved[k, 3] - north_m * moved[k, 2]
        grown[k, 1] += north_m * moved[k, 3] + east_m * moved[k, 2]
    grown[0, 0] += sq_speed * east_m * east_m
    grown[0, 1] += sq_speed * east_m * north_m
    grown[1, 0] += sq_speed * east_m * north_m
    grown[1, 1] += sq_speed * north_m * north_m
    grown[2, 2] += sq_heading
    grown[3, 3] += sq_scale
    return grown


def displacement_m(heading_rad: float, log_scale: float, motion: Motion) -> tuple[float, float]:
    """x += cos(theta) v dt, y += sin(theta) v dt, along the chord of the turn."""
    distance_m, chord_rad = motion.travelled * math.exp(log_scale), heading_rad + 0.5 * motion.turned_rad
    return distance_m * math.cos(chord_rad), distance_m * math.sin(chord_rad)


def innovation(pose: FloatArray, injection: Injection) -> FloatArray:
    """Injected pose (3,) minus ``pose``, the heading along the shorter arc."""
    difference: FloatArray = injection.pose - pose
    difference[2] = wrap_compiled(difference[2])
    return difference


def correction(covariance: FloatArray, difference: FloatArray, injection: Injection) -> tuple[FloatArray, FloatArray]:
    """Shift (4,) and covariance (4, 4) of the state after an injection that differs from it by ``difference`` (3,)."""
    shift, after = _corrected(covariance, difference, injection.covariance)
    return shift, after


@njit(cache=True)
def _corrected(covariance: FloatArray, difference: FloatArray, noise: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gain P H^T S^-1, then Joseph's form, which stays symmetric; H sees the first three of the state."""
    seen = np.ascontiguousarray(covariance[:, :3])
    gain = np.ascontiguousarray(np.linalg.solve(seen[:3] + noise, seen.T).T)
    left = np.eye(4)
    left[:, :3] -= gain
    return gain @ difference, left @ covariance @ left.T + gain @ noise @ gain.T
