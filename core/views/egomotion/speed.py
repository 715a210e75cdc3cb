"""The belief in the vehicle's speed: a number and its variance, carried on and corrected."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

START_MPS: Final = (8.0, 8.0)  # mean and standard deviation of the speed before the first frame
FASTEST_MPS: Final = 45.0  # no step is longer: 160 km/h
ACCELERATION_MPS2: Final = 2.5  # usual change of the speed in a second: a car that brakes or pulls away
ROAD_ERROR: Final = 0.05  # standard deviation of a step by the road, relative: the vehicle pitches on its springs


@dataclass(frozen=True, slots=True)
class Speed:
    """A speed and its variance."""

    mps: float
    variance: float


def start() -> Speed:
    """What is believed before the first frame."""
    return Speed(START_MPS[0], START_MPS[1] ** 2)


def standing(dt_s: float) -> Speed:
    """What is believed of a vehicle that was seen to stand."""
    return Speed(0.0, (ACCELERATION_MPS2 * dt_s) ** 2)


def carried_on(speed: Speed, dt_s: float, seen: Speed | None) -> Speed:
    """The speed after some time, as the last one goes on and, if the depths of corners tell, as these carry it on."""
    change = (ACCELERATION_MPS2 * dt_s) ** 2
    if seen is None:
        return Speed(speed.mps, speed.variance + change)
    weight = change / (change + seen.variance)
    return Speed(speed.mps + weight * (seen.mps - speed.mps), speed.variance + change * (1.0 - weight))


def corrected(speed: Speed, moved_m: float, sigma_m: float, dt_s: float, before_m: float) -> Speed:
    """The speed corrected by the way since the reference frame, of which ``before_m`` was driven before this step."""
    variance = (math.hypot(sigma_m, ROAD_ERROR * moved_m) / dt_s) ** 2
    gain = speed.variance / (speed.variance + variance)
    return Speed(speed.mps + gain * ((moved_m - before_m) / dt_s - speed.mps), speed.variance * (1.0 - gain))
