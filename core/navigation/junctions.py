"""Whether to go into a junction: the lamp, the right of way, and whether one can still stop."""

from __future__ import annotations

import math

from hippodrome.core.navigation.config import DriveConfig
from hippodrome.core.navigation.speed import can_stop, stopping_mps
from hippodrome.core.navigation.types import Lamp, Radar

SIGHT_M = 30.0  # a junction farther away does not matter yet
BEYOND_M = (4.0, 60.0)  # beyond the line where one is to stop
STANDS_MPS = 0.4  # a radar's noise is a quarter of that
PASSED_M = 1.6  # whose bumper is so far beyond the line is in the junction, and leaves it; up to there one still stops


def gate_speed_mps(to_stop_m: float, speed_mps: float, radar: Radar, config: DriveConfig) -> tuple[float, str]:
    """The highest speed towards a junction, and why.

    Args:
        to_stop_m: how far the bumper may still go, were one to stop; negative beyond that.
        speed_mps: of the vehicle.
        radar: what it sees.
        config: how to drive.
    """
    if to_stop_m > SIGHT_M or to_stop_m < -PASSED_M or radar.blind:
        return math.inf, ""
    if radar.lamp is Lamp.RED:
        return stopping_mps(to_stop_m, config.braking_mps2), "waits at a red light"
    if radar.lamp is Lamp.YELLOW and can_stop(to_stop_m, speed_mps, config.firm_braking_mps2):
        return stopping_mps(to_stop_m, config.braking_mps2), "stops at a yellow light"
    if not radar.way_is_free and can_stop(to_stop_m + PASSED_M, speed_mps, config.firm_braking_mps2):
        return stopping_mps(to_stop_m, config.braking_mps2), "gives way"
    return math.inf, ""


def is_barred(to_stop_m: float, speed_mps: float, radar: Radar) -> bool:
    """Whether somebody stands beyond the junction ahead, on the way straight on: one waits before it, and not in it."""
    beyond = to_stop_m + BEYOND_M[0] < radar.gap_m < to_stop_m + BEYOND_M[1]
    return not radar.blind and 0.0 < to_stop_m < SIGHT_M and beyond and abs(speed_mps - radar.closing_mps) < STANDS_MPS


def room_to_stop_m(to_stop_m: float) -> float:
    """How far the bumper may go before it has to stand: to the line, or beyond that to the mouth of the junction."""
    return to_stop_m if to_stop_m > 0.0 else max(to_stop_m + PASSED_M, 0.0)
