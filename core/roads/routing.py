"""Driving distances between nearby lanes, by a bounded Dijkstra search over carriageways."""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from hippodrome.core.roads.geometry import SHORTEST_LANE_M, RoadGeometry
from hippodrome.core.roads.network import BoolArray
from hippodrome.core.types import FloatArray, IntArray

BACKWARD_SLACK_M = 2.0  # projections of one vehicle step back by this much at bends and stops; it is no drive round the block


@dataclass(frozen=True, slots=True, eq=False)
class RouteTable:
    """Shortest drives between C carriageways: from the end of ``c`` to the beginning of ``target``, where within the bound.

    A carriageway is a set of adjacent lanes. Those that can be reached from ``c`` are rows ``start[c]:start[c + 1]`` of
    ``target``, ascending.
    """

    lane_length_m: FloatArray  # (L,)
    carriageway: IntArray  # (L,) carriageway that each lane belongs to
    length_m: FloatArray  # (C,) mean length of the carriageway's lanes
    start: IntArray  # (C + 1,)
    target: IntArray  # (K,) carriageway within reach
    gap_m: FloatArray  # (K,) length of the drive from the end of ``c`` to the beginning of ``target``


def route_table(geometry: RoadGeometry, lanes: IntArray, bound_m: float) -> RouteTable:
    """Shortest drives of at most ``bound_m`` that begin on one of ``lanes`` (K,)."""
    carriageway, length = carriageways(geometry)
    start, onward = _successors(geometry, carriageway, len(length))
    sources = np.zeros(len(length), dtype=np.bool_)
    sources[carriageway[lanes]] = True
    drive_start, target, gap_m = _bounded_searches(_CarriagewayGraph(length, start, onward), sources, bound_m)
    return RouteTable(geometry.lane_length_m, carriageway, length, drive_start, target, gap_m)


def carriageways(geometry: RoadGeometry) -> tuple[IntArray, FloatArray]:
    """Carriageway (L,) of each lane, and the mean length (C,) of each carriageway's lanes."""
    count = geometry.network.lane_count
    lane, beside = geometry.network.adjacent_pairs().T
    graph = coo_array((np.ones(len(lane)), (lane, beside)), shape=(count, count))
    count, label = connected_components(graph, directed=False)
    length = np.bincount(label, geometry.lane_length_m, count) / np.bincount(label, minlength=count)
    return label.astype(np.int32), length


def route_distances_m(
    table: RouteTable, start: IntArray, lane: IntArray, position_m: FloatArray
) -> tuple[NDArray[np.int64], FloatArray]:
    """Driving distances between all candidates of consecutive vertices.

    Args:
        table: the shortest drives from the carriageways of all candidates.
        start: (T + 1,) vertex ``t`` owns the candidates ``start[t]:start[t + 1]``.
        lane: (K,) lane of each candidate.
        position_m: (K,) arc length of each candidate on its lane.

    Returns:
        ``first`` (T,) and the distances in metres: those from the candidates of vertex ``t`` to those of ``t + 1`` are rows
        ``first[t]:first[t + 1]``, ordered by candidate of ``t``, then of ``t + 1``. Infinite where no drive is within the bound.
    """
    counts = np.diff(start).astype(np.int64)
    first = np.concatenate([[0], np.cumsum(counts[:-1] * counts[1:])])
    length_m = table.lane_length_m[lane]
    share = position_m / np.maximum(length_m, SHORTEST_LANE_M)
    candidates = _Candidates(start, table.carriageway[lane], share, position_m, length_m - position_m)
    drives = _Drives(table.length_m, table.start, table.target, table.gap_m)
    return first, _pair_distances(first, candidates, drives)


