"""How well a drive between two positions explains the motion between two vertices."""

from __future__ import annotations

import numpy as np

from hippodrome.core.types import FloatArray


def log_transition(difference_m: FloatArray, beta_m: float) -> FloatArray:
    """Logarithm of Eq. (9), Li et al. 2025: an exponential density in d_t; minus infinity where there is no route."""
    logarithm: FloatArray = -np.asarray(difference_m) / beta_m - np.log(beta_m)
    return logarithm


def distance_difference_m(measured_m: FloatArray, route_m: FloatArray) -> FloatArray:
    """d_t of Eq. (9), Li et al. 2025: measured against driven distance."""
    difference: FloatArray = np.abs(np.asarray(measured_m) - np.asarray(route_m))
    return difference


def estimate_beta_m(difference_m: FloatArray) -> float:
    """beta of Eq. (9), Li et al. 2025, from d_t (T - 1,) along the matched route."""
    return float(np.median(difference_m)) / float(np.log(2.0))
