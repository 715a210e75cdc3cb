"""The vehicle's driver assistance: the gap ahead in the swept path, whether the way is free, the lamp. No map goes in."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from hippodrome.core.navigation.types import Lamp, Radar
from hippodrome.core.types import FloatArray
from hippodrome.sim.ego_spec import LENGTH_M, REAR_AXLE_TO_FRONT_M
from hippodrome.sim.loop.car import CENTRE_AHEAD_M, WIDTH_M
from hippodrome.sim.loop.contact import corners_m
from hippodrome.sim.loop.users import Users

REACH_M: Final = 100.0  # of an ordinary 77 GHz radar, in town
BESIDE_M: Final = 0.3  # so much room is kept on each side of the ego's own swept path
STANDING_BESIDE_M: Final = 0.05  # and so much to who stands, where the ego hardly moves: both would wait for each other
SLOW_MPS, FAST_MPS = 0.5, 2.0  # up to where it hardly moves; the room grows up to where it is fast: its wheels turn meanwhile
SWING_BESIDE_M: Final = -0.1  # and so much where a corner swings out beyond that: in bends one passes others by a hand
MOST_TURN_RAD: Final = 0.5 * math.pi  # the swept path ends where it has turned by a right angle
GAP_NOISE_M: Final = 0.1  # standard deviations of a measurement
SPEED_NOISE_MPS: Final = 0.1
BEHIND_REACH_M: Final = 20.0  # of what warns of those behind
AROUND_REACH_M: Final = 50.0  # and of those who come from any side, as rear cross traffic alert does
MOVES_MPS: Final = 0.3


def nearest_ahead(
    pose_m: tuple[float, float, float],
    curvature_1pm: float,
    users: Users,
    middle_m: float = CENTRE_AHEAD_M,
    bumper_m: float = REAR_AXLE_TO_FRONT_M,
    tail_m: float = LENGTH_M - REAR_AXLE_TO_FRONT_M,
    own_mps: float = math.inf,
) -> tuple[float, float]:
    """Gap [m] from the front bumper along the swept path to the nearest road user, and that one's speed along it.

    The swept path is the band that the body covers if the steering stays as it is: an arc of the rear axle's curvature. Users
    are taken by points round their outlines. Without one in reach the gap is ``inf``. The body's middle and its bumper lie so far
    ahead of the rear axle, and its other end so far behind it. The corners on the outside of a bend swing out beyond the band of
    the rear axle, of a car with its wheels at full lock by more than a metre.
    """
    if len(users.names) == 0:
        return math.inf, 0.0
    points = outline_m(corners_m(users.poses_m, users.sizes_m))
    dx, dy = points[..., 0] - pose_m[0], points[..., 1] - pose_m[1]
    cos, sin = math.cos(pose_m[2]), math.sin(pose_m[2])
    forward, left = cos * dx + sin * dy, cos * dy - sin * dx
    far = min(REACH_M, MOST_TURN_RAD / max(abs(curvature_1pm), 1e-6))  # who steers to and fro does not drive in a circle
    if abs(curvature_1pm) < 1e-4:
        along, aside, swung = forward, left, np.full(forward.shape, -np.inf)
    else:  # the circle about (0, 1 / curvature): distance along it, and from it
        radius = 1.0 / curvature_1pm
        along = np.arctan2(forward, (radius - left) * np.sign(radius)) * abs(radius)
        apart = np.maximum(np.hypot(forward, radius - left), 1e-9)
        aside = radius - np.sign(radius) * apart
        swung = along - _outer_m(apart, abs(radius), bumper_m, tail_m)
    inside = (np.abs(aside) <= 0.5 * WIDTH_M + _beside_m(users, own_mps)) & (along > middle_m) & (along < far + bumper_m)
    swings = ~inside & (swung > 0.0) & (swung < far)
    along, inside = np.where(swings, swung + bumper_m, along), inside | swings
    if not inside.any():
        return math.inf, 0.0
    along = np.where(inside, along, np.inf)
    user = int(np.argmin(along.min(axis=1)))
    place = float(along[user].min())
    direction = pose_m[2] + curvature_1pm * place
    speed = float(users.speed_mps[user]) * math.cos(float(users.poses_m[user, 2]) - direction)
    return max(place - bumper_m, 0.0), speed


def _beside_m(users: Users, own_mps: float) -> FloatArray:
    """The room (k, 1) that is kept beside the ego's swept path, to each user."""
    hurry = min(max((own_mps - SLOW_MPS) / (FAST_MPS - SLOW_MPS), 0.0), 1.0)
    to_standing_m = STANDING_BESIDE_M + hurry * (BESIDE_M - STANDING_BESIDE_M)
    room_m: FloatArray = np.where(users.speed_mps > MOVES_MPS, BESIDE_M, to_standing_m)[:, None]
    return room_m


