"""Where the ego stands: on which lanes, how well in its lane, and with which wheels on the road."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from hippodrome.sim.ego_spec import REAR_AXLE_TO_FRONT_M, WHEELBASE_M
from hippodrome.sim.loop.car import CENTRE_AHEAD_M, ahead_of, wheels_m
from hippodrome.sim.loop.ground import Ground, Near

AGAINST_RAD: Final = math.radians(120.0)  # a lane that runs at more than this to the vehicle runs against it
FAR_OFF_M: Final = 9.0  # said of a wheel that has no lane within the index's reach
REAR, FRONT, WHEELS, MIDDLE = 0, 1, slice(2, 6), 6  # rows of the points that are looked up


@dataclass(frozen=True, slots=True, eq=False)
class Footing:
    """What ``stand`` found; lengths as in ``Truth``.

    Args:
        lane: that the rear axle is on, -1 off the road.
        front_lane: that the front bumper is on, -1 off the road.
        front_rest_m: from the front bumper to the end of its lane, as drawn; nan off the road.
        front_m: where SUMO is told that the front bumper is, and its heading: in the lane's middle and along it, as long as it
            is on the lane's strip, since SUMO goes by the nearest lane; else where it really is.
        strip_outside_m: how far the worst wheel is outside of the strips of these two lanes, also in junctions.
        against: the middle lies on a lane that runs against the ego and on none that runs with it.
        off_road: the middle lies on nothing that is paved for cars, and so does a wheel: seams between lanes are no edge.
    """

    lane: int
    front_lane: int
    position_m: float
    offset_m: float
    heading_error_rad: float
    front_rest_m: float
    front_m: tuple[float, float, float]
    wheel_outside_m: float
    off_paving_m: float
    strip_outside_m: float
    in_junction: bool
    against: bool
    off_road: bool


def stand(ground: Ground, pose_m: tuple[float, float, float], lane: int, front_lane: int, expected: int = -1) -> Footing:
    """Looks up the ego's points.

    Args:
        ground: of the town.
        pose_m: of the rear axle.
        lane: that the rear axle was on in the step before, -1 if none.
        front_lane: the same of the front bumper.
        expected: the first lane inside the junction ahead on the way that the indicator means, -1 if none.
    """
    heading, network = pose_m[2], ground.network
    wheels = wheels_m(pose_m)
    middle = ahead_of(pose_m, CENTRE_AHEAD_M)
    near = ground.near(np.array([pose_m[:2], ahead_of(pose_m, REAR_AXLE_TO_FRONT_M), *wheels, middle]))
    rear, front = (
        ground.lane_of(near, point, heading, before, expected) for point, before in ((REAR, lane), (FRONT, front_lane))
    )
    beyond = np.maximum(near.distance_m - 0.5 * network.width_m[near.lane], 0.0)
    inside = rear >= 0 and bool(network.is_internal[near.lane[rear]])
    off = beyond.min(axis=1, initial=FAR_OFF_M)
    aside = off[WHEELS]
    if rear >= 0 and not inside:
        own = np.isin(near.lane, ground.kin(int(near.lane[rear]))) | network.is_internal[near.lane]
        aside = np.where(own, beyond[WHEELS], np.inf).min(axis=1)
    if off.any() or aside.any():
        paved = ground.in_areas(np.array([*wheels, middle]))
        off[2:], aside = np.where(paved, 0.0, off[2:]), np.where(paved[:4], 0.0, aside)
    return Footing(
        lane=int(near.lane[rear]) if rear >= 0 else -1,
        front_lane=int(near.lane[front]) if front >= 0 else -1,
        position_m=float(near.position_m[REAR, rear]) if rear >= 0 else math.nan,
        offset_m=float(near.offset_m[REAR, rear]) if rear >= 0 else math.nan,
        heading_error_rad=_wrapped(heading - float(near.heading_rad[REAR, rear])) if rear >= 0 else math.nan,
        front_rest_m=_rest_m(ground, near, front),
        front_m=_front_m(ground, near, front, pose_m),
        wheel_outside_m=float(aside.max()),
        off_paving_m=float(off[WHEELS].max()),
        strip_outside_m=float(beyond[WHEELS][:, [rear, front]].min(axis=1).max()) if rear >= 0 and front >= 0 else FAR_OFF_M,
        in_junction=inside,
        against=_runs_against(ground, near, heading),
        off_road=bool(off[MIDDLE] > 0.0 and off[WHEELS].any()),
    )


def _runs_against(ground: Ground, near: Near, heading_rad: float) -> bool:
    """Whether the middle lies on a road's lane that runs against the heading, and on no lane that does not."""
    there = (near.distance_m[MIDDLE] <= 0.5 * ground.network.width_m[near.lane]) & ~near.beyond[MIDDLE]
    turn = np.abs((near.heading_rad[MIDDLE] - heading_rad + np.pi) % (2.0 * np.pi) - np.pi)
    against = turn > AGAINST_RAD
    return bool((there & against & ~ground.network.is_internal[near.lane]).any() and not (there & ~against).any())


def _rest_m(ground: Ground, near: Near, front: int) -> float:
    """From the front bumper to the end of its lane, which is in column ``front``; nan off the road."""
    return ground.lane_length_m(int(near.lane[front])) - float(near.position_m[FRONT, front]) if front >= 0 else math.nan


def _front_m(ground: Ground, near: Near, front: int, pose_m: tuple[float, float, float]) -> tuple[float, float, float]:
    """The front bumper as SUMO is told."""
    if front >= 0 and near.distance_m[FRONT, front] <= 0.5 * ground.network.width_m[near.lane[front]]:
        return ground.pose_at(int(near.lane[front]), float(near.position_m[FRONT, front]))
    return (*ahead_of(pose_m, REAR_AXLE_TO_FRONT_M), pose_m[2])


def _wrapped(angle_rad: float) -> float:
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def height_and_pitch(ground: Ground, pose_m: tuple[float, float, float], footing: Footing) -> tuple[float, ...]:
    """Height [m] of the road below the rear axle and pitch [rad] of the ego, nose up positive; nothing in a flat town."""
    if ground.town.heights_m is None:
        return ()
    rear = ground.height_m(footing.lane, footing.position_m)
    ahead = ground.near(np.array([ahead_of(pose_m, WHEELBASE_M)]))
    k = ground.lane_of(ahead, 0, pose_m[2], footing.lane)
    front = ground.height_m(int(ahead.lane[k]), float(ahead.position_m[0, k])) if k >= 0 else rear
    return rear, math.atan((front - rear) / WHEELBASE_M)
