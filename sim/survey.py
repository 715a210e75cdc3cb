"""Survey error: the road network that a user has is not where the roads are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray

CORRELATION_M = 60.0  # neighbouring roads of one survey are displaced alike, those a few blocks away are not
AT_ONCE = 4096  # points whose waves are summed together: those of a network of 1,000 km would take half a gigabyte
WAVES = 128  # enough plane waves for a field that is Gaussian at every point


def with_survey_error(network: RoadNetwork, sigma_m: float, rng: np.random.Generator) -> RoadNetwork:
    """The network displaced by a smooth random field of standard deviation ``sigma_m`` per axis (random Fourier features)."""
    if sigma_m == 0.0:
        return network
    return replace(network, points_m=network.points_m + sigma_m * _smooth_field(network.points_m, rng))


def _smooth_field(points_m: FloatArray, rng: np.random.Generator) -> FloatArray:
    waves = rng.standard_normal((2, WAVES)) / CORRELATION_M
    phase = rng.uniform(0.0, 2.0 * np.pi, (WAVES, 2))
    angles = points_m @ waves
    sums = [np.cos(angles[k : k + AT_ONCE, :, None] + phase).sum(axis=1) for k in range(0, len(angles), AT_ONCE)]
    field: FloatArray = np.sqrt(2.0 / WAVES) * np.concatenate(sums)
    return field
