"""The ego's body: highway-env's bicycle under commands, with the limits of a real car."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray
from hippodrome.sim.ego import MAX_ACCEL_MPS2, MAX_BRAKE_MPS2, MAX_STEERING_RAD, MAX_STEERING_RATE_RADPS, EgoCar
from hippodrome.sim.ego_spec import LENGTH_M, REAR_AXLE_TO_FRONT_M, WHEELBASE_M

WIDTH_M: Final = 1.8  # a compact car, as SUMO is told
WHEEL_ASIDE_M: Final = 0.8  # from the middle to the outer face of a tyre
CAR_STEP_S: Final = 0.05  # of the bicycle; two steps to one of the loop
GRIP_MPS2: Final = 8.0  # of tyres on dry asphalt, sideways: beyond it the car goes straighter than it is steered
BACKWARDS_MPS: Final = 5.0  # the reverse gear is a short one, and who looks over the shoulder drives no faster
CENTRE_AHEAD_M: Final = REAR_AXLE_TO_FRONT_M - 0.5 * LENGTH_M  # of the body, before the rear axle


class Car:
    """The bicycle. Commands act at once but for the limits: steering rate, grip, engine, brakes, and the gear's direction."""

    def __init__(self, x_m: float, y_m: float, heading_rad: float) -> None:
        half = 0.5 * WHEELBASE_M
        centre = (x_m + half * math.cos(heading_rad), y_m + half * math.sin(heading_rad))
        self._body = EgoCar(None, centre, heading_rad, 0.0)
        self.steering_rad = 0.0

    def drive(self, acceleration_mps2: float, steering_rad: float, duration_s: float, reverse: bool = False) -> None:
        """Carries a command out over ``duration_s``, in steps of ``CAR_STEP_S``.

        Accelerations are along the gear's direction: positive ones speed the car up, backwards in reverse gear, and negative ones
        brake it, down to standing. Who asks for a gear while the car rolls the other way brakes it first, with what the
        acceleration says, whatever its sign; it goes on in that gear once it has stood.
        """
        for _ in range(max(round(duration_s / CAR_STEP_S), 1)):
            wanted = min(max(steering_rad, -MAX_STEERING_RAD), MAX_STEERING_RAD)
            most = MAX_STEERING_RATE_RADPS * CAR_STEP_S
            self.steering_rad += min(max(wanted - self.steering_rad, -most), most)
            grip = math.atan(WHEELBASE_M * GRIP_MPS2 / max(abs(self._body.speed), 0.1) ** 2)
            accel = _pedals_mps2(self._body.speed, acceleration_mps2, reverse)
            self._body.act({"steering": min(max(self.steering_rad, -grip), grip), "acceleration": accel})
            self._body.step(CAR_STEP_S)

    @property
    def pose_m(self) -> tuple[float, float, float]:
        """Rear axle, heading in (-pi, pi]."""
        x, y = self._body.rear_axle_m
        return float(x), float(y), float(wrap_compiled(self._body.heading))

    @property
    def heading_rad(self) -> float:
        """Heading, not wrapped."""
        return float(self._body.heading)

    @property
    def speed_mps(self) -> float:
        """Of the rear axle, negative backwards."""
        return float(self._body.speed * math.cos(math.atan(0.5 * math.tan(self.steering_rad))))

    @property
    def curvature_1pm(self) -> float:
        """Of the rear axle's way, as the road wheels stand."""
        return math.tan(self.steering_rad) / WHEELBASE_M

    def halt(self) -> None:
        """Takes the speed away, as running into something does."""
        self._body.speed = 0.0


def _pedals_mps2(speed_mps: float, acceleration_mps2: float, reverse: bool) -> float:
    """What the pedals do to the speed over the next ``CAR_STEP_S``, forwards positive."""
    gear = -1.0 if reverse else 1.0
    along = gear * speed_mps
    if along < 0.0:
        return gear * min(abs(acceleration_mps2), MAX_BRAKE_MPS2, -along / CAR_STEP_S)
    accel = min(max(acceleration_mps2, -MAX_BRAKE_MPS2), MAX_ACCEL_MPS2)
    if reverse:
        accel = min(accel, max(BACKWARDS_MPS - along, 0.0) / CAR_STEP_S)
    return gear * max(accel, -along / CAR_STEP_S)


def travelled_m(before_m: tuple[float, float, float], after_m: tuple[float, float, float]) -> float:
    """The way of the rear axle from one pose to the next, negative backwards."""
    dx, dy = after_m[0] - before_m[0], after_m[1] - before_m[1]
    backwards = math.cos(before_m[2]) * dx + math.sin(before_m[2]) * dy < 0.0
    return -math.hypot(dx, dy) if backwards else math.hypot(dx, dy)


def ahead_of(pose_m: tuple[float, float, float], forward_m: float, left_m: float = 0.0) -> tuple[float, float]:
    """A point of the vehicle in the network frame."""
    cos, sin = math.cos(pose_m[2]), math.sin(pose_m[2])
    return pose_m[0] + forward_m * cos - left_m * sin, pose_m[1] + forward_m * sin + left_m * cos


def wheels_m(pose_m: tuple[float, float, float]) -> FloatArray:
    """Where the outer faces of the tyres stand (4, 2): rear left, rear right, front left, front right."""
    places = ((0.0, 1.0), (0.0, -1.0), (WHEELBASE_M, 1.0), (WHEELBASE_M, -1.0))
    return np.array([ahead_of(pose_m, forward, side * WHEEL_ASIDE_M) for forward, side in places])
