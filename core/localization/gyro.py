"""White noise of the yaw rate, told from the signal itself: vehicles turn smoothly, what changes between samples is noise.

A filter that trusts a noisy gyro holds on to a wrong heading, and the heading error becomes one of position. A noisy one shows
before any view tells: in the second differences of its samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

MEDIAN_PER_SIGMA = 0.6745 * math.sqrt(6.0)  # of the magnitude of the second differences of white noise: variances 1 + 4 + 1
RATE = 0.05  # of the logarithm per sample: a tenfold change is followed in 5 s, and the median wanders by a tenth


@dataclass(frozen=True, slots=True)
class GyroNoise:
    """The last two samples and the running estimate; 0 before there is one."""

    before_radps: float = 0.0
    last_radps: float = 0.0
    samples: int = 0
    sigma_radps: float = 0.0


def update(state: GyroNoise, yaw_rate_radps: float, least_radps: float) -> GyroNoise:
    """One sample more: the sigma steps towards the median, which the few samples of a junction's beginning do not move.

    ``least_radps`` is the smallest sigma that is told apart from none.
    """
    sigma = max(state.sigma_radps, least_radps)
    if state.samples >= 2:
        change = abs(yaw_rate_radps - 2.0 * state.last_radps + state.before_radps)
        sigma *= math.exp(RATE if change > MEDIAN_PER_SIGMA * sigma else -RATE)
    return GyroNoise(state.last_radps, yaw_rate_radps, state.samples + 1, max(sigma, least_radps))
