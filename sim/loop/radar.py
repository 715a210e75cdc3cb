"""The vehicle's driver assistance: the gap ahead in the swept path, whether the way is free, the lamp. No map goes in."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from hippodrome.core.navigation.types import Lamp, Radar
from hippodrome.core.types import FloatArray
from hippodrome.sim.ego_spec import REAR_AXLE_TO_FRONT_M
from hippodrome.sim.loop.car import CENTRE_AHEAD_M, WIDTH_M
from hippodrome.sim.loop.contact import corners_m
from hippodrome.sim.loop.users import Users

REACH_M: Final = 100.0  # of an ordinary 77 GHz radar, in town
BESIDE_M: Final = 0.3  # so much room is kept on each side of the ego's own swept path
MOST_TURN_RAD: Final = 0.5 * math.pi  # the swept path ends where it has turned by a right angle
GAP_NOISE_M: Final = 0.1  # standard deviations of a measurement
SPEED_NOISE_MPS: Final = 0.1


def nearest_ahead(pose_m: tuple[float, float, float], curvature_1pm: float, users: Users) -> tuple[float, float]:
    """Gap [m] from the front bumper along the swept path to the nearest road user, and that one's speed along it.

    The swept path is the band that the body covers if the steering stays as it is: an arc of the rear axle's curvature. Users
    are taken by points round their outlines. Without one in reach the gap is ``inf``.
    """
    if len(users.names) == 0:
        return math.inf, 0.0
    points = _outline_m(corners_m(users.poses_m, users.sizes_m))
    dx, dy = points[..., 0] - pose_m[0], points[..., 1] - pose_m[1]
    cos, sin = math.cos(pose_m[2]), math.sin(pose_m[2])
    forward, left = cos * dx + sin * dy, cos * dy - sin * dx
    if abs(curvature_1pm) < 1e-4:
        along, aside = forward, left
    else:  # the circle about (0, 1 / curvature): distance along it, and from it
        radius = 1.0 / curvature_1pm
        along = np.arctan2(forward, (radius - left) * np.sign(radius)) * abs(radius)
        aside = radius - np.sign(radius) * np.hypot(forward, radius - left)
    far = min(REACH_M, MOST_TURN_RAD / max(abs(curvature_1pm), 1e-6))  # who steers to and fro does not drive in a circle
    inside = (np.abs(aside) <= 0.5 * WIDTH_M + BESIDE_M) & (along > CENTRE_AHEAD_M) & (along < far + REAR_AXLE_TO_FRONT_M)
    if not inside.any():
        return math.inf, 0.0
    along = np.where(inside, along, np.inf)
    user = int(np.argmin(along.min(axis=1)))
    place = float(along[user].min())
    direction = pose_m[2] + curvature_1pm * place
    speed = float(users.speed_mps[user]) * math.cos(float(users.poses_m[user, 2]) - direction)
    return max(place - REAR_AXLE_TO_FRONT_M, 0.0), speed


def _outline_m(corners_m: FloatArray) -> FloatArray:
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
