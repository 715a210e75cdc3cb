"""When a new keyframe is due: after a typical time's travel, or a turn, but never while standing still. No scale is needed.

The unit of speed is unknown, so that "typical" has to come from the drive itself: it is the median speed while moving.
Multiplying all speeds by a constant multiplies all lengths by it and changes nothing else.

State is immutable: ``start``, then ``advance`` with every observation; where ``is_due``, take the keyframe and ``restart``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from hippodrome.core import se2
from hippodrome.core.types import FloatArray, IntArray, Observation
from hippodrome.core.views.config import KeyframeConfig

BINS_PER_E = 20  # bins of the histogram of log speed per factor of e: 5 % of speed each
HALF_RANGE = 256  # bins on either side of the first speed: a factor of e^12.8


@dataclass(frozen=True, slots=True, eq=False)
class KeyframeState:
    """Motion since the last keyframe, and the distribution of the speeds so far."""

    motion: FloatArray  # (3,) raw body motion since the last keyframe, map units and rad
    travelled: float  # path length since the last keyframe, while moving, map units
    turned_rad: float  # signed turn since the last keyframe, while moving
    spacing: float  # map units between keyframes on a straight road; 0 before the first motion
    slowest: float  # speeds up to this one count as standing still
    first_speed: float  # centre of the histogram; 0 before the first motion
    histogram: IntArray  # (2 HALF_RANGE + 1,) counts of log speeds


def start() -> KeyframeState:
    """The state before the first observation."""
    return KeyframeState(np.zeros(3), 0.0, 0.0, 0.0, 0.0, 0.0, np.zeros(2 * HALF_RANGE + 1, dtype=np.int32))


def advance(state: KeyframeState, observation: Observation, config: KeyframeConfig) -> KeyframeState:
    """The state after one more observation, whose motion is added and whose speed goes into the histogram of speeds.

    Path length and turn, which decide whether a keyframe is due, grow only while the vehicle moves: the odometry of a standing
    vehicle is noise.
    """
    speed, dt_s = abs(observation.speed), observation.dt_s
    first = state.first_speed or speed
    histogram, spacing, slowest = state.histogram, state.spacing, state.slowest
    if speed > 0.0:
        histogram = histogram.copy()
        histogram[_bin(speed, first)] += 1
        typical, slowest = _typical_and_slowest(histogram, first, config.moving_share)
        spacing = typical * config.interval_s
    turn_rad = observation.yaw_rate_radps * dt_s
    moving = speed > slowest
    return KeyframeState(
        motion=se2.compose(state.motion, arc_motion(observation.speed * dt_s, turn_rad)),
        travelled=state.travelled + (speed * dt_s if moving else 0.0),
        turned_rad=state.turned_rad + (turn_rad if moving else 0.0),
        spacing=spacing,
        slowest=slowest,
        first_speed=first,
        histogram=histogram,
    )


def is_due(state: KeyframeState, config: KeyframeConfig) -> bool:
    """Whether a new keyframe is due: the vehicle has driven ``spacing``, or turned by ``turn_rad``, since the last one.

    None is due before the first motion, as the spacing is unknown until then.
    """
    if state.spacing == 0.0:
        return False
    nearly = 1.0 - 1e-9  # sums of equal steps must not miss their multiple by rounding
    return state.travelled >= nearly * state.spacing or abs(state.turned_rad) >= nearly * config.turn_rad


def restart(state: KeyframeState) -> KeyframeState:
    """The state after a keyframe was taken: motion counts from zero again, the speeds are remembered."""
    return KeyframeState(np.zeros(3), 0.0, 0.0, state.spacing, state.slowest, state.first_speed, state.histogram)


def arc_motion(length: float, turn_rad: float) -> FloatArray:
    """Body motion (3,) along a circular arc of a given length: its chord points half the turn to the left of ahead."""
    half = 0.5 * turn_rad
    chord = length * (math.sin(half) / half if abs(half) > 1e-6 else 1.0)
    return np.array([chord * math.cos(half), chord * math.sin(half), turn_rad])


def _bin(speed: float, first: float) -> int:
    """Bin of a speed in the histogram of log speeds, whose middle bin is that of the ``first`` speed.

    The outermost bins also hold the speeds beyond them.
    """
    return HALF_RANGE + max(-HALF_RANGE, min(HALF_RANGE, round(BINS_PER_E * math.log(speed / first))))


def _typical_and_slowest(histogram: IntArray, first: float, moving_share: float) -> tuple[float, float]:
    """Median speed while moving, and the speed up to which the vehicle counts as standing still.

    The latter is ``moving_share`` of the 90th percentile of all speeds.
    """
    fast, typical = _quantile_bins(histogram, BINS_PER_E * math.log(moving_share))
    speed = first * math.exp((typical - HALF_RANGE) / BINS_PER_E)
    return speed, moving_share * first * math.exp((fast - HALF_RANGE) / BINS_PER_E)


@njit(cache=True)
def _quantile_bins(histogram: IntArray, below_fast: float) -> tuple[int, int]:
    """Bin of the 90th percentile of all speeds, and of the median of those at most ``-below_fast`` bins slower than it."""
    fast = _quantile(histogram, 0, 0.9)
    return fast, _quantile(histogram, max(0, int(np.ceil(fast + below_fast))), 0.5)


@njit(cache=True)
def _quantile(histogram: IntArray, first: int, share: float) -> int:
    """First bin from ``first`` on at which ``share`` of the counts from there on is reached."""
    wanted = share * histogram[first:].sum()
    total = 0
    for index in range(first, len(histogram)):
        total += histogram[index]
        if total >= wanted and total > 0:
            return index
    return len(histogram) - 1