def _successors(geometry: RoadGeometry, carriageway: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """The carriageways that follow each of C = ``count`` carriageways, each once, in CSR form.

    ``carriageway`` (L,) has the carriageway of each lane. Returns the row starts (C + 1,) and the following carriageways (K,).
    """
    network = geometry.network
    source = np.repeat(carriageway, np.diff(network.successor_start)).astype(np.int64)
    key = np.unique(source * count + carriageway[network.successor])
    start = np.searchsorted(key // count, np.arange(count + 1))
    return start.astype(np.int32), (key % count).astype(np.int32)


class _CarriagewayGraph(NamedTuple):
    """``c`` is followed by ``onward[onward_start[c]:onward_start[c + 1]]``."""

    length_m: FloatArray  # (C,)
    onward_start: IntArray  # (C + 1,)
    onward: IntArray


class _Drives(NamedTuple):
    """The shortest drives, for compiled functions; fields as in ``RouteTable``."""

    length_m: FloatArray
    start: IntArray
    target: IntArray
    gap_m: FloatArray


class _Candidates(NamedTuple):
    """Candidate positions of all vertices, K in all; vertex ``t`` owns rows ``start[t]:start[t + 1]``."""

    start: IntArray
    carriageway: IntArray  # (K,)
    share: FloatArray  # (K,) arc length on the lane over the lane's length
    position_m: FloatArray  # (K,) arc length on the lane
    to_end_m: FloatArray  # (K,) metres from there to the lane's end


@njit(cache=True)
def _bounded_searches(graph: _CarriagewayGraph, sources: BoolArray, bound_m: float) -> tuple[IntArray, IntArray, FloatArray]:
    """The shortest drives from each carriageway in the mask ``sources`` (C,), targets ascending: start, target and gap_m."""
    count = len(graph.length_m)
    gap = np.full(count, np.inf)
    start = np.zeros(count + 1, dtype=np.int32)
    targets, gaps = [np.int32(0) for _ in range(0)], [0.0 for _ in range(0)]
    for source in range(count):
        if sources[source]:
            for node in _dijkstra(graph, source, bound_m, gap):
                targets.append(node)
                gaps.append(gap[node])
                gap[node] = np.inf
        start[source + 1] = len(targets)
    return start, np.array(targets, dtype=np.int32), np.array(gaps, dtype=np.float64)


@njit(cache=True)
def _dijkstra(graph: _CarriagewayGraph, source: int, bound_m: float, gap: FloatArray) -> list[np.int32]:
    """Carriageways within ``bound_m`` of the end of ``source``, ascending; their distances are written into ``gap`` (C,).

    ``gap`` must be infinite everywhere at the beginning. Distances are to the beginning of a carriageway.
    """
    reached = [np.int32(0) for _ in range(0)]
    heap = [(0.0, np.int32(0)) for _ in range(0)]
    for k in range(graph.onward_start[source], graph.onward_start[source + 1]):
        gap[graph.onward[k]] = 0.0
        reached.append(graph.onward[k])
        heappush(heap, (0.0, graph.onward[k]))
    while len(heap) > 0:
        distance, node = heappop(heap)
        beyond = distance + graph.length_m[node]
        if distance > gap[node] or beyond > bound_m:
            continue
        for k in range(graph.onward_start[node], graph.onward_start[node + 1]):
            after = graph.onward[k]
            if beyond < gap[after]:
                if gap[after] == np.inf:
                    reached.append(after)
                gap[after] = beyond
                heappush(heap, (beyond, after))
    reached.sort()
    return reached


@njit(cache=True)
def _pair_distances(first: NDArray[np.int64], candidates: _Candidates, drives: _Drives) -> FloatArray:
    """Driving distance in metres of every pair of candidates, in the order that ``route_distances_m`` describes."""
    distances = np.full(first[-1], np.inf)
    start = candidates.start
    for t in range(len(first) - 1):
        row = first[t]
        for i in range(start[t], start[t + 1]):
            for j in range(start[t + 1], start[t + 2]):
                distances[row] = _driving_distance(i, j, candidates, drives)
                row += 1
    return distances


@njit(cache=True)
def _driving_distance(i: int, j: int, candidates: _Candidates, drives: _Drives) -> float:
    """Metres from candidate ``i`` to candidate ``j``: along the same carriageway, or over the shortest drive in between.

    Infinite where no drive is within the bound.
    """
    source, target = candidates.carriageway[i], candidates.carriageway[j]
    forward = (candidates.share[j] - candidates.share[i]) * drives.length_m[source]
    if source == target and forward >= -BACKWARD_SLACK_M:
        return float(abs(forward))
    begin, end = drives.start[source], drives.start[source + 1]
    k = begin + np.searchsorted(drives.target[begin:end], target)
    if k < end and drives.target[k] == target:
        return float(candidates.to_end_m[i] + drives.gap_m[k] + candidates.position_m[j])
    return np.inf
