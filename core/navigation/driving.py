"""Driving on a course: the speed for the road, the goal and the next junction."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hippodrome.core.navigation.config import DriveConfig, VehicleShape
from hippodrome.core.navigation.course import Course, Gate, at, next_gate, next_mouth
from hippodrome.core.navigation.junctions import SIGHT_M, gate_speed_mps, is_barred, room_to_stop_m
from hippodrome.core.navigation.speed import stopping_mps
from hippodrome.core.navigation.types import Indicator, Lamp, Radar

LOOK_S = 0.6  # braking begins so early: the speed follows the wanted one with a lag of 1 / speed_gain, .67 s
CHANGE_INDICATED_M = 25.0  # before a lane change
BARRED = "waits: somebody stands beyond the junction"
TURN_SIGMA_M = 0.6  # a turn is driven as ever where its place along the way is known so well: a corner forgives about twice that
TURN_AHEAD_M, WALK_MPS = (
    15.0,
    1.5,
)  # and slower so far before it where not, at walking pace at least: its mouth is in view by then
SLOWEST_MPS = 2.5  # however unsure the place: a vehicle that stands learns nothing of it


@dataclass(frozen=True, slots=True)
class Pace:
    """How fast to go on a course, what to indicate, and why."""

    speed_mps: float
    indicator: Indicator
    reason: str
    to_stop_m: float  # how far to where to stop; infinite if there is no need


def pace(
    course: Course,
    u_m: float,
    speed_mps: float,
    radar: Radar,
    sigma_m: float,
    config: DriveConfig,
    vehicle: VehicleShape,
    along_sigma_m: float = 0.0,
) -> Pace:
    """The speed at the place ``u_m`` of a course whose position is known to ``sigma_m``, and along it to ``along_sigma_m``."""
    wanted, reason = min(at(course.speed_mps, u_m), at(course.speed_mps, u_m + LOOK_S * speed_mps)), ""
    if sigma_m > config.unsure_m:
        unsure = max(wanted * config.unsure_m / sigma_m, min(wanted, SLOWEST_MPS))
        wanted, reason = unsure, "slows down: the place is not known well"
    to_goal_m = course.goal_u_m - u_m
    goal_mps = stopping_mps(to_goal_m - 0.5 * config.goal_tolerance_m, config.braking_mps2)
    stop_m = to_goal_m - 0.5 * config.goal_tolerance_m
    if goal_mps < wanted:
        wanted, reason = goal_mps, "stops at the goal"
    gate = next_gate(course, u_m)
    indicator = Indicator.STRAIGHT
    if gate is not None and gate.entry_u_m < course.goal_u_m:
        if gate.entry_u_m - vehicle.front_m - config.stop_before_m - u_m < SIGHT_M:
            indicator = gate.indicator
        unsure = turn_mps(gate, u_m, wanted, along_sigma_m)
        if unsure < wanted:
            wanted, reason = unsure, "slows down: the mouth is not known well"
    gate = next_mouth(course, u_m) if radar.lamp is Lamp.NONE else gate  # there may be signals where nobody crosses
    if gate is not None and gate.entry_u_m < course.goal_u_m:
        to_stop_m = gate.entry_u_m - vehicle.front_m - config.stop_before_m - u_m
        if to_stop_m < SIGHT_M and indicator is Indicator.STRAIGHT:
            indicator = gate.indicator
        slowed, why = gate_speed_mps(to_stop_m, speed_mps, radar, config)
        if gate.indicator is Indicator.STRAIGHT and is_barred(to_stop_m, speed_mps, radar):
            slowed, why = stopping_mps(to_stop_m, config.braking_mps2), BARRED
        stop_m = min(stop_m, room_to_stop_m(to_stop_m)) if math.isfinite(slowed) else stop_m
        if slowed < wanted:
            wanted, reason = slowed, why
    if indicator is Indicator.STRAIGHT:
        indicator = _change_indicated(course, u_m)
    return Pace(wanted if math.isfinite(wanted) else 0.0, indicator, reason, stop_m)


def turn_mps(gate: Gate, u_m: float, wanted_mps: float, along_sigma_m: float) -> float:
    """The speed before a turn whose place along the way is known to ``along_sigma_m``: slow where that is not enough to turn."""
    is_near = 0.0 < gate.entry_u_m - u_m < TURN_AHEAD_M and gate.indicator is not Indicator.STRAIGHT
    if not is_near or along_sigma_m <= TURN_SIGMA_M:
        return wanted_mps
    return min(wanted_mps, max(wanted_mps * TURN_SIGMA_M / along_sigma_m, WALK_MPS))


def _change_indicated(course: Course, u_m: float) -> Indicator:
    """What to indicate for a lane change that is due."""
    for change_m, left in zip(course.changes_u_m, course.changes_left, strict=True):
        if -0.5 * CHANGE_INDICATED_M < change_m - u_m < CHANGE_INDICATED_M:
            return Indicator.LEFT if left else Indicator.RIGHT
    return Indicator.STRAIGHT