def _outer_m(apart_m: FloatArray, radius_m: float, bumper_m: float, tail_m: float) -> FloatArray:
    """How far ahead of the rear axle, along its circle, the body reaches on circles that only its outer corners sweep.

    On the circle of radius r about the centre of the bend, the bumper ends at the angle asin(bumper / r). Where r is larger
    than what the bumper's corner sweeps, only the other end reaches out so far; its side begins at -acos(outer side / r). The
    result is ``inf`` on circles that the body does not touch.

    Args:
        apart_m: radii of the circles.
        radius_m: of the rear axle's circle.
        bumper_m: from the rear axle to the end of the body in the direction of the drive.
        tail_m: to the other end.
    """
    side_m = radius_m + 0.5 * WIDTH_M
    front_m, rear_m = (math.hypot(side_m, end_m) + SWING_BESIDE_M for end_m in (bumper_m, tail_m))
    by_bumper = np.arcsin(np.minimum(bumper_m / apart_m, 1.0))
    by_tail = -np.arccos(np.minimum(side_m / apart_m, 1.0))
    angle = np.where(apart_m <= front_m, by_bumper, np.where(apart_m <= rear_m, by_tail, np.inf))
    return np.where(apart_m > side_m, radius_m * angle, np.inf)


def nearest_behind_m(pose_m: tuple[float, float, float], curvature_1pm: float, users: Users) -> float:
    """Gap [m] from the rear bumper along what the body sweeps backwards to the nearest road user; ``inf`` without one."""
    turned = pose_m[0], pose_m[1], pose_m[2] + math.pi  # seen from behind, left is right
    rear_m = LENGTH_M - REAR_AXLE_TO_FRONT_M
    gap_m, _ = nearest_ahead(turned, -curvature_1pm, users, -CENTRE_AHEAD_M, rear_m, REAR_AXLE_TO_FRONT_M)
    return gap_m


def nearest_moving_m(pose_m: tuple[float, float, float], users: Users) -> float:
    """Distance [m] from the ego's body to the nearest road user that moves; ``inf`` without one."""
    moving = users.speed_mps > MOVES_MPS if len(users.names) else np.zeros(0, dtype=np.bool_)
    if not moving.any():
        return math.inf
    apart = outline_m(corners_m(users.poses_m, users.sizes_m)[moving]) - np.array(pose_m[:2])
    cos, sin = math.cos(pose_m[2]), math.sin(pose_m[2])
    ahead = np.abs(cos * apart[..., 0] + sin * apart[..., 1] - CENTRE_AHEAD_M) - 0.5 * LENGTH_M
    aside = np.abs(cos * apart[..., 1] - sin * apart[..., 0]) - 0.5 * WIDTH_M
    return float(np.hypot(np.maximum(ahead, 0.0), np.maximum(aside, 0.0)).min())


def outline_m(corners_m: FloatArray) -> FloatArray:
    """Points (k, 20, 2) round boxes (k, 4, 2)."""
    following = np.roll(corners_m, -1, axis=1)
    share = np.linspace(0.0, 1.0, 5, endpoint=False)[:, None]
    points = corners_m[:, :, None] + share * (following - corners_m)[:, :, None]
    return points.reshape(len(corners_m), -1, 2)


def measured(gap_m: float, speed_mps: float, own_mps: float, way_is_free: bool, lamp: Lamp, rng: np.random.Generator) -> Radar:
    """What the sensor says: noise on gap and speed; numbers are drawn at each step, so that one more car shifts none."""
    gap_noise, speed_noise = rng.standard_normal(2)
    if not gap_m < REACH_M:
        return Radar(way_is_free=way_is_free, lamp=lamp)
    gap = max(gap_m + GAP_NOISE_M * float(gap_noise), 0.0)
    return Radar(gap, own_mps - speed_mps + SPEED_NOISE_MPS * float(speed_noise), way_is_free, lamp)


def with_surroundings(
    radar: Radar, pose_m: tuple[float, float, float], curvature_1pm: float, users: Users, rng: np.random.Generator
) -> Radar:
    """The same with what the sensors behind and around say, whose noise is drawn apart, so that it changes no other number."""
    behind_noise, around_noise = rng.standard_normal(2)
    behind_m, moving_m = nearest_behind_m(pose_m, curvature_1pm, users), nearest_moving_m(pose_m, users)
    behind = max(behind_m + GAP_NOISE_M * float(behind_noise), 0.0) if behind_m < BEHIND_REACH_M else math.inf
    around = max(moving_m + GAP_NOISE_M * float(around_noise), 0.0) if moving_m < AROUND_REACH_M else math.inf
    return replace(radar, gap_behind_m=behind, moving_m=around)
