"""How well a position explains a vertex."""

from __future__ import annotations

import numpy as np

from hippodrome.core.types import FloatArray

MEDIAN_TO_SIGMA = 1.4826  # standard deviation of a normal over its median absolute deviation


def log_emission(distance_m: FloatArray, sigma_z_m: float) -> FloatArray:
    """Logarithm of Eq. (8), Li et al. 2025: a normal density in the distance from a vertex to its candidate."""
    logarithm: FloatArray = -0.5 * (np.asarray(distance_m) / sigma_z_m) ** 2 - np.log(np.sqrt(2.0 * np.pi) * sigma_z_m)
    return logarithm


def estimate_sigma_z_m(distance_m: FloatArray) -> float:
    """sigma_z of Eq. (8), Li et al. 2025, from the distances (T,) to the matched positions."""
    return MEDIAN_TO_SIGMA * float(np.median(distance_m))
