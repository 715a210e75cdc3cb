"""Manoeuvres at walking pace: the legs of a turn one after the other, and backing along the way that was driven.

A leg is driven with the wheels held, which are turned while the vehicle stands. How far it has come on an arc is told by the
angle that it has turned by, which the gyro measures better than the odometry's unit is known.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, Protocol

import numpy as np

from hippodrome.core.navigation.config import VehicleShape
from hippodrome.core.navigation.motion import Motion
from hippodrome.core.navigation.turning import Leg
from hippodrome.core.navigation.types import Command, DrivingState, Indicator, Radar
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray

SLOW_MPS: Final = 1.5  # of all of it
BRAKING_MPS2: Final = 0.6  # towards where the gear is changed: a hand's breadth counts
CREEP_MPS: Final = 0.3  # over the last hand's breadth
GAIN_1PS: Final = 2.0
MOST_MPS2: Final = 1.0
FIRM_MPS2: Final = -2.5
HOLD_MPS2: Final = -1.0
STANDS_MPS: Final = 0.05
THERE_M: Final = 0.06  # a leg is driven to within this
WHEELS_RAD: Final = 0.03  # of the angle that they are to have
KEPT_M: Final = 0.8  # from whom the radar sees ahead or behind
HELD_UP_S: Final = 3.0  # so long before somebody, a leg ends where it is
COMES_MPS, COMES_S, COMES_SHARE = 1.5, 3.5, 0.3  # who comes nearer so fast, and would be here so soon, is let pass; smoothed
JUMP_MPS: Final = 20.0  # a distance that changes faster is somebody else's
LETS_PASS_S: Final = 8.0  # .. for so long at each leg: those who come now see a vehicle that stands askew
CALM_M: Final = 25.0  # nobody who moves is nearer ..
LEAST_CALM_M: Final = 10.0  # on a busy street one goes at last when there is so much, ..
IMPATIENT_MPS: Final = 0.5  # .. for what is wanted shrinks as one waits
CALM_S: Final = 1.5  # .. for so long, before the vehicle goes across the road
LOOK_M: Final = 0.25  # beyond where it would stop, a leg is looked at as it is driven
MOST_LEGS: Final = 16  # of a turn, however often it is planned anew
BACK_MPS: Final = 1.2
DECAY_M: Final = 2.0  # over which an offset from the way back fades


@dataclass(frozen=True, slots=True, eq=False)
class Sensed:
    """What a manoeuvre is told of a step: the motion, the radar, the pose (3,) in the ground's map, and what has been driven."""

    motion: Motion
    radar: Radar
    pose: FloatArray
    distance_m: float
    turned_rad: float
    dt_s: float


class Manoeuvre(Protocol):
    """Something that is driven to its end, step by step."""

    failed: bool

    def step(self, now: Sensed, /) -> Command | None:
        """The next command; None once it is over, or has failed."""


class Turn:
    """Turns round.

    Args:
        replan: the legs from where the vehicle is, the first of them in a gear, 1 or -1; None where there is no room.
        is_free: whether a short leg from where the vehicle is stays clear of the borders; one that would not ends early.
        legs: those to begin with.
        state: said meanwhile.
        vehicle: its wheelbase.
    """

    def __init__(
        self,
        replan: Callable[[int], list[Leg] | None],
        is_free: Callable[[Leg], bool],
        legs: list[Leg],
        state: DrivingState,
        vehicle: VehicleShape,
    ) -> None:
        self.failed = False
        self._is_free, self._cut = is_free, False
        self._replan, self._legs, self._state, self._vehicle = replan, legs, state, vehicle
        self._indicator = Indicator.LEFT if sum(leg.turned_rad for leg in legs) > 0.0 else Indicator.RIGHT
        self._driven_m = self._turned_rad = self._calm_s = self._held_up_s = 0.0
        self._begun, self._count, self._waited_s = False, 0, 0.0
        self._moving_m, self._closing_mps, self._let_pass_s = math.inf, 0.0, 0.0

    def step(self, now: Sensed) -> Command | None:
        """The next command; None once the vehicle has turned round, or has failed to."""
        motion, radar, dt_s = now.motion, now.radar, now.dt_s
        self._see(radar, dt_s)
        if not self._begun:
            self._waited_s += dt_s
            calm_m = max(CALM_M - IMPATIENT_MPS * self._waited_s, LEAST_CALM_M)
            self._calm_s = self._calm_s + dt_s if radar.moving_m > calm_m and not radar.blind else 0.0
            self._begun = self._calm_s >= CALM_S
            return self._standing(motion.steering_rad, True, "waits until nobody is near, to turn round")
        self._driven_m, self._turned_rad = self._driven_m + now.distance_m, self._turned_rad + now.turned_rad
        leg, backs = self._legs[0], self._legs[0].length_m < 0.0
        wheel = math.atan(self._vehicle.wheelbase_m * leg.curvature_1pm)
        stands, rest_m = abs(motion.speed_mps) < STANDS_MPS, self._rest_m(leg)
        ahead = Leg(leg.curvature_1pm, math.copysign(LOOK_M + motion.speed_mps**2, leg.length_m))
        self._cut = self._cut or self._held_up_s > HELD_UP_S or (not stands and rest_m > LOOK_M and not self._is_free(ahead))
        if rest_m < THERE_M or self._cut:
            if not stands:
                return self._command(FIRM_MPS2, wheel, backs)
            return self._next(motion, backs)
        if stands and abs(motion.steering_rad - wheel) > WHEELS_RAD:
            return self._standing(wheel, backs, "turns round")
        if self._comes and self._let_pass_s < LETS_PASS_S:
            self._let_pass_s += dt_s
            stopped = self._standing(wheel, backs, "lets somebody pass, to turn round")
            return stopped if stands else replace(stopped, acceleration_mps2=FIRM_MPS2)
        gap_m = radar.gap_behind_m if backs else radar.gap_m
        self._held_up_s = self._held_up_s + dt_s if stands and gap_m < 2.0 * KEPT_M else 0.0
        return self._command(pedal_mps2(abs(motion.speed_mps), min(rest_m, gap_m - KEPT_M)), wheel, backs)

    def _see(self, radar: Radar, dt_s: float) -> None:
        """Note how fast the nearest of those who move comes nearer."""
        seen = math.isfinite(self._moving_m) and math.isfinite(radar.moving_m)
        rate = (self._moving_m - radar.moving_m) / dt_s if seen else math.inf
        self._closing_mps = self._closing_mps + COMES_SHARE * (rate - self._closing_mps) if abs(rate) < JUMP_MPS else 0.0
        self._moving_m = radar.moving_m

    @property
    def _comes(self) -> bool:
        """Whether somebody will be here soon, who may not see that the vehicle is about to go across the road."""
        return self._closing_mps > COMES_MPS and self._moving_m < COMES_S * self._closing_mps

    def _rest_m(self, leg: Leg) -> float:
        """What is left of a leg."""
        if leg.curvature_1pm == 0.0:
            return abs(leg.length_m) - abs(self._driven_m)
        return (abs(leg.turned_rad) - abs(self._turned_rad)) / abs(leg.curvature_1pm)

    def _next(self, motion: Motion, backs: bool) -> Command | None:
        """Begin the next leg, planned from where the vehicle is."""
        rest, gear = self._legs[1:], 1 if backs else -1
        self._count += 1
        cut, straight = self._cut, self._legs[0].curvature_1pm == 0.0
        self._driven_m = self._turned_rad = self._held_up_s = self._let_pass_s = 0.0
        self._cut = False
        if not rest and not cut:
            return None
        self._legs = (rest if straight and not cut else self._replan(gear)) or rest
        self.failed = not self._legs or self._count >= MOST_LEGS
        return None if self.failed else self._standing(motion.steering_rad, gear < 0, "turns round")

    def _standing(self, wheel_rad: float, reverse: bool, reason: str) -> Command:
        return Command(HOLD_MPS2, wheel_rad, self._indicator, self._state, reason, reverse)

    def _command(self, acceleration_mps2: float, wheel_rad: float, reverse: bool) -> Command:
        return Command(acceleration_mps2, wheel_rad, self._indicator, self._state, "turns round", reverse)


