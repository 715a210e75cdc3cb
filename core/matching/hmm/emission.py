"""Emission probability of the hidden Markov model: how well a position on a lane explains a vertex of the map."""

from __future__ import annotations

import numpy as np

from hippodrome.core.types import FloatArray

MEDIAN_TO_SIGMA = 1.4826  # standard deviation of a normal distribution over its median absolute deviation


def log_emission(distance_m: FloatArray, sigma_z_m: float) -> FloatArray:
    """Logarithm of Eq. (8), Li et al. 2025: a normal density of the distance between a vertex and its candidate.

    Args:
        distance_m: (K,) distance of each candidate from its vertex.
        sigma_z_m: standard deviation of that distance.

    Returns:
        The log densities (K,).
    """
    logarithm: FloatArray = -0.5 * (np.asarray(distance_m) / sigma_z_m) ** 2 - np.log(np.sqrt(2.0 * np.pi) * sigma_z_m)
    return logarithm


def estimate_sigma_z_m(distance_m: FloatArray) -> float:
    """Estimate sigma_z of Eq. (8), Li et al. 2025, robustly, from the distances (T,) of vertices to their matched positions."""
    return MEDIAN_TO_SIGMA * float(np.median(distance_m))
