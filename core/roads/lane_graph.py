"""The directed lane graph cut into bins of about 1 m, with tables of what lies ahead of every bin.

Distances are the true arc lengths between bin centres, so that a lane of 0.1 m (common in converted CARLA towns) costs 0.1 m
and a long one does not gather rounding errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import Float32Array, FloatArray, IntArray, UInt8Array

Roads: TypeAlias = tuple[Any, ...]  # for compiled functions: lane lengths, successor, successor_start, left lane, right lane

_CHORD_M = 1.5  # half the chord that a bin's heading is taken over: SUMO's curves are polylines with joints 1-5 m apart
_MAX_STACK = 4096  # open branches while walking ahead of one bin; a junction of 6 roads x 3 lanes stays below 100


@dataclass(frozen=True, slots=True, eq=False)
class LaneGraph:
    """N bins. Row ``i`` of the reach tables is ``reach_start[i]:reach_start[i + 1]``, nearest target first."""

    lane: IntArray  # (N,)
    position_m: FloatArray  # (N,) arc length of the bin's centre on its lane
    points_m: FloatArray  # (N, 2)
    heading_rad: Float32Array  # (N,)
    lane_start: IntArray  # (L + 1,) first bin of each lane
    reach_start: np.ndarray[tuple[int], np.dtype[np.int64]]  # (N + 1,)
    reach_bin: IntArray  # (R,)
    reach_m: Float32Array  # (R,) arc length from bin centre to bin centre
    reach_changes: UInt8Array  # (R,) lane changes on the way, 0 or 1
    reach_limit_m: float

    @property
    def bin_count(self) -> int:
        return len(self.lane)


def build_lane_graph(network: RoadNetwork, reach_limit_m: float, bin_m: float = 1.0) -> LaneGraph:
    """Cut every lane into bins and tabulate those within ``reach_limit_m`` ahead, lane changes to direct neighbours included."""
    lengths = network.lane_lengths_m()
    counts = np.maximum(1, np.ceil(lengths / bin_m - 1e-9)).astype(np.int32)
    lane_start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    lane = np.repeat(np.arange(network.lane_count, dtype=np.int32), counts)
    order = np.arange(len(lane)) - lane_start[lane]
    position = (order + 0.5) * (lengths / counts)[lane]
    roads = lengths, network.successor, network.successor_start, network.left_lane, network.right_lane
    tables = _reach_tables(lane, position, lane_start, roads, float(reach_limit_m))
    return LaneGraph(
        lane=lane,
        position_m=position,
        points_m=_points_at(network, lane, position),
        heading_rad=_headings_at(network, lane, position, lengths).astype(np.float32),
        lane_start=lane_start,
        reach_start=tables[0],
        reach_bin=tables[1],
        reach_m=tables[2],
        reach_changes=tables[3],
        reach_limit_m=reach_limit_m,
    )


def reversed_network(network: RoadNetwork) -> RoadNetwork:
    """The same lanes driven backwards, under the same indices: for a search against time."""
    owner = np.repeat(np.arange(network.lane_count, dtype=np.int32), np.diff(network.successor_start))
    order = np.lexsort((owner, network.successor))
    starts, ends = network.point_start[:-1], network.point_start[1:]
    lane = np.repeat(np.arange(network.lane_count), ends - starts)
    index = starts[lane] + ends[lane] - 1 - np.arange(len(network.points_m))
    return replace(
        network,
        points_m=network.points_m[index],
        successor=owner[order],
        successor_start=np.searchsorted(network.successor[order], np.arange(network.lane_count + 1)).astype(np.int32),
    )


def mirrored(graph: LaneGraph, bins: IntArray) -> IntArray:
    """The bins of the reversed network's graph that cover the same places; negative ones (off the network) stay."""
    lane = graph.lane[np.maximum(bins, 0)]
    return np.where(bins >= 0, graph.lane_start[lane] + graph.lane_start[lane + 1] - 1 - bins, bins).astype(np.int32)


@dataclass(frozen=True, slots=True, eq=False)
class BinCells:
    """Bins by square cells of the plane, row-major: cell ``c`` holds ``bin[start[c]:start[c + 1]]``."""

    start: IntArray  # (rows * columns + 1,)
    bin: IntArray  # (N,)
    origin_m: tuple[float, float]
    size_m: float
    columns: int
    rows: int


