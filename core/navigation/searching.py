"""Driving without a fix: on sight, along the border on the own side of the road."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hippodrome.core.navigation.border import STEP_M
from hippodrome.core.navigation.config import DriveConfig, VehicleShape
from hippodrome.core.navigation.course import indicated
from hippodrome.core.navigation.junctions import gate_speed_mps
from hippodrome.core.navigation.sight import Ground
from hippodrome.core.navigation.speed import stopping_mps
from hippodrome.core.navigation.steering import lane_curvature_1pm
from hippodrome.core.navigation.types import Indicator, Radar
from hippodrome.core.reading.types import LaneEnd, RoadReading
from hippodrome.core.types import FloatArray

KERB_M = 1.6  # from what is no road to the middle of such a lane
BESIDE_M = 1.35  # from the edge line to the middle of a lane of 3.2 m whose line is painted inside of the border
PREVIEW_S = 0.25  # the wheels take their time to turn
SPAN = 4  # samples of the way over which the rate of its curvature is taken
LOOK_M = 14.0  # of the way ahead
CORNER_RAD = 0.3  # a way that has turned so much goes round a corner
BESIDE_RANGE_M = (0.9, 1.9)  # what that distance can be
FRESH_M = 2.5  # a lane that was read is steered by for so long
FORGOTTEN_M = 8.0  # after so long without a reading, any reading is believed
JUMP_M = 0.6  # readings that differ by more are of different lanes
STRAIGHT_M, AGREES_RAD = 6.0, 0.15  # the lane that was read is steered by where the way turns as it does, so far ahead
SWING_M, SHARP_1PM = 9.0, 0.2  # so far before a sharp bend the way swings out, and is no longer the lane's middle
CREEP_GAP_M = 4.0
STOP_SHORT_M = 0.8  # of the end of the way that can be driven
ROOM_M, LEAST_ROOM_M = 0.95, 0.3  # of the car's middle line on either side: its wheels reach .8 m
PATIENT_S, ROOM_LESS_MPS = 3.0, 0.1  # who stands longer without a way takes less room, rather than stand for ever
STOOD_S, STANDS_MPS, TURNED_RAD = 0.5, 0.3, 0.1  # who has stood so long turns the wheels before going on
WHEEL_RATE_RADPS = 0.6  # at which a way's curvature is followed; the wheels can do .9
LAG_S = 0.6  # with which the speed follows the wanted one: 1 / speed_gain
SEARCH_LATERAL = 0.5  # of the lateral acceleration: corners that nobody knows are taken slowly
BLIND_M = 5.0  # the way is driven so far without a border beside it, at walking pace
SURE_M2 = 0.03  # variance of an offset in the lane that is steered by


@dataclass(frozen=True, slots=True)
class LaneMemory:
    """The lane as it was read last, moved on by dead reckoning; and how far its middle is from the border on the own side.

    Args:
        offset_m: as in ``RoadReading``.
        heading_rad: as there.
        curvature_1pm: as there.
        since_m: driven since the lane was read.
        beside_m: from the border of the ground's map to the lane's middle, learnt where both are seen.
    """

    offset_m: float = 0.0
    heading_rad: float = 0.0
    curvature_1pm: float = 0.0
    since_m: float = math.inf
    beside_m: float = BESIDE_M

    @property
    def is_fresh(self) -> bool:
        """Whether the lane is known well enough to steer by."""
        return self.since_m < FRESH_M


def remembered(
    memory: LaneMemory, reading: RoadReading | None, distance_m: float, turned_rad: float, border_m: float, side: float
) -> LaneMemory:
    """The memory after a step and, where there is one, a reading. A reading that jumps aside is of another lane and is left out.

    ``border_m`` is the distance to the border on the own ``side`` in the ground's map, nan where none is known.
    """
    heading = memory.heading_rad + turned_rad - memory.curvature_1pm * distance_m
    offset, since = memory.offset_m + distance_m * math.sin(heading), memory.since_m + abs(distance_m)
    moved = replace(memory, offset_m=offset, heading_rad=heading, since_m=since)
    if reading is None or reading.offset_variance_m2 > SURE_M2 or not math.isfinite(reading.heading_rad):
        return moved
    if since < FORGOTTEN_M and abs(reading.offset_m - offset) > JUMP_M:
        return moved
    new = 1.0 if since > FORGOTTEN_M else 0.5
    bend = reading.curvature_1pm if math.isfinite(reading.curvature_1pm) else 0.0
    seen = replace(
        moved,
        offset_m=offset + new * (reading.offset_m - offset),
        heading_rad=heading + new * (reading.heading_rad - heading),
        curvature_1pm=memory.curvature_1pm + 0.3 * (bend - memory.curvature_1pm),
        since_m=0.0,
    )
    middle_m = border_m + side * seen.offset_m
    if BESIDE_RANGE_M[0] < middle_m < BESIDE_RANGE_M[1] and abs(seen.heading_rad) < CORNER_RAD:
        seen = replace(seen, beside_m=memory.beside_m + 0.1 * (middle_m - memory.beside_m))
    return seen


@dataclass(frozen=True, slots=True)
class SearchStep:
    """How to go on."""

    curvature_1pm: float
    speed_mps: float
    indicator: Indicator
    reason: str
    may_creep: bool  # only the road itself is in question: nobody has to be let pass, and nothing is near


def search_step(
    ground: Ground, memory: LaneMemory, reading: RoadReading | None, radar: Radar, side: float, speed_mps: float,
    bend_1pm: float, straight_on: bool, stood_s: float, config: DriveConfig, vehicle: VehicleShape,
) -> SearchStep:  # fmt: skip
    """The next step along the border on the own ``side``: -1 right, +1 left; ``bend_1pm`` is what the vehicle drives now.

    ``straight_on`` passes side streets.
    """
    stands = stood_s > STOOD_S and speed_mps < STANDS_MPS
    need_m = max(ROOM_M - ROOM_LESS_MPS * max(stood_s - PATIENT_S, 0.0), LEAST_ROOM_M)
    way = ground.way(bend_1pm, side, memory.beside_m, straight_on, LOOK_M, need_m, stands)
    bends, turned = way.curvature_1pm, way.heading_rad - way.heading_rad[0]
    near = min(int(PREVIEW_S * speed_mps / STEP_M), len(bends) - 1)
    curvature = float(bends[near])
    is_sharp = float(np.max(np.abs(bends[: int(SWING_M / STEP_M)]))) > SHARP_1PM
    in_lane = memory.is_fresh and not is_sharp and _agrees(memory, turned[: int(STRAIGHT_M / STEP_M)])
    if in_lane:
        bend, offset_m, heading = memory.curvature_1pm, memory.offset_m, memory.heading_rad
        curvature = lane_curvature_1pm(bend, offset_m, heading, speed_mps, config)
    wanted, reason = config.search_mps, "looks for known ground"
    first_m = STRAIGHT_M if in_lane else 0.0  # up to there the lane is driven, and not the border
    ahead = np.abs(bends[min(int(first_m / STEP_M), len(bends) - 1) :])
    braking = _braking(config, speed_mps, first_m, len(ahead))
    wanted = min(wanted, float(np.min(np.sqrt(SEARCH_LATERAL * config.lateral_mps2 / np.maximum(ahead, 1e-3) + braking))))
    wanted = min(wanted, _wheels_mps(bends, bend_1pm, speed_mps, config, vehicle))
    if way.seen_m < LOOK_M:
        wanted = min(wanted, max(stopping_mps(way.seen_m, config.braking_mps2), config.creep_mps))
    if way.free_m < LOOK_M:
        ahead_mps = stopping_mps(way.free_m - STOP_SHORT_M, config.braking_mps2)
        wanted, reason = (ahead_mps, "sees no road ahead") if ahead_mps < wanted else (wanted, reason)
    if not np.any(way.seen[: int(BLIND_M / STEP_M)]):
        wanted, reason = min(wanted, config.creep_mps), "sees no border of the road"
    to_stop_m = _to_stop_m(turned, reading, vehicle)
    slowed, why = gate_speed_mps(to_stop_m, speed_mps, radar, config)
    if not math.isfinite(to_stop_m) and not (radar.way_is_free and radar.lamp.value < 2):
        slowed, why = config.search_mps / 2.0, "a junction is ahead"
    if slowed < wanted:
        wanted, reason = slowed, why
    if stands and abs(math.atan(vehicle.wheelbase_m * curvature) - math.atan(vehicle.wheelbase_m * bend_1pm)) > TURNED_RAD:
        wanted, reason = 0.0, "turns its wheels"
    may_creep = not why and radar.gap_m > CREEP_GAP_M
    return SearchStep(curvature, wanted, indicated(float(turned[-1])), reason, may_creep)


def _agrees(memory: LaneMemory, turned_rad: FloatArray) -> bool:
    """Whether the lane goes where the way goes, which has turned by (n,) angles, ``STEP_M`` apart."""
    lane_rad = memory.curvature_1pm * STEP_M * np.arange(1, len(turned_rad) + 1) - memory.heading_rad
    return bool(np.max(np.abs(turned_rad - lane_rad)) < AGREES_RAD)


def _braking(config: DriveConfig, speed_mps: float, first_m: float, count: int) -> FloatArray:
    """By how much (n,) the square of the speed [m^2/s^2] can fall over ``STEP_M`` after ``STEP_M``; it is followed with a lag."""
    ahead_m = first_m + STEP_M * np.arange(count, dtype=np.float64)
    falls: FloatArray = 2.0 * config.braking_mps2 * np.maximum(ahead_m - LAG_S * speed_mps, 0.0)
    return falls


def _wheels_mps(bends_1pm: FloatArray, bend_1pm: float, speed_mps: float, config: DriveConfig, vehicle: VehicleShape) -> float:
    """The highest speed now at which the wheels can be turned as the way wants, braking in time before where they turn fast."""
    angle = np.arctan(vehicle.wheelbase_m * np.concatenate([[bend_1pm], bends_1pm]))
    rate = np.abs(angle[SPAN:] - angle[:-SPAN]) / (SPAN * STEP_M)
    most = np.maximum(WHEEL_RATE_RADPS / np.maximum(rate, 1e-3), config.creep_mps)
    falls = _braking(config, speed_mps, 0.0, len(rate))
    return float(np.min(np.sqrt(most**2 + falls), initial=config.search_mps))


def _to_stop_m(turned_rad: np.ndarray, reading: RoadReading | None, vehicle: VehicleShape) -> float:
    """How far the bumper may go before the junction ahead, if one is seen: up to the stop line, or to where the border turns."""
    if reading is not None and reading.end is not LaneEnd.NOTHING and math.isfinite(reading.end_m):
        return reading.end_m - vehicle.front_m - 0.3
    corner = np.flatnonzero(np.abs(turned_rad) > CORNER_RAD)
    if len(corner) == 0:
        return math.inf
    return STEP_M * float(corner[0]) - vehicle.front_m - 2.0
