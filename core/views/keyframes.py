"""When a new view is due, without knowing the scale: after a typical time's travel or a turn, never while standing still.

The unit of speed is unknown, so "typical" comes from the drive itself: the median speed while moving. Multiplying all
speeds by a constant multiplies all lengths by it and changes nothing else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numba import njit

from hippodrome.core import se2
from hippodrome.core.types import FloatArray, IntArray, Observation

BINS_PER_E = 20  # histogram of log speed: 5 % per bin
HALF_RANGE = 256  # bins on either side of the first speed: a factor of e^12.8


@dataclass(frozen=True)
class ViewStepConfig:
    """How densely the drive is mapped."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    interval_s: float = 0.6  # at the median moving speed: about 5 m at 30 km/h
    turn_rad: float = math.radians(10.0)  # a turn changes the view faster than travel does
    moving_share: float = 0.2  # of the 90th percentile of speed: below it the vehicle stands, and speed is noise

    def __post_init__(self) -> None:
        if self.interval_s <= 0.0 or self.turn_rad <= 0.0 or not 0.0 < self.moving_share < 1.0:
            raise ValueError("view step: interval_s and turn_rad must be positive, moving_share within (0, 1)")


@dataclass(frozen=True, slots=True, eq=False)
class ViewStepState:
    """Motion since the last view and the speeds so far."""

    motion: FloatArray  # (3,) raw body motion since the last view, map units and rad
    travelled: float  # path length since the last view
    turned_rad: float  # magnitude of the turn since the last view, while moving
    spacing: float  # map units between views on a straight road; 0 before the first motion
    slowest: float  # speeds below are standing still
    first_speed: float  # the histogram's centre; 0 before the first motion
    histogram: IntArray  # (2 HALF_RANGE + 1,) of log speeds


def start() -> ViewStepState:
    """Before the first observation."""
    return ViewStepState(np.zeros(3), 0.0, 0.0, 0.0, 0.0, 0.0, np.zeros(2 * HALF_RANGE + 1, dtype=np.int32))


def advance(state: ViewStepState, observation: Observation, config: ViewStepConfig) -> ViewStepState:
    """One observation's motion added."""
    speed, dt_s = abs(observation.speed), observation.dt_s
    first = state.first_speed or speed
    histogram, spacing, slowest = state.histogram, state.spacing, state.slowest
    if speed > 0.0:
        histogram = histogram.copy()
        histogram[_bin(speed, first)] += 1
        typical, slowest = _speeds(histogram, first, config.moving_share)
        spacing = typical * config.interval_s
    turn_rad = observation.yaw_rate_radps * dt_s
    moving = speed > slowest
    return ViewStepState(
        motion=se2.compose(state.motion, arc(observation.speed * dt_s, turn_rad)),
        travelled=state.travelled + (speed * dt_s if moving else 0.0),
        turned_rad=state.turned_rad + (turn_rad if moving else 0.0),
        spacing=spacing,
        slowest=slowest,
        first_speed=first,
        histogram=histogram,
    )


def is_due(state: ViewStepState, config: ViewStepConfig) -> bool:
    """Whether the view has changed enough to be worth a visit."""
    if state.spacing == 0.0:
        return False
    nearly = 1.0 - 1e-9  # sums of equal steps must not miss their multiple by rounding
    return state.travelled >= nearly * state.spacing or abs(state.turned_rad) >= nearly * config.turn_rad


def restart(state: ViewStepState) -> ViewStepState:
    """A view was taken: motion starts anew, the speeds stay."""
    return ViewStepState(np.zeros(3), 0.0, 0.0, state.spacing, state.slowest, state.first_speed, state.histogram)


def arc(length: float, turn_rad: float) -> FloatArray:
    """Body motion (3,) along a circular arc: the chord points half the turn ahead."""
    half = 0.5 * turn_rad
    chord = length * (math.sin(half) / half if abs(half) > 1e-6 else 1.0)
    return np.array([chord * math.cos(half), chord * math.sin(half), turn_rad])


def _bin(speed: float, first: float) -> int:
    return HALF_RANGE + max(-HALF_RANGE, min(HALF_RANGE, round(BINS_PER_E * math.log(speed / first))))


def _speeds(histogram: IntArray, first: float, moving_share: float) -> tuple[float, float]:
    """Median speed while moving, and the speed below which the vehicle stands."""
    fast, typical = _quantile_bins(histogram, BINS_PER_E * math.log(moving_share))
    speed = first * math.exp((typical - HALF_RANGE) / BINS_PER_E)
    return speed, moving_share * first * math.exp((fast - HALF_RANGE) / BINS_PER_E)


@njit(cache=True)
def _quantile_bins(histogram: IntArray, below_fast: float) -> tuple[int, int]:
    """Bins of the 90th percentile of all speeds, and of the median of those no more than ``-below_fast`` bins slower."""
    fast = _quantile(histogram, 0, 0.9)
    return fast, _quantile(histogram, max(0, int(np.ceil(fast + below_fast))), 0.5)


@njit(cache=True)
def _quantile(histogram: IntArray, first: int, share: float) -> int:
    wanted = share * histogram[first:].sum()
    total = 0
    for index in range(first, len(histogram)):
        total += histogram[index]
        if total >= wanted and total > 0:
            return index
    return len(histogram) - 1
