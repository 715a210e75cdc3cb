"""How fast to go: for the road, for who drives ahead, and for where to stop."""

from __future__ import annotations

import math

from hippodrome.core.navigation.config import DriveConfig, VehicleShape
from hippodrome.core.navigation.types import Radar

LEAST_STOP_M = 0.15  # the last hand's breadth
BEGUN_SHARE = 0.7
LEAST_GAP_M = 0.3  # the intelligent driver model divides by the gap


def stopping_mps(distance_m: float, braking_mps2: float) -> float:
    """The speed from which one stops within a distance: v^2 = 2 b d."""
    return math.sqrt(2.0 * braking_mps2 * max(distance_m, 0.0))


def in_sight_mps(distance_m: float, config: DriveConfig) -> float:
    """The speed from which one stops within what is in sight: d = v t + v^2 / (2 b), as the speed follows the wanted one late."""
    lag_s, braking = 1.0 / config.speed_gain_1ps, config.braking_mps2
    return braking * (math.sqrt(lag_s**2 + 2.0 * max(distance_m, 0.0) / braking) - lag_s)


def can_stop(distance_m: float, speed_mps: float, braking_mps2: float) -> bool:
    """Whether one can still stop within a distance."""
    return speed_mps**2 <= 2.0 * braking_mps2 * max(distance_m, 0.0) + 1e-9


def approach_mps2(speed_mps: float, wanted_mps: float, config: DriveConfig) -> float:
    """The acceleration towards a wanted speed, comfortable upwards, and firm downwards where that is needed."""
    wanted = config.speed_gain_1ps * (wanted_mps - speed_mps)
    return min(max(wanted, -config.firm_braking_mps2), config.acceleration_mps2)


def following_mps2(speed_mps: float, radar: Radar, config: DriveConfig, vehicle: VehicleShape) -> float:
    """The interaction term of the intelligent driver model (Treiber, Hennecke and Helbing, Physical Review E 62, 2000).

    a (1 - (s*/s)^2) with s* = s0 + v T + v dv / (2 sqrt(a b)); infinite without anyone ahead. Where the gap would be used up at
    the present closing speed even under firm braking, the brakes are used in full.
    """
    if radar.blind or not math.isfinite(radar.gap_m):
        return math.inf
    gap_m, closing = max(radar.gap_m, LEAST_GAP_M), radar.closing_mps
    root = 2.0 * math.sqrt(config.following_mps2 * config.braking_mps2)
    wanted_m = config.jam_gap_m + max(0.0, speed_mps * config.headway_s + speed_mps * closing / root)
    accel = config.following_mps2 * (1.0 - (wanted_m / gap_m) ** 2)
    if closing > 0.0 and closing**2 > 2.0 * config.firm_braking_mps2 * max(gap_m - 1.0, 0.1):
        return -vehicle.max_braking_mps2
    return max(accel, -vehicle.max_braking_mps2)


def stop_mps2(speed_mps: float, to_stop_m: float, config: DriveConfig, vehicle: VehicleShape) -> float:
    """What stops a vehicle in time, b = v^2 / (2 d), from when on that takes most of the planned braking; else infinite."""
    needed = speed_mps**2 / (2.0 * max(to_stop_m, LEAST_STOP_M))
    if not math.isfinite(to_stop_m) or needed < BEGUN_SHARE * config.braking_mps2:
        return math.inf
    return -min(needed, vehicle.max_braking_mps2)


def there_mps2(to_goal_m: float, config: DriveConfig) -> float:
    """What stops a vehicle that is at its goal, within the tolerance; else infinite.

    The speed follows the wanted one with a lag, so that the last hand's breadths would take a second and more.
    """
    return -config.braking_mps2 if to_goal_m < config.goal_tolerance_m else math.inf
