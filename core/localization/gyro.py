"""White noise of the yaw rate, estimated from the signal itself.

A filter that trusts a noisy gyro holds on to a wrong heading, and the heading error becomes one of position. Vehicles turn
smoothly: what changes from sample to sample is noise. The second differences of the samples therefore show how noisy the gyro is,
long before any view tells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

# Median magnitude of the second differences of white noise, per standard deviation of the noise: their variance is
# 1 + 4 + 1 times that of the noise, and the median magnitude of a Gaussian is 0.6745 of its standard deviation.
MEDIAN_PER_SIGMA = 0.6745 * math.sqrt(6.0)
RATE = 0.05  # step of ln(sigma) per sample: a tenfold change is followed in 5 s, and the estimate wanders by a tenth


@dataclass(frozen=True, slots=True)
class GyroNoise:
    """The last two yaw rates, how many there have been, and the standard deviation estimated so far (0: none yet)."""

    before_radps: float = 0.0
    last_radps: float = 0.0
    samples: int = 0
    sigma_radps: float = 0.0


def update(state: GyroNoise, yaw_rate_radps: float, least_radps: float) -> GyroNoise:
    """The estimate of the gyro's noise after one more yaw rate.

    Sigma grows or shrinks by a small step, whether the new second difference is larger or smaller than its median would be in
    white noise of this sigma. So it tends to the sigma at which half of them are larger. The few samples at the beginning of a
    turn, which no smooth motion explains, hardly move a median.

    Args:
        state: the estimate so far.
        yaw_rate_radps: the new sample.
        least_radps: lower bound of sigma.
    """
    sigma = max(state.sigma_radps, least_radps)
    if state.samples >= 2:
        change = abs(yaw_rate_radps - 2.0 * state.last_radps + state.before_radps)
        sigma *= math.exp(RATE if change > MEDIAN_PER_SIGMA * sigma else -RATE)
    return GyroNoise(state.last_radps, yaw_rate_radps, state.samples + 1, max(sigma, least_radps))
