"""Driving distances between nearby lanes: a bounded Dijkstra over the lanes that one can change between without a junction."""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heappop, heappush

import numpy as np
from numba import njit
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from hippodrome.core.roads.geometry import RoadGeometry
from hippodrome.core.types import FloatArray, IntArray

BACKWARD_SLACK_M = 2.0  # projections of one vehicle step back by this much at bends and stops; it is no drive round the block


@dataclass(frozen=True, slots=True, eq=False)
class RouteTable:
    """Shortest drives between carriageways: from the end of ``c`` to the beginning of ``target``, where within the bound.

    A carriageway is a set of parallel lanes of one direction. ``c`` owns rows ``start[c]:start[c + 1]``, targets ascending.
    """

    lane_length_m: FloatArray  # (L,)
    carriageway: IntArray  # (L,) of each lane
    length_m: FloatArray  # (C,)
    start: IntArray  # (C + 1,)
    target: IntArray  # (K,)
    gap_m: FloatArray  # (K,)


def route_table(geometry: RoadGeometry, lanes: IntArray, bound_m: float) -> RouteTable:
    """Drives of at most ``bound_m`` that begin on one of ``lanes``."""
    carriageway, length = carriageways(geometry)
    onward_start, onward = _successors(geometry, carriageway, len(length))
    sources = np.zeros(len(length), dtype=np.bool_)
    sources[carriageway[lanes]] = True
    start, target, gap = _bounded_searches(length, onward_start, onward, sources, bound_m)
    return RouteTable(geometry.lane_length_m, carriageway, length, start, target, gap)


def carriageways(geometry: RoadGeometry) -> tuple[IntArray, FloatArray]:
    """Carriageway (L,) of each lane, and the mean length (C,) of each carriageway's lanes."""
    network = geometry.network
    lane = np.arange(network.lane_count)
    beside = np.where(network.left_lane >= 0, network.left_lane, lane)
    graph = coo_array((np.ones(len(lane)), (lane, beside)), shape=(len(lane), len(lane)))
    count, label = connected_components(graph, directed=False)
    length = np.bincount(label, geometry.lane_length_m, count) / np.bincount(label, minlength=count)
    return label.astype(np.int32), length


def route_distance_m(table: RouteTable, a: tuple[int, float], b: tuple[int, float]) -> float:
    """Driving distance from one (lane, arc length) to another; infinite where there is no drive within the table's bound."""
    lanes, positions = np.array([a[0], b[0]], dtype=np.int32), np.array([a[1], b[1]])
    start = np.array([0, 1, 2], dtype=np.int32)
    return float(route_distances_m(table, start, lanes, positions)[1][0])


def route_distances_m(table: RouteTable, start: IntArray, lane: IntArray, position_m: FloatArray) -> tuple[IntArray, FloatArray]:
    """Driving distances between all candidates of consecutive vertices, where vertex ``t`` owns candidates start[t]:start[t + 1].

    Step ``t`` (from vertex t to t + 1) owns rows first[t]:first[t + 1], ordered by candidate of t, then of t + 1.
    Returns ``first`` (T,) and the distances in metres, infinite where there is no drive within the bound.
    """
    counts = np.diff(start).astype(np.int64)
    first = np.concatenate([[0], np.cumsum(counts[:-1] * counts[1:])])
    own = table.carriageway[lane]
    share = position_m / np.maximum(table.lane_length_m[lane], 1e-9)
    arguments = (first, start, own, share, position_m, table.lane_length_m[lane] - position_m)
    return first, _pair_distances(*arguments, table.length_m, table.start, table.target, table.gap_m, BACKWARD_SLACK_M)


def _successors(geometry: RoadGeometry, carriageway: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Carriageways that follow each carriageway, each once, as (start (C + 1,), carriageway)."""
    network = geometry.network
    source = np.repeat(carriageway, np.diff(network.successor_start)).astype(np.int64)
    key = np.unique(source * count + carriageway[network.successor])
    start = np.searchsorted(key // count, np.arange(count + 1))
    return start.astype(np.int32), (key % count).astype(np.int32)


@njit(cache=True)
def _bounded_searches(length, onward_start, onward, sources, bound_m):  # type: ignore[no-untyped-def]
    """Dijkstra from the end of each source; rows of each source sorted by target."""
    count = len(length)
    gap = np.full(count, np.inf)
    start = np.zeros(count + 1, dtype=np.int32)
    targets, gaps = [np.int32(0) for _ in range(0)], [0.0 for _ in range(0)]
    for source in range(count):
        if sources[source]:
            reached = [np.int32(0) for _ in range(0)]
            heap = [(0.0, np.int32(0)) for _ in range(0)]
            for k in range(onward_start[source], onward_start[source + 1]):
                gap[onward[k]] = 0.0
                reached.append(onward[k])
                heappush(heap, (0.0, onward[k]))
            while len(heap) > 0:
                distance, node = heappop(heap)
                beyond = distance + length[node]
                if distance > gap[node] or beyond > bound_m:
                    continue
                for k in range(onward_start[node], onward_start[node + 1]):
                    after = onward[k]
                    if beyond < gap[after]:
                        if gap[after] == np.inf:
                            reached.append(after)
                        gap[after] = beyond
                        heappush(heap, (beyond, after))
            reached.sort()
            for node in reached:
                targets.append(node)
                gaps.append(gap[node])
                gap[node] = np.inf
        start[source + 1] = len(targets)
    return start, np.array(targets, dtype=np.int32), np.array(gaps, dtype=np.float64)


@njit(cache=True)
def _pair_distances(first, start, own, share, position, ahead, length, row_start, target, gap, slack):  # type: ignore[no-untyped-def]
    """``ahead``: metres from each candidate to the end of its lane; ``share``: its position over its lane's length."""
    distances = np.full(first[-1], np.inf)
    for t in range(len(first) - 1):
        row = first[t]
        for i in range(start[t], start[t + 1]):
            begin, end = row_start[own[i]], row_start[own[i] + 1]
            for j in range(start[t + 1], start[t + 2]):
                forward = (share[j] - share[i]) * length[own[i]]
                if own[i] == own[j] and forward >= -slack:
                    distances[row] = abs(forward)
                else:
                    k = begin + np.searchsorted(target[begin:end], own[j])
                    if k < end and target[k] == own[j]:
                        distances[row] = ahead[i] + gap[k] + position[j]
                row += 1
    return distances
