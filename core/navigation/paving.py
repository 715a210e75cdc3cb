"""Where the ground is paved, by the road network alone: a raster of the distance to the edge of the paving.

What is paved are the lanes, each as broad as it is, and the junctions: what lies between the ends of the lanes that lead
into a junction and out of it, and the ways through it. It is what a likelihood field needs (Thrun,
Burgard, Fox, "Probabilistic robotics", 2005, section 6.4), with the paving's edge in the place of walls.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import cv2
import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, Int8Array, IntArray

CELL_M: Final = 0.25
MOST_CELLS: Final = 1 << 25  # of the raster: a town of more than 1.4 km square has coarser cells
LEVEL_M: Final = 0.1  # a level of the raster
MOST_LEVEL: Final = 100  # 10 m
RIM_M: Final = 20.0  # kept about the network
ROUNDED, PARALLEL = 8, 0.05  # points of a rounded border; and borders that turn by less into one another are not
FRACTION_BITS: Final = 4  # of cv2's drawing: a sixteenth of a cell


@dataclass(frozen=True, slots=True, eq=False)
class Paving:
    """A raster: how far each cell is from the edge of the paving.

    Args:
        levels: (n, m) distance in ``LEVEL_M``, positive on the paving; rows run along x, columns along y.
        corner_m: (2,) where the first cell begins.
        cell_m: width of a cell.
    """

    levels: Int8Array
    corner_m: FloatArray
    cell_m: float


def grid_over(
    network: RoadNetwork, rim_m: float, least_cell_m: float, most_cells: int
) -> tuple[FloatArray, float, tuple[int, int]]:
    """The corner (2,), the width of a cell (m) and the cells along x and y of a raster of a network with a rim about it."""
    low, high = network.points_m.min(axis=0) - rim_m, network.points_m.max(axis=0) + rim_m
    extent = np.maximum(high - low, 1.0)
    cell_m = max(least_cell_m, math.sqrt(float(extent.prod()) / most_cells))
    shape = np.ceil(extent / cell_m).astype(np.int64)
    return low, cell_m, (int(shape[0]), int(shape[1]))


@lru_cache(maxsize=2)
def paving(network: RoadNetwork) -> Paving:
    """The raster of a network."""
    low, cell_m, shape = grid_over(network, RIM_M, CELL_M, MOST_CELLS)
    mask = np.zeros(shape, dtype=np.uint8)
    for lane in range(network.lane_count):
        _fill(mask, _strip(network.lane_points_m(lane), 0.5 * float(network.width_m[lane])), low, cell_m)
    for outline in _junctions(network):
        cv2.fillPoly(mask, [_cells(outline, low, cell_m)], 1, lineType=cv2.LINE_8, shift=FRACTION_BITS)
    inside = cv2.distanceTransform(mask, cv2.DIST_L2, 5) - 0.5
    outside = cv2.distanceTransform(1 - mask, cv2.DIST_L2, 5) - 0.5
    signed = np.where(mask > 0, inside, -outside) * (cell_m / LEVEL_M)
    return Paving(np.clip(np.rint(signed), -MOST_LEVEL, MOST_LEVEL).astype(np.int8), low, cell_m)


def _strip(points: FloatArray, half_m: float) -> list[FloatArray]:
    """Quadrilaterals (4, 2) of the segments of a lane, and discs' stand-ins at its inner joints."""
    step = np.diff(points, axis=0)
    length = np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-9)
    left = half_m * np.stack([-step[:, 1], step[:, 0]], axis=1) / length
    parts = [np.array([a + n, b + n, b - n, a - n]) for a, b, n in zip(points[:-1], points[1:], left, strict=True)]
    for k in range(1, len(left)):  # wedges at the joints
        parts.append(np.array([points[k], points[k] + left[k - 1], points[k] + left[k]]))
        parts.append(np.array([points[k], points[k] - left[k - 1], points[k] - left[k]]))
    return parts


def _fill(mask: np.ndarray, polygons: list[FloatArray], low: FloatArray, cell_m: float) -> None:
    """Draw convex polygons."""
    for polygon in polygons:
        cv2.fillConvexPoly(mask, _cells(polygon, low, cell_m), 1, lineType=cv2.LINE_8, shift=FRACTION_BITS)


