"""Transition probability of the hidden Markov model: how well a drive between two positions explains a measured motion."""

from __future__ import annotations

import numpy as np

from hippodrome.core.types import FloatArray


def log_transition(difference_m: FloatArray, beta_m: float) -> FloatArray:
    """Logarithm of Eq. (9), Li et al. 2025: an exponential density of d_t, which ``distance_difference_m`` defines.

    Args:
        difference_m: (K,) d_t of each transition in metres, infinite where no drive leads from one position to the other.
        beta_m: mean of d_t under the model.

    Returns:
        The log densities (K,), minus infinity where there is no drive.
    """
    logarithm: FloatArray = -np.asarray(difference_m) / beta_m - np.log(beta_m)
    return logarithm


def distance_difference_m(measured_m: FloatArray, route_m: FloatArray) -> FloatArray:
    """d_t (K,) of Eq. (9), Li et al. 2025: absolute difference of the measured (K,) and the driving distances (K,)."""
    difference: FloatArray = np.abs(np.asarray(measured_m) - np.asarray(route_m))
    return difference


def estimate_beta_m(difference_m: FloatArray) -> float:
    """Estimate beta of Eq. (9), Li et al. 2025, from d_t (T - 1,) along the matched route.

    The median is used, as it is robust; that of an exponential distribution is beta ln 2.
    """
    return float(np.median(difference_m)) / float(np.log(2.0))