def bin_cells(graph: LaneGraph, size_m: float = 10.0) -> BinCells:
    """Index of the bins by place; cells of about the radius of a search keep its number of cells near 9."""
    low = graph.points_m.min(axis=0)
    cell = ((graph.points_m - low) / size_m).astype(np.int64)
    columns, rows = (int(n) + 1 for n in cell.max(axis=0))
    number = cell[:, 1] * columns + cell[:, 0]
    order = np.argsort(number, kind="stable").astype(np.int32)
    start = np.searchsorted(number[order], np.arange(rows * columns + 1)).astype(np.int32)
    return BinCells(start, order, (float(low[0]), float(low[1])), size_m, columns, rows)


def _points_at(network: RoadNetwork, lane: IntArray, position_m: FloatArray) -> FloatArray:
    """Points (N, 2) at arc lengths on lanes."""
    steps = np.linalg.norm(np.diff(network.points_m, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])  # runs on over the gaps between lanes, which no position reaches
    s = along[network.point_start[lane]] + position_m
    points: FloatArray = np.stack([np.interp(s, along, network.points_m[:, axis]) for axis in (0, 1)], axis=-1)
    return points


def _headings_at(network: RoadNetwork, lane: IntArray, position_m: FloatArray, lengths_m: FloatArray) -> FloatArray:
    """Direction (N,) of the chord around each position, cut at the lane's ends."""
    ahead = _points_at(network, lane, np.minimum(position_m + _CHORD_M, lengths_m[lane]))
    behind = _points_at(network, lane, np.maximum(position_m - _CHORD_M, 0.0))
    chord = ahead - behind
    heading: FloatArray = np.arctan2(chord[:, 1], chord[:, 0])
    return heading


@njit(cache=True)
def _push(stack: NDArray[Any], size: int, lane: int, base: float, changes: float) -> int:
    """The new size of the stack; what no longer fits is left out."""
    if size == stack.shape[0]:
        return size
    stack[size, 0], stack[size, 1], stack[size, 2] = lane, base, changes
    return size + 1


@njit(cache=True)
def _walk(
    bin_: int, lane: NDArray[Any], position: NDArray[Any], lane_start: NDArray[Any], roads: Roads, limit: float,
    stack: NDArray[Any], out: tuple[NDArray[Any], NDArray[Any], NDArray[Any]],
) -> int:  # fmt: skip
    """Fill ``out`` (bin, metres, lane changes) with what lies ahead of ``bin_``, counted; counts only if ``out`` is empty."""
    lengths, successor, successor_start, left, right = roads
    out_bin, out_m, out_changes = out
    fill = out_bin.shape[0] > 0
    own = lane[bin_]
    size = count = 0
    for change, first in enumerate((own, left[own], right[own])):
        if first >= 0:
            share = 1.0 if change == 0 else lengths[first] / max(lengths[own], 1e-6)
            size = _push(stack, size, first, -position[bin_] * share, min(change, 1))
    while size > 0:
        size -= 1
        at, base, changes = int(stack[size, 0]), stack[size, 1], stack[size, 2]
        for j in range(lane_start[at], lane_start[at + 1]):
            ahead = base + position[j]
            if ahead > limit:
                break
            if ahead <= 0.0:
                continue
            if fill:
                out_bin[count], out_m[count], out_changes[count] = j, ahead, changes
            count += 1
        end = base + max(lengths[at], 1e-3)
        if end < limit:
            for e in range(successor_start[at], successor_start[at + 1]):
                size = _push(stack, size, successor[e], end, changes)
    return count


@njit(cache=True)
def _reach_tables(
    lane: NDArray[Any], position: NDArray[Any], lane_start: NDArray[Any], roads: Roads, limit: float
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
    bins = lane.shape[0]
    stack = np.empty((_MAX_STACK, 3))
    start = np.zeros(bins + 1, np.int64)
    nothing = np.empty(0, np.int32), np.empty(0, np.float32), np.empty(0, np.uint8)
    for i in range(bins):
        start[i + 1] = start[i] + _walk(i, lane, position, lane_start, roads, limit, stack, nothing)
    bin_, metres, changes = np.empty(start[-1], np.int32), np.empty(start[-1], np.float32), np.empty(start[-1], np.uint8)
    for i in range(bins):
        row = slice(start[i], start[i + 1])
        if start[i + 1] == start[i]:
            continue
        _walk(i, lane, position, lane_start, roads, limit, stack, (bin_[row], metres[row], changes[row]))
        order = np.argsort(metres[row], kind="mergesort")
        bin_[row], metres[row], changes[row] = bin_[row][order], metres[row][order], changes[row][order]
    return start, bin_, metres, changes
