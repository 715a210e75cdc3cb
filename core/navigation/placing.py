"""On which lane a pose is, and what the network says of that place."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hippodrome.core.reading.types import RoadReading
from hippodrome.core.roads.geometry import RoadGeometry, poses_on_segments, project
from hippodrome.core.se2 import wrap
from hippodrome.core.types import FloatArray

NEAR_M = 6.0  # lanes farther away are not looked at
SAME_WAY_RAD = math.radians(50.0)
FARTHEST_M = 3.5  # a vehicle farther from every lane's middle is on none of them
OPPOSITE_M = 8.0  # to the lane of the opposite direction: two lanes aside
METRES_PER_RAD = 4.0  # what an angle to a lane counts against a distance from it
INTERNAL_M = 1.0  # by which ways through junctions count as farther away: they overlap, and roads are surer


@dataclass(frozen=True, slots=True)
class LanePlace:
    """A place on a lane."""

    lane: int
    position_m: float
    heading_rad: float  # of the lane there
    offset_m: float  # of the pose from the lane's middle, left positive


def lane_of(roads: RoadGeometry, pose: FloatArray, inside: bool = True) -> LanePlace | None:
    """The lane that a pose (3,) is on, or None; ``inside`` says whether lanes inside junctions count."""
    near = project(roads, pose[None, :2], NEAR_M)
    off = np.abs(wrap(near.heading_rad - pose[2]))
    internal = roads.network.is_internal[near.lane]
    cost = near.distance_m + METRES_PER_RAD * off + INTERNAL_M * internal
    cost[(off > SAME_WAY_RAD) | (near.distance_m > FARTHEST_M) | (internal & (not inside))] = np.inf
    if len(cost) == 0 or not np.isfinite(cost.min()):
        return None
    best = int(np.argmin(cost))
    return place_beside(roads, pose, int(near.lane[best]), float(near.position_m[best]))


def opposite_lane(roads: RoadGeometry, pose: FloatArray) -> LanePlace | None:
    """The nearest lane of the opposite direction beside a pose (3,), outside of junctions; None where there is none."""
    near = project(roads, pose[None, :2], OPPOSITE_M)
    off = np.abs(wrap(near.heading_rad - pose[2] - math.pi))
    fits = (off < SAME_WAY_RAD) & ~roads.network.is_internal[near.lane]
    if not fits.any():
        return None
    best = int(np.argmin(np.where(fits, near.distance_m, np.inf)))
    return place_beside(roads, pose, int(near.lane[best]), float(near.position_m[best]))


def opposite_lanes(roads: RoadGeometry) -> tuple[int, ...]:
    """For each lane the nearest one of the opposite direction beside its middle, -1 if there is none; none inside junctions."""
    inside, found = roads.network.is_internal, np.full(roads.network.lane_count, -1, dtype=np.int32)
    lanes = np.arange(roads.network.lane_count, dtype=np.int32)
    middle = poses_on_segments(roads, lanes, 0.5 * roads.lane_length_m)
    near = project(roads, middle[:, :2], OPPOSITE_M)
    off = np.abs(wrap(near.heading_rad - middle[near.point, 2] - math.pi))
    rows = np.flatnonzero((off < SAME_WAY_RAD) & ~inside[near.lane] & ~inside[near.point])
    rows = rows[np.argsort(-near.distance_m[rows], kind="stable")]
    found[near.point[rows]] = near.lane[rows]  # of several, the last one counts: the nearest
    return tuple(found.tolist())


def place_beside(roads: RoadGeometry, pose: FloatArray, lane: int, position_m: float) -> LanePlace:
    """The place on a lane at an arc length, and how far beside it the pose is."""
    x, y, heading = poses_on_segments(roads, np.array([lane]), np.array([position_m]))[0]
    offset = math.cos(heading) * (pose[1] - y) - math.sin(heading) * (pose[0] - x)
    return LanePlace(lane, position_m, float(heading), float(offset))


def lane_that_is_read(roads: RoadGeometry, pose: FloatArray, place: LanePlace, reading: RoadReading) -> LanePlace:
    """The lane that a reading speaks of: the one of the place, or the one beside it that fits better."""
    candidates = [place]
    for lane in roads.network.adjacent_lanes(place.lane):
        share = place.position_m / max(float(roads.lane_length_m[place.lane]), 1e-6)
        candidates.append(place_beside(roads, pose, lane, share * float(roads.lane_length_m[lane])))
    return min(candidates, key=lambda one: abs(one.offset_m - reading.offset_m) + (0.0 if one is place else 0.3))


def keeps_left(roads: RoadGeometry) -> bool:
    """Whether traffic keeps left: beside most lanes, the lane of the opposite direction lies to the right."""
    network = roads.network
    lanes = np.flatnonzero(~network.is_internal).astype(np.int32)
    middle = poses_on_segments(roads, lanes, 0.5 * roads.lane_length_m[lanes])
    near = project(roads, middle[:, :2], 5.0)
    opposite = np.abs(wrap(near.heading_rad - middle[near.point, 2])) > math.pi - 0.5
    own = middle[near.point]
    aside = np.cos(own[:, 2]) * (near.foot_m[:, 1] - own[:, 1]) - np.sin(own[:, 2]) * (near.foot_m[:, 0] - own[:, 0])
    return bool(np.sum(aside[opposite] > 0.0) < np.sum(aside[opposite] < 0.0))