class BackOff:
    """Backs along the way that was driven.

    Args:
        trail: poses (n, 3) of that way in the ground's axes, the last one where the vehicle is.
        length_m: how far.
        state: said meanwhile.
        vehicle: its wheelbase and turning circle.
    """

    def __init__(self, trail: FloatArray, length_m: float, state: DrivingState, vehicle: VehicleShape) -> None:
        self.failed = False
        self._trail, self._rest_m, self._state, self._vehicle = trail, length_m, state, vehicle
        self._held_up_s = 0.0

    def step(self, now: Sensed) -> Command | None:
        """The next command; None once it is far enough back, or where the way ends or somebody stands on it."""
        radar, pose = now.radar, now.pose
        self._rest_m += now.distance_m
        near = int(np.argmin(np.hypot(*(self._trail[:, :2] - pose[:2]).T)))
        speed = abs(now.motion.speed_mps)
        wheel = math.atan(self._vehicle.wheelbase_m * self._curvature_1pm(pose, near))
        wheel = min(max(wheel, -self._vehicle.max_steering_rad), self._vehicle.max_steering_rad)
        rest_m = 0.0 if near == 0 else self._rest_m
        self._held_up_s = self._held_up_s + now.dt_s if speed < STANDS_MPS and radar.gap_behind_m < 2.0 * KEPT_M else 0.0
        self.failed = self._held_up_s > HELD_UP_S
        if rest_m < THERE_M or self.failed:
            if speed < STANDS_MPS:
                return None
            return Command(FIRM_MPS2, wheel, Indicator.STRAIGHT, self._state, "backs off", True)
        accel = pedal_mps2(speed, min(rest_m, radar.gap_behind_m - KEPT_M), BACK_MPS)
        return Command(accel, wheel, Indicator.STRAIGHT, self._state, "backs off", True)

    def _curvature_1pm(self, pose: FloatArray, near: int) -> float:
        """kappa = kappa_path - e / l^2 + 2 psi / l: the path follower's law, driven backwards (Samson 1995)."""
        x, y, heading = (float(value) for value in self._trail[near])
        before = [float(value) for value in self._trail[max(near - 2, 0)]]
        apart_m = math.hypot(x - before[0], y - before[1])
        bend = float(wrap_compiled(heading - before[2])) / apart_m if apart_m > 0.1 else 0.0
        offset_m = float(math.cos(heading) * (pose[1] - y) - math.sin(heading) * (pose[0] - x))
        turned = float(wrap_compiled(float(pose[2]) - heading))
        return bend - min(max(offset_m, -0.5), 0.5) / DECAY_M**2 + 2.0 * turned / DECAY_M


def pedal_mps2(speed_mps: float, rest_m: float, most_mps: float = SLOW_MPS) -> float:
    """The acceleration along the gear that stops within a distance, at walking pace."""
    wanted = math.sqrt(2.0 * BRAKING_MPS2 * max(rest_m, 0.0))
    wanted = min(max(wanted, CREEP_MPS if rest_m > THERE_M else 0.0), most_mps)
    if wanted == 0.0 and speed_mps < STANDS_MPS:
        return HOLD_MPS2
    return min(max(GAIN_1PS * (wanted - speed_mps), FIRM_MPS2), MOST_MPS2)
