"""Motion model of both pose beliefs, linearised: how an error in heading or scale becomes one of position.

The state is (x_m, y_m, heading_rad, log_scale); its covariance is (4, 4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hippodrome.core.attractor import wrap
from hippodrome.core.localizer_config import Injection, MotionNoise
from hippodrome.core.types import FloatArray

SEEN = np.eye(3, 4)  # an injection sees x, y and heading


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
    transition = np.eye(4)
    transition[0, 2], transition[1, 2] = -along[1], along[0]
    transition[0, 3], transition[1, 3] = along
    grown: FloatArray = transition @ covariance @ transition.T
    grown[:2, :2] += noise.speed**2 / motion.dt_s * np.outer(along, along)
    walk = max(noise.gyro_rad_per_sqrt_s, motion.gyro_rad_per_sqrt_s)
    grown[2, 2] += walk**2 * motion.dt_s + (noise.gyro_gain * motion.turned_rad) ** 2
    grown[3, 3] += noise.scale_walk_per_sqrt_m**2 * math.hypot(*along)
    return grown


def displacement_m(heading_rad: float, log_scale: float, motion: Motion) -> tuple[float, float]:
    """x += cos(theta) v dt, y += sin(theta) v dt, along the chord of the turn."""
    distance_m, chord_rad = motion.travelled * math.exp(log_scale), heading_rad + 0.5 * motion.turned_rad
    return distance_m * math.cos(chord_rad), distance_m * math.sin(chord_rad)


def innovation(pose: FloatArray, injection: Injection) -> FloatArray:
    """Injected pose (3,) minus ``pose``, the heading along the shorter arc."""
    difference: FloatArray = injection.pose - pose
    difference[2] = wrap(difference[2])
    return difference


def correction(covariance: FloatArray, difference: FloatArray, injection: Injection) -> tuple[FloatArray, FloatArray]:
    """Shift (4,) and covariance (4, 4) of the state after an injection that differs from it by ``difference`` (3,)."""
    gain = np.linalg.solve(covariance[:3, :3] + injection.covariance, SEEN @ covariance).T
    left = np.eye(4) - gain @ SEEN
    return gain @ difference, left @ covariance @ left.T + gain @ injection.covariance @ gain.T  # Joseph's form stays symmetric
