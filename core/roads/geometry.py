"""Positions on a road network and projections onto it, vectorised over many lanes and points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, IntArray

SAMPLE_SPACING_M = 5.0  # of the spatial index: finer costs memory, coarser widens the search around each point
SHORTEST_SEGMENT_M = 1e-9  # drawn points can coincide; such a segment has no direction of its own


@dataclass(frozen=True, slots=True, eq=False)
class RoadGeometry:
    """A network's S centreline segments, laid out for vectorised queries. Made by ``road_geometry``."""

    network: RoadNetwork
    lane_length_m: FloatArray  # (L,)
    segment_lane: IntArray  # (S,)
    segment_begin_m: FloatArray  # (S, 2)
    segment_direction: FloatArray  # (S, 2) unit vector in driving direction
    segment_length_m: FloatArray  # (S,)
    segment_position_m: FloatArray  # (S,) arc length on its lane at which the segment begins
    segment_start: IntArray  # (L + 1,) lane i owns segments segment_start[i]:segment_start[i + 1]
    sample_segment: IntArray  # (K,) segment of each sample of the spatial index
    tree: cKDTree  # over the K samples


@dataclass(frozen=True, slots=True, eq=False)
class Projections:
    """Nearest position on each lane near each point: point ``i`` owns rows ``start[i]:start[i + 1]``, nearest lane first."""

    start: IntArray  # (N + 1,)
    point: IntArray  # (K,)
    lane: IntArray  # (K,)
    position_m: FloatArray  # (K,) arc length on the lane
    distance_m: FloatArray  # (K,) from the point
    foot_m: FloatArray  # (K, 2) the position itself
    heading_rad: FloatArray  # (K,) driving direction there


def road_geometry(network: RoadNetwork) -> RoadGeometry:
    """Index a network once; every query below takes the result."""
    step = np.diff(network.points_m, axis=0)
    inside_lane = np.ones(len(step), dtype=bool)
    inside_lane[network.point_start[1:-1] - 1] = False
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


def interpolate(geometry: RoadGeometry, lane: IntArray, position_m: FloatArray) -> FloatArray:
    """Poses (N, 3) at arc lengths on lanes; a position beyond an end is drawn back to that end."""
    lane = np.asarray(lane)
    position = np.clip(position_m, 0.0, geometry.lane_length_m[lane])
    offset = np.concatenate([[0.0], np.cumsum(geometry.lane_length_m)])  # makes the positions of all lanes one sorted axis
    begins = geometry.segment_position_m + offset[geometry.segment_lane]
    segment = np.searchsorted(begins, position + offset[lane], side="right") - 1
    segment = np.clip(segment, geometry.segment_start[lane], geometry.segment_start[lane + 1] - 1)
    along = np.clip(position - geometry.segment_position_m[segment], 0.0, geometry.segment_length_m[segment])
    direction = geometry.segment_direction[segment]
    xy = geometry.segment_begin_m[segment] + along[..., None] * direction
    heading = np.arctan2(direction[..., 1], direction[..., 0])
    return np.concatenate([xy, heading[..., None]], axis=-1)


def project(geometry: RoadGeometry, points_m: FloatArray, radius_m: float) -> Projections:
    """The nearest position on every lane that comes within ``radius_m`` of each of the points (N, 2)."""
    points = np.ascontiguousarray(points_m, dtype=np.float64)
    point, segment = _nearby_segments(geometry, points, radius_m)
    along, foot, distance = _feet(geometry, points[point], segment)
    lane = geometry.segment_lane[segment]
    own = point.astype(np.int64) * geometry.network.lane_count + lane
    order = np.flatnonzero(distance <= radius_m)
    order = order[np.lexsort((distance[order], own[order]))]
    first = np.diff(own[order], prepend=-1) != 0  # of its point and lane: the nearest segment of that lane
    best = order[first]
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
    """Middles of equal pieces of each segment, none longer than SAMPLE_SPACING_M."""
    pieces = np.maximum(1, np.ceil(length / SAMPLE_SPACING_M).astype(np.int32))
    segment = np.repeat(np.arange(len(length), dtype=np.int32), pieces)
    piece = np.arange(len(segment)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    share = (piece + 0.5) / pieces[segment]
    return segment, begin[segment] + share[:, None] * step[segment]


def _directions(step: FloatArray, length: FloatArray) -> FloatArray:
    """Unit vectors; a segment without length borrows the direction of the nearest one before it that has one."""
    usable = np.where(length > SHORTEST_SEGMENT_M, np.arange(len(length)), -1)
    source = np.maximum.accumulate(usable)
    source = np.where(source < 0, max(int(np.argmax(usable >= 0)), 0), source)
    direction: FloatArray = step[source] / np.maximum(length[source], SHORTEST_SEGMENT_M)[:, None]
    return direction


def _nearby_segments(geometry: RoadGeometry, points: FloatArray, radius_m: float) -> tuple[IntArray, IntArray]:
    """Pairs (point, segment), some more than once, that hold every pair within the radius."""
    reach = radius_m + 0.5 * SAMPLE_SPACING_M
    pairs = cKDTree(points).sparse_distance_matrix(geometry.tree, reach, output_type="ndarray")
    return pairs["i"].astype(np.int32), geometry.sample_segment[pairs["j"]]


def _feet(geometry: RoadGeometry, points: FloatArray, segment: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Foot of each point on its segment: arc length on the segment (K,), position (K, 2), distance (K,)."""
    direction, begin = geometry.segment_direction[segment], geometry.segment_begin_m[segment]
    along = np.clip(np.sum((points - begin) * direction, axis=1), 0.0, geometry.segment_length_m[segment])
    foot = begin + along[:, None] * direction
    return along, foot, np.linalg.norm(points - foot, axis=1)
