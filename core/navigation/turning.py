"""Turning round in a street that is narrower than the turning circle: to and fro at full lock, from border to border.

The legs are arcs of circles of the least radius, which is what the shortest ways of a car that can reverse consist of (Reeds and
Shepp, "Optimal paths for a car that goes both forwards and backwards", Pacific Journal of Mathematics 145, 1990). How far each
goes is limited by the paving, and found by a beam search over the points where the gear is changed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Final, TypeAlias

import numpy as np

from hippodrome.core.navigation.config import VehicleShape
from hippodrome.core.roads.network import BoolArray
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray

REAR_M: Final = 0.9  # from the rear axle to the rear bumper
HALF_WIDTH_M: Final = 0.9  # of the body
STEP_M: Final = 0.1  # along a leg
LONGEST_M: Final = 12.0  # of a leg: more than half of the turning circle
SHORTEST_M: Final = 0.4  # a shorter leg is none
LOCK_SHARE: Final = 0.97  # of the turning circle's curvature: the rest is for corrections
BEAM: Final = 60  # kept after each leg
GIVES_M: Final = 0.02  # who has less room than is to be kept may not have less by more than this
MOST_LEGS: Final = 9
SHARES: Final = (1.0, 0.8, 0.6, 0.4, 0.2)  # of the longest leg that there is room for
GEAR_S: Final = 3.0  # what changing the gear costs
OFFSET_S: Final = 3.0  # and what a metre beside the line at the end does
LEFT_S: Final = 6.0  # what a radian that is left to turn will cost, for choosing the states that are kept
LEG_MPS: Final = 1.0  # and what metres cost
SETTLED_M: Final = 1.6  # who ends a turn nearer to the line than this follows it from there
BACK_OFF_M: Final = (0.0, 2.0, 4.0, 6.0)  # what is tried of straight backing before the turn

Room: TypeAlias = Callable[[FloatArray], FloatArray]
"""How far each of some points (n, 2) is from the nearest border, in metres; negative beyond it."""


@dataclass(frozen=True, slots=True)
class Leg:
    """A part of a turn in one gear, with the wheels held.

    Args:
        curvature_1pm: left positive.
        length_m: negative backwards.
    """

    curvature_1pm: float
    length_m: float

    @property
    def turned_rad(self) -> float:
        """By how much the heading changes."""
        return self.curvature_1pm * self.length_m


@dataclass(frozen=True, slots=True)
class Clearance:
    """How far wheels and body must stay from the borders; a bumper may stand a little over a kerb, a wheel may not."""

    wheels_m: float = 0.15
    body_m: float = -0.25


@dataclass(frozen=True, slots=True)
class _State:
    """Where a beginning of a turn leads."""

    pose: tuple[float, float, float]
    left_rad: float  # to turn until the new direction
    legs: tuple[Leg, ...]
    cost: float


def poses_along(pose: Sequence[float], leg: Leg, step_m: float = STEP_M) -> FloatArray:
    """Poses (n, 3) of the rear axle along a leg, the first of them ``pose``: a circle, driven forwards or backwards."""
    count = max(math.ceil(abs(leg.length_m) / step_m), 1)
    s = np.linspace(0.0, leg.length_m, count + 1)
    x, y, heading = pose
    turned = leg.curvature_1pm * s
    chord = np.where(np.abs(turned) > 1e-9, s * np.sinc(0.5 * turned / np.pi), s)
    direction = heading + 0.5 * turned
    return np.stack([x + chord * np.cos(direction), y + chord * np.sin(direction), heading + turned], axis=1)


def is_clear(poses: FloatArray, room: Room, vehicle: VehicleShape, clearance: Clearance) -> BoolArray:
    """Which of the poses (n, 3) keep wheels and body clear of the borders."""
    wheels_m, body_m = rooms_m(poses, room, vehicle)
    clear: BoolArray = (wheels_m >= clearance.wheels_m) & (body_m >= clearance.body_m)
    return clear


def rooms_m(poses: FloatArray, room: Room, vehicle: VehicleShape) -> tuple[FloatArray, FloatArray]:
    """The least room (n,) of wheels and of body at each of the poses (n, 3)."""
    wheels = _points(poses, [0.0, vehicle.wheelbase_m], vehicle.half_track_m)
    body = _points(poses, [-REAR_M, 0.5 * vehicle.front_m, vehicle.front_m], HALF_WIDTH_M)
    points = np.concatenate([wheels, body], axis=1)
    found = room(points.reshape(-1, 2)).reshape(points.shape[:2])
    return found[:, : wheels.shape[1]].min(axis=1), found[:, wheels.shape[1] :].min(axis=1)


def _points(poses: FloatArray, ahead_m: Sequence[float], aside_m: float) -> FloatArray:
    """Points (n, k, 2) on either side of the middle line of the vehicle."""
    x, y, heading = (poses[:, k, None] for k in range(3))
    ahead, aside = (np.array(column) for column in zip(*product(ahead_m, (-aside_m, aside_m)), strict=True))
    cos, sin = np.cos(heading), np.sin(heading)
    return np.stack([x + cos * ahead - sin * aside, y + sin * ahead + cos * aside], axis=2)


def plan_turn(
    pose: Sequence[float],
    line: Sequence[float],
    room: Room,
    vehicle: VehicleShape,
    clearance: Clearance = Clearance(),
    first: int = 0,
) -> list[Leg] | None:
    """The legs that turn a vehicle round; None where there is no room for it.

    Args:
        pose: of the rear axle.
        line: a place on the line to follow afterwards, and its direction.
        room: how far points are from the borders.
        vehicle: its size and its turning circle.
        clearance: what is to be kept of that.
        first: the gear of the first leg where a turn is under way already, 1 or -1; 0: it begins, perhaps with backing.
    """
    lock = LOCK_SHARE * math.tan(vehicle.max_steering_rad) / vehicle.wheelbase_m
    to_turn = float(wrap_compiled(float(line[2] - pose[2])))
    side = math.copysign(1.0, _aside_m(pose, line) or 1.0)
    if abs(to_turn) > 0.75 * math.pi and to_turn * side < 0.0:  # round towards the line, whatever the angle is short of pi
        to_turn += 2.0 * math.pi * side
    begin = (float(pose[0]), float(pose[1]), float(pose[2]))
    best: _State | None = None
    for back_m, gear in product(BACK_OFF_M if first == 0 else (0.0,), (1, -1) if first == 0 else (first,)):
        state = _State(begin, to_turn, (), 0.0)
        if back_m > 0.0:
            leg = Leg(0.0, -back_m)
            poses = poses_along(begin, leg)
            if gear < 0 or not is_clear(poses[1:], room, vehicle, clearance).all():
                continue
            state = _State(tuple(poses[-1].tolist()), to_turn, (leg,), GEAR_S + back_m / LEG_MPS)
        found = _search(state, gear, lock, line, room, vehicle, clearance)
        if found is not None and (best is None or found.cost < best.cost):
            best = found
    return None if best is None else list(best.legs)


def _search(
    begin: _State, gear: int, lock: float, line: Sequence[float], room: Room, vehicle: VehicleShape, clearance: Clearance
) -> _State | None:
    """The cheapest turn of all that change the gear where the paving ends, or somewhat before."""
    states, best = [begin], None
    for _ in range(MOST_LEGS):
        onward: list[_State] = []
        for state in states:
            for new in _continued(state, gear, lock, room, vehicle, clearance):
                if best is not None and new.cost >= best.cost:
                    continue
                if abs(new.left_rad) > 1e-6:
                    onward.append(new)
                    continue
                off_m = abs(_aside_m(new.pose, line))
                done = replace(new, cost=new.cost + OFFSET_S * off_m)
                if off_m < SETTLED_M and (best is None or done.cost < best.cost):
                    best = done
        states = sorted(onward, key=lambda one: one.cost + LEFT_S * abs(one.left_rad))[:BEAM]
        gear = -gear
        if not states:
            break
    return best


def _continued(state: _State, gear: int, lock: float, room: Room, vehicle: VehicleShape, clearance: Clearance) -> list[_State]:
    """The state after a leg more, of several lengths."""
    curvature = gear * math.copysign(lock, state.left_rad)  # backwards the wheels are held to the other side
    whole_m = min(abs(state.left_rad) / lock, LONGEST_M)
    poses = poses_along(state.pose, Leg(curvature, gear * whole_m))
    wheels_m, body_m = rooms_m(poses, room, vehicle)
    least_m = min(clearance.wheels_m, wheels_m[0] - GIVES_M), min(clearance.body_m, body_m[0] - GIVES_M)
    blocked = np.flatnonzero((wheels_m[1:] < least_m[0]) | (body_m[1:] < least_m[1]))
    free = int(blocked[0]) if len(blocked) else len(poses) - 1
    step_m = whole_m / (len(poses) - 1)
    found = []
    for share in SHARES:
        rows = round(share * free)
        if rows * step_m < min(SHORTEST_M, whole_m):
            continue
        leg = Leg(curvature, gear * rows * step_m)
        left = state.left_rad - leg.turned_rad if rows < len(poses) - 1 else 0.0
        cost = state.cost + GEAR_S + abs(leg.length_m) / LEG_MPS
        found.append(_State(tuple(poses[rows].tolist()), left, (*state.legs, leg), cost))
    return found


def _aside_m(pose: Sequence[float], line: Sequence[float]) -> float:
    """How far to the left of a line a pose is, seen along the line; for who drives against it, the line lies to the left then."""
    return math.cos(line[2]) * (pose[1] - line[1]) - math.sin(line[2]) * (pose[0] - line[0])
