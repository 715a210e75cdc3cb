"""Observations and actions as policies of Gymnasium have them: dictionaries of arrays, and numbers in [-1, 1]."""

from __future__ import annotations

import math
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hippodrome.core.navigation.types import Command, Indicator, Radar
from hippodrome.core.types import Frame, HippodromeError, Observation

ACCELERATION_RANGE_MPS2: Final = (-5.0, 5.0)  # of highway-env's ContinuousAction; the car itself gains 4 m/s^2 at most
STEERING_RANGE_RAD: Final = (-0.25 * math.pi, 0.25 * math.pi)  # the same; the car's wheels turn by 42 degrees at most
FASTEST_UNITS: Final = 1000.0  # map units per second: bound of what is observed, never reached
FASTEST_TURN_RADPS: Final = 10.0
RADAR_REACH_M: Final = 100.0  # said where no road user is in reach
Observed: TypeAlias = dict[str, Any]
Action: TypeAlias = NDArray[Any]


def observed(observation: Observation, radar: Radar | None, frame: Frame, behind: bool = False) -> Observed:
    """What is sensed, as a dictionary.

    Args:
        observation: of the step.
        radar: what the radar says; None: it is left out.
        frame: (H, W, 3) of the camera, the last one where this step has none.
        behind: whether the radar also says what is needed to reverse.
    """
    return {
        "frame": frame,
        "speed": _boxed(observation.speed, FASTEST_UNITS),
        "yaw_rate": _boxed(observation.yaw_rate_radps, FASTEST_TURN_RADPS),
        **({} if radar is None else _radar(radar, behind)),
    }


def mapped(number: float, bounds: tuple[float, float]) -> float:
    """A number in [-1, 1] as one between the bounds."""
    return bounds[0] + 0.5 * (number + 1.0) * (bounds[1] - bounds[0])


def indicator_of(number: float) -> Indicator:
    """The indicator of an action's third number: below -1/3 right, above 1/3 left."""
    return Indicator(int(np.sign(round(1.5 * number))))


def command_of(action: Any) -> Command:
    """The command of an action of two or three numbers in [-1, 1]. Raises HippodromeError if it is none."""
    try:
        numbers = np.asarray(action, dtype=np.float64).ravel()
    except (TypeError, ValueError):
        raise HippodromeError(
            f"action: {str(action)[:60]!r} is no array of numbers; two or three in [-1, 1] are expected"
        ) from None
    if len(numbers) not in (2, 3) or not np.isfinite(numbers).all():
        raise HippodromeError(f"action: {numbers[:4].tolist()} is not two or three finite numbers; they lie in [-1, 1]")
    accel, steering, *rest = np.clip(numbers, -1.0, 1.0).tolist()
    indicator = indicator_of(rest[0]) if rest else Indicator.STRAIGHT
    return Command(mapped(accel, ACCELERATION_RANGE_MPS2), mapped(steering, STEERING_RANGE_RAD), indicator)


def _boxed(value: float, most: float) -> Action:
    """A number as an array (1,) in single precision, within its bounds."""
    return np.clip(np.array([value], dtype=np.float32), -most, most)


def _radar(radar: Radar, behind: bool) -> Observed:
    gaps = {"gap_m": radar.gap_m, **({"gap_behind_m": radar.gap_behind_m, "moving_m": radar.moving_m} if behind else {})}
    return {
        **{name: np.clip(np.array([gap], dtype=np.float32), 0.0, RADAR_REACH_M) for name, gap in gaps.items()},
        "closing_mps": _boxed(radar.closing_mps, FASTEST_UNITS),
        "way_is_free": int(radar.way_is_free),
        "lamp": int(radar.lamp),
    }