def _cells(polygon: FloatArray, low: FloatArray, cell_m: float) -> IntArray:
    """A polygon (n, 2) as cv2 wants it."""
    cells: IntArray = np.rint(((polygon - low) / cell_m - 0.5)[:, ::-1] * (1 << FRACTION_BITS)).astype(np.int32)
    return cells


def _junctions(network: RoadNetwork) -> list[FloatArray]:
    """The outline (k, 2) of each junction: round the ends of the lanes that meet there, whose borders curve into one another."""
    junction = _junction_of_ways(network)
    corners: dict[int, list[FloatArray]] = {}
    for lane in range(network.lane_count):
        points = network.lane_points_m(lane)
        half_m = 0.5 * float(network.width_m[lane])
        for after in network.successors(lane).tolist():
            if network.is_internal[after] and not network.is_internal[lane]:
                corners.setdefault(int(junction[after]), []).append(_ends(points[-1], points[-1] - points[-2], half_m))
            if network.is_internal[lane] and not network.is_internal[after]:
                begun = network.lane_points_m(after)
                half_after_m = 0.5 * float(network.width_m[after])
                corners.setdefault(int(junction[lane]), []).append(_ends(begun[0], begun[0] - begun[1], half_after_m))
    return [_outline(np.unique(np.concatenate(parts), axis=0)) for _, parts in sorted(corners.items())]


def _ends(point: FloatArray, inward: FloatArray, half_m: float) -> FloatArray:
    """Both corners of a lane at one end: rows (2, 4) of place and direction into the junction."""
    ahead = inward / max(float(np.linalg.norm(inward)), 1e-9)
    left = half_m * np.array([-ahead[1], ahead[0]])
    return np.array([[*(point + left), *ahead], [*(point - left), *ahead]])


def _outline(corners: FloatArray) -> FloatArray:
    """A polygon through corners (k, 4), going round; where borders of two roads would cross, they are rounded off."""
    middle = corners[:, :2].mean(axis=0)
    around = corners[np.argsort(np.arctan2(corners[:, 1] - middle[1], corners[:, 0] - middle[0]), kind="stable")]
    share = np.linspace(0.0, 1.0, ROUNDED, endpoint=False)[:, None]
    parts = []
    for one, other in zip(around, np.roll(around, -1, axis=0), strict=True):
        apart, cross = other[:2] - one[:2], one[2] * other[3] - one[3] * other[2]
        on_one = (apart[0] * other[3] - apart[1] * other[2]) / cross if abs(cross) > PARALLEL else -1.0
        on_other = (apart[0] * one[3] - apart[1] * one[2]) / cross if abs(cross) > PARALLEL else -1.0
        if on_one <= 0.0 or on_other <= 0.0:
            parts.append(one[None, :2])
            continue
        bend = one[:2] + on_one * one[2:]
        parts.append((1.0 - share) ** 2 * one[:2] + 2.0 * share * (1.0 - share) * bend + share**2 * other[:2])
    return np.concatenate(parts)


def _junction_of_ways(network: RoadNetwork) -> IntArray:
    """A number (L,) for each way through a junction, the same for all ways of one: those that share a road's end."""
    parent = list(range(network.lane_count))

    def root(lane: int) -> int:
        while parent[lane] != lane:
            parent[lane] = parent[parent[lane]]
            lane = parent[lane]
        return lane

    ends: dict[tuple[int, bool], int] = {}
    for lane in range(network.lane_count):
        for after in network.successors(lane).tolist():
            if network.is_internal[lane] and network.is_internal[after]:
                parent[root(after)] = root(lane)
                continue
            way, road, begins = (after, lane, False) if network.is_internal[after] else (lane, after, True)
            if network.is_internal[way] and not network.is_internal[road]:
                first = ends.setdefault((int(network.lane_edge[road]), begins), way)
                parent[root(way)] = root(first)
    return np.array([root(lane) for lane in range(network.lane_count)], dtype=np.int32)
