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
SPEAKS = 0.5  # from which on borders tell of the oncoming lane: offsets alone do not, beside the road they would fit, too
EDGE_M = 1.0  # what a border that is not as the network has it counts against a distance
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


def lane_that_is_read(
    roads: RoadGeometry, pose: FloatArray, place: LanePlace, reading: RoadReading, side: float = -1.0
) -> LanePlace:
    """The lane that a reading speaks of: the one of the place, or one beside it that fits better, be it an oncoming one.

    How well a lane fits is told by the place across it, and by which of its borders are edges of the road. An oncoming lane
    counts where both borders that are seen are as its own. It is given as the vehicle sees it: with the vehicle's own direction,
    and the offset to the left of that. ``side`` is 1 where traffic keeps left, -1 where it keeps right.
    """
    oncoming = oncoming_place(roads, pose)
    beyond = 0.0 if oncoming is None else -side
    candidates = [(place, *_edges(roads, place.lane, beyond))]
    for lane in roads.network.adjacent_lanes(place.lane):
        share = place.position_m / max(float(roads.lane_length_m[place.lane]), 1e-6)
        beside = place_beside(roads, pose, lane, share * float(roads.lane_length_m[lane]))
        candidates.append((beside, *_edges(roads, lane, beyond)))
    if oncoming is not None and speaks_for_oncoming(roads, place, reading, side) > SPEAKS:
        right, left = _edges(roads, oncoming.lane, beyond)  # of the oncoming lane's own left and right
        candidates.append((oncoming, left, right))

    def misfit_m(one: tuple[LanePlace, bool, bool]) -> float:
        beside, left, right = one
        wrong = _misjudged(reading.left_edge, left) + _misjudged(reading.right_edge, right)
        return abs(beside.offset_m - reading.offset_m) + (0.0 if beside is place else 0.3) + EDGE_M * wrong

    return min(candidates, key=misfit_m)[0]


def oncoming_place(roads: RoadGeometry, pose: FloatArray) -> LanePlace | None:
    """The nearest lane of the opposite direction beside a pose (3,), as seen along the pose; None where there is none."""
    there = opposite_lane(roads, pose)
    return None if there is None else LanePlace(there.lane, there.position_m, there.heading_rad + math.pi, -there.offset_m)


def speaks_for_oncoming(roads: RoadGeometry, place: LanePlace, reading: RoadReading, side: float = -1.0) -> float:
    """How much a reading speaks for the oncoming lane, against the lane that the vehicle is taken to be on: -1 to 1.

    Of a lane that has the road's edge on its one side and a lane on its other, the oncoming one is the mirror image.
    """
    left, right = _edges(roads, place.lane, -side)
    if left == right or not (math.isfinite(reading.left_edge) and math.isfinite(reading.right_edge)):
        return 0.0
    read = reading.left_edge - reading.right_edge
    return -read if left else read


def _edges(roads: RoadGeometry, lane: int, oncoming: float) -> tuple[bool, bool]:
    """Whether the left and the right border of a lane are edges of the road.

    ``oncoming`` says on which side of the road the oncoming lanes are: 1 left, -1 right, 0 on none.
    """
    network = roads.network
    left, right = int(network.left_lane[lane]) < 0, int(network.right_lane[lane]) < 0
    return left and oncoming <= 0.0, right and oncoming >= 0.0


def _misjudged(edge: float, is_edge: bool) -> float:
    """Probability that a border is not what it is in the network; 0 where it was not seen."""
    if not math.isfinite(edge):
        return 0.0
    return 1.0 - edge if is_edge else edge


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
