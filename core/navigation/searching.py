"""Driving without a fix: on sight, along the border on the own side of the road."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hippodrome.core.navigation.config import DriveConfig, VehicleShape
from hippodrome.core.navigation.course import indicated
from hippodrome.core.navigation.junctions import gate_speed_mps
from hippodrome.core.navigation.sight import STEP_M, Ground
from hippodrome.core.navigation.steering import lane_curvature_1pm
from hippodrome.core.navigation.types import Indicator, Radar
from hippodrome.core.reading.types import LaneEnd, RoadReading

BESIDE_M = 1.35  # from the edge line to the middle of a lane of 3.2 m whose line is painted inside of the border
LOOK_M = 14.0  # of the way ahead
CORNER_RAD = 0.3  # a way that has turned so much goes round a corner
STRAIGHT_1PM = 0.04  # a straighter way may be steered by the lane that is read
BLIND_M = 5.0  # the way is driven so far without a border beside it, at walking pace
SURE_M2 = 0.04  # variance of an offset in the lane that is better than the border's


@dataclass(frozen=True, slots=True)
class SearchStep:
    """How to go on."""

    curvature_1pm: float
    speed_mps: float
    indicator: Indicator
    reason: str


def search_step(
    ground: Ground, reading: RoadReading | None, radar: Radar, side: float, speed_mps: float,
    config: DriveConfig, vehicle: VehicleShape,
) -> SearchStep:  # fmt: skip
    """The next step along the border on the own ``side``: -1 right, +1 left."""
    way = ground.way(side, BESIDE_M, LOOK_M)
    bends, turned = way.curvature_1pm, way.heading_rad - way.heading_rad[0]
    near = min(int((1.0 + 0.35 * speed_mps) / STEP_M), len(bends) - 1)
    curvature = float(bends[near])
    straight = bool(np.max(np.abs(bends[: near + 8])) < STRAIGHT_1PM)
    if reading is not None and straight and reading.offset_variance_m2 < SURE_M2 and math.isfinite(reading.heading_rad):
        bend = reading.curvature_1pm if math.isfinite(reading.curvature_1pm) else 0.0
        curvature = lane_curvature_1pm(bend, reading.offset_m, reading.heading_rad, speed_mps, config)
    wanted, reason = config.search_mps, "looks for known ground"
    ahead = np.abs(bends[: int(8.0 / STEP_M)])
    braking = 2.0 * config.braking_mps2 * STEP_M * np.arange(len(ahead))
    wanted = min(wanted, float(np.min(np.sqrt(config.lateral_mps2 / np.maximum(ahead, 1e-3) + braking))))
    if not np.any(way.seen[: int(BLIND_M / STEP_M)]):
        wanted, reason = min(wanted, config.creep_mps), "sees no border of the road"
    to_stop_m = _to_stop_m(turned, reading, vehicle)
    slowed, why = gate_speed_mps(to_stop_m, speed_mps, radar, config)
    if not math.isfinite(to_stop_m) and not (radar.way_is_free and radar.lamp.value < 2):
        slowed, why = config.search_mps / 2.0, "a junction is ahead"
    if slowed < wanted:
        wanted, reason = slowed, why
    return SearchStep(curvature, wanted, indicated(float(turned[-1])), reason)


def _to_stop_m(turned_rad: np.ndarray, reading: RoadReading | None, vehicle: VehicleShape) -> float:  # type: ignore[type-arg]
    """How far the bumper may go before the junction ahead, if one is seen: up to the stop line, or to where the border turns."""
    if reading is not None and reading.end is not LaneEnd.NOTHING and math.isfinite(reading.end_m):
        return reading.end_m - vehicle.front_m - 0.3
    corner = np.flatnonzero(np.abs(turned_rad) > CORNER_RAD)
    if len(corner) == 0:
        return math.inf
    return STEP_M * float(corner[0]) - vehicle.front_m - 2.0
