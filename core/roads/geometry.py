"""Arithmetic on lane centrelines: from arc lengths to points, from points to the nearest lanes, and between adjacent lanes.

There are two ways from an arc length on a lane to a point. They agree up to rounding; both are kept, because results are to be
reproduced to the last bit. ``poses_on_segments`` starts at the beginning of the centreline segment and walks along its unit
direction; ``points_between_vertices`` interpolates linearly between the two neighbouring vertices of the centreline. Likewise
``RoadGeometry.lane_length_m`` sums segments of lanes only, ``RoadNetwork.lane_lengths_m`` subtracts two running sums.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, IntArray

SAMPLE_SPACING_M = 5.0  # spacing of the spatial index: finer costs memory, coarser widens the search around each point
SHORTEST_SEGMENT_M = 1e-9  # drawn points can coincide; a segment shorter than this has no direction of its own
SHORTEST_LANE_M = 1e-6  # stands in for the length of a lane that is a single point, where one divides by lengths
_AT_ONCE = 1 << 16  # positions whose headings are taken together: for all of 1,000 km of road it would take 130 MB more


@dataclass(frozen=True, slots=True, eq=False)
class RoadGeometry:
    """A network of L lanes as S straight centreline segments, in arrays for vectorised queries. Made by ``road_geometry``."""

    network: RoadNetwork
    lane_length_m: FloatArray  # (L,)
    segment_lane: IntArray  # (S,) lane that each segment belongs to
    segment_begin_m: FloatArray  # (S, 2) first point of each segment
    segment_direction: FloatArray  # (S, 2) unit vector in driving direction
    segment_length_m: FloatArray  # (S,)
    segment_position_m: FloatArray  # (S,) arc length on its lane at which the segment begins
    segment_start: IntArray  # (L + 1,) lane i owns segments segment_start[i]:segment_start[i + 1]
    sample_segment: IntArray  # (K,) segment of each sample of the spatial index
    tree: cKDTree  # spatial index over K samples of the segments


@dataclass(frozen=True, slots=True, eq=False)
class Projections:
    """Nearest position on each lane near each of N points.

    Point ``i`` owns rows ``start[i]:start[i + 1]``, one row for each lane near it, the nearest lane first.
    """

    start: IntArray  # (N + 1,)
    point: IntArray  # (K,) index of the projected point
    lane: IntArray  # (K,)
    position_m: FloatArray  # (K,) arc length on the lane of the foot of the perpendicular
    distance_m: FloatArray  # (K,) distance of the foot from the point
    foot_m: FloatArray  # (K, 2) the foot itself
    heading_rad: FloatArray  # (K,) driving direction at the foot


def road_geometry(network: RoadNetwork) -> RoadGeometry:
    """Cut the network into segments with a spatial index, for ``poses_on_segments`` and ``project``; once for each network."""
    step = np.diff(network.points_m, axis=0)
    inside_lane = np.ones(len(step), dtype=bool)
    inside_lane[network.point_start[1:-1] - 1] = False  # from the last point of a lane to the first of the next is no segment
    lane = np.repeat(np.arange(network.lane_count), np.diff(network.point_start))[:-1][inside_lane].astype(np.int32)
    step, begin = step[inside_lane], network.points_m[:-1][inside_lane]
    length = np.linalg.norm(step, axis=1)
    start = np.searchsorted(lane, np.arange(network.lane_count + 1)).astype(np.int32)
    before = np.concatenate([[0.0], np.cumsum(length)])
    sample_segment, samples = _samples(begin, step, length)
    return RoadGeometry(
        network=network,
        lane_length_m=before[start[1:]] - before[start[:-1]],
        segment_lane=lane,
        segment_begin_m=begin,
        segment_direction=_directions(step, length),
        segment_length_m=length,
        segment_position_m=before[:-1] - before[start[lane]],
        segment_start=start,
        sample_segment=sample_segment,
        tree=cKDTree(samples),
    )


def poses_on_segments(geometry: RoadGeometry, lane: IntArray, position_m: FloatArray) -> FloatArray:
    """Poses (N, 3) at arc lengths on lanes: the point on the centreline, and the heading of its segment there.

    The point is reached from the beginning of the segment along its unit direction; the module says why this matters.

    Args:
        geometry: the network's segments.
        lane: (N,) lane of each pose.
        position_m: (N,) arc length on that lane; one beyond an end of the lane is taken back to that end.

    Returns:
        x, y in metres and the heading of the segment in rad.
    """
    lane = np.asarray(lane)
    position = np.clip(position_m, 0.0, geometry.lane_length_m[lane])
    lane_offset = np.concatenate([[0.0], np.cumsum(geometry.lane_length_m)])  # puts all lanes on one ascending axis
    begins = geometry.segment_position_m + lane_offset[geometry.segment_lane]
    segment = np.searchsorted(begins, position + lane_offset[lane], side="right") - 1
    segment = np.clip(segment, geometry.segment_start[lane], geometry.segment_start[lane + 1] - 1)
    along = np.clip(position - geometry.segment_position_m[segment], 0.0, geometry.segment_length_m[segment])
    direction = geometry.segment_direction[segment]
    xy = geometry.segment_begin_m[segment] + along[..., None] * direction
    heading = np.arctan2(direction[..., 1], direction[..., 0])
    return np.concatenate([xy, heading[..., None]], axis=-1)


def points_between_vertices(network: RoadNetwork, lane: IntArray, position_m: FloatArray) -> FloatArray:
    """Points (N, 2) at arc lengths (N,) on lanes (N,), linear between the two neighbouring vertices of the centreline.

    The arc lengths must lie on their lanes: nothing holds them to the lane's ends.
    """
    return _points_at(network, network.running_length_m(), lane, position_m)


def _points_at(network: RoadNetwork, running: FloatArray, lane: IntArray, position_m: FloatArray) -> FloatArray:
    s = running[network.point_start[lane]] + position_m
    points: FloatArray = np.stack([np.interp(s, running, network.points_m[:, axis]) for axis in (0, 1)], axis=-1)
    return points


def chord_headings(network: RoadNetwork, lane: IntArray, position_m: FloatArray, half_chord_m: float) -> FloatArray:
    """Driving direction (N,) in rad at arc lengths ``position_m`` (N,) of lanes (N,), smoothed over the joints of the centreline.

    It is the direction of the chord from ``half_chord_m`` behind to as far ahead of each position, cut at the lane's ends.
    """
    running, lengths_m = network.running_length_m(), network.lane_lengths_m()
    heading: FloatArray = np.empty(len(lane))
    for begin in range(0, len(lane), _AT_ONCE):
        part = slice(begin, begin + _AT_ONCE)
        own, middle_m = lane[part], position_m[part]
        ahead = _points_at(network, running, own, np.minimum(middle_m + half_chord_m, lengths_m[own]))
        chord = ahead - _points_at(network, running, own, np.maximum(middle_m - half_chord_m, 0.0))
        heading[part] = np.arctan2(chord[:, 1], chord[:, 0])
    return heading


@njit(cache=True)
def entry_position_m(position_m: float, length_m: float, entered_length_m: float) -> float:
    """Arc length at which a vehicle at ``position_m`` on a lane of ``length_m`` enters the adjacent lane of ``entered_length_m``.

    Adjacent lanes begin and end side by side but differ in length, in bends above all, so that positions are scaled.
    """
    return position_m * (entered_length_m / max(length_m, SHORTEST_LANE_M))


def number_pieces(count: NDArray[np.integer[Any]]) -> tuple[IntArray, NDArray[np.integer[Any]]]:
    """Owner and number of every piece, if owner ``i`` is cut into ``count[i]`` pieces.

    Returns:
        The owner (K,) of each piece, ascending, and its number (K,) within the owner, from 0.
    """
    owner = np.repeat(np.arange(len(count), dtype=np.int32), count)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    return owner, number


def project(geometry: RoadGeometry, points_m: FloatArray, radius_m: float) -> Projections:
    """The nearest position on every lane that comes within ``radius_m`` of each of the points (N, 2)."""
    points = np.ascontiguousarray(points_m, dtype=np.float64)
    point, segment = _nearby_segments(geometry, points, radius_m)
    along, foot, distance = _feet(geometry, points[point], segment)
    lane = geometry.segment_lane[segment]
    point_and_lane = point.astype(np.int64) * geometry.network.lane_count + lane
    order = np.flatnonzero(distance <= radius_m)
    order = order[np.lexsort((distance[order], point_and_lane[order]))]
    nearest_of_lane = np.diff(point_and_lane[order], prepend=-1) != 0
    best = order[nearest_of_lane]
    best = best[np.lexsort((lane[best], distance[best], point[best]))]
    direction = geometry.segment_direction[segment[best]]
    return Projections(
        start=np.searchsorted(point[best], np.arange(len(points) + 1)).astype(np.int32),
        point=point[best].astype(np.int32),
        lane=lane[best],
        position_m=geometry.segment_position_m[segment[best]] + along[best],
        distance_m=distance[best],
        foot_m=foot[best],
        heading_rad=np.arctan2(direction[:, 1], direction[:, 0]),
    )


def _samples(begin: FloatArray, step: FloatArray, length: FloatArray) -> tuple[IntArray, FloatArray]:
    """Points for the spatial index: the middles (K, 2) of equal pieces of each segment, at most SAMPLE_SPACING_M long.

    Returns the segment (K,) of each piece, and the middles.
    """
    pieces = np.maximum(1, np.ceil(length / SAMPLE_SPACING_M).astype(np.int32))
    segment, number = number_pieces(pieces)
    share = (number + 0.5) / pieces[segment]
    return segment, begin[segment] + share[:, None] * step[segment]


def _directions(step: FloatArray, length: FloatArray) -> FloatArray:
    """Unit vectors (S, 2); a segment without length takes the direction of the nearest one before it that has a length."""
    usable = np.where(length > SHORTEST_SEGMENT_M, np.arange(len(length)), -1)
    source = np.maximum.accumulate(usable)
    source = np.where(source < 0, max(int(np.argmax(usable >= 0)), 0), source)
    direction: FloatArray = step[source] / np.maximum(length[source], SHORTEST_SEGMENT_M)[:, None]
    return direction


def _nearby_segments(geometry: RoadGeometry, points: FloatArray, radius_m: float) -> tuple[IntArray, IntArray]:
    """Pairs (point, segment) that contain every pair closer than the radius; some are farther apart, some occur twice."""
    reach = radius_m + 0.5 * SAMPLE_SPACING_M
    pairs = cKDTree(points).sparse_distance_matrix(geometry.tree, reach, output_type="ndarray")
    return pairs["i"].astype(np.int32), geometry.sample_segment[pairs["j"]]


def _feet(geometry: RoadGeometry, points: FloatArray, segment: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Nearest position to each point on its segment: arc length on the segment (K,), the position (K, 2), its distance (K,)."""
    direction, begin = geometry.segment_direction[segment], geometry.segment_begin_m[segment]
    along = np.clip(np.sum((points - begin) * direction, axis=1), 0.0, geometry.segment_length_m[segment])
    foot = begin + along[:, None] * direction
    return along, foot, np.linalg.norm(points - foot, axis=1)
