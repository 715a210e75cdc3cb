"""The directed lane graph cut into bins of about 1 m, with a table of what lies ahead of every bin.

Distances are the true arc lengths between bin centres, so that a lane of 0.1 m (common in converted CARLA towns) costs 0.1 m
and rounding to whole bins does not add up along a route.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.roads.geometry import chord_headings, entry_position_m, number_pieces, points_between_vertices
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import Float32Array, FloatArray, IntArray, UInt8Array

_HALF_CHORD_M = 1.5  # half the chord that a bin's heading is taken over: SUMO's curves are polylines with joints 1-5 m apart
_MAX_OPEN = 4096  # lanes still to be walked, ahead of one bin; a junction of 6 roads x 3 lanes stays below 100
SHORTEST_STEP_M = 1e-3  # a lane counts for at least this much, so that a ring of lanes without length ends the walk, too

OpenLanes: TypeAlias = NDArray[Any]  # rows of _OPEN_LANE
_OPEN_LANE = np.dtype(
    [
        ("lane", np.int32),
        ("begin_m", np.float64),  # distance from the start of the walk to the lane's beginning, negative for the first lanes
        ("lane_changes", np.int32),  # lane changes on the way to it
    ],
    align=True,
)


@dataclass(frozen=True, slots=True, eq=False)
class LaneBins:
    """All lanes cut into N bins, lane after lane."""

    lane: IntArray  # (N,) lane of each bin
    position_m: FloatArray  # (N,) arc length of the bin's centre on its lane
    points_m: FloatArray  # (N, 2) the bin's centre
    heading_rad: Float32Array  # (N,) driving direction at the centre
    lane_start: IntArray  # (L + 1,) first bin of each lane

    @property
    def bin_count(self) -> int:
        return len(self.lane)


@dataclass(frozen=True, slots=True, eq=False)
class LaneGraph(LaneBins):
    """N bins, and what is within reach of each.

    The bins ahead of bin ``i`` are rows ``reach_start[i]:reach_start[i + 1]`` of the reach table, the nearest one first.
    """

    reach_start: np.ndarray[tuple[int], np.dtype[np.int64]]  # (N + 1,)
    reach_bin: IntArray  # (R,) a bin ahead
    reach_m: Float32Array  # (R,) arc length from bin centre to bin centre
    reach_changes: UInt8Array  # (R,) lane changes on the way, 0 or 1
    reach_limit_m: float  # how far ahead the table goes


def cut_lanes(network: RoadNetwork, bin_m: float) -> LaneBins:
    """Cut every lane into equal bins of at most ``bin_m``."""
    lengths = network.lane_lengths_m()
    counts = np.maximum(1, np.ceil(lengths / bin_m - 1e-9)).astype(np.int32)
    lane_start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    lane, number = number_pieces(counts)
    position = (number + 0.5) * (lengths / counts)[lane]
    return LaneBins(
        lane=lane,
        position_m=position,
        points_m=points_between_vertices(network, lane, position),
        heading_rad=chord_headings(network, lane, position, _HALF_CHORD_M).astype(np.float32),
        lane_start=lane_start,
    )


def build_lane_graph(network: RoadNetwork, reach_limit_m: float, bin_m: float = 1.0) -> LaneGraph:
    """Cut every lane into equal bins of at most ``bin_m`` and tabulate the bins that can be driven to within ``reach_limit_m``.

    A drive may begin with a change to an adjacent lane; it keeps to that lane from there on.
    """
    bins = cut_lanes(network, bin_m)
    lanes = _Lanes(network.lane_lengths_m(), network.successor, network.successor_start, network.left_lane, network.right_lane)
    own = _Bins(bins.lane, bins.position_m, bins.lane_start)
    start, reach_bin, reach_m, reach_changes = _reach_table(own, lanes, float(reach_limit_m))
    return LaneGraph(
        lane=bins.lane,
        position_m=bins.position_m,
        points_m=bins.points_m,
        heading_rad=bins.heading_rad,
        lane_start=bins.lane_start,
        reach_start=start,
        reach_bin=reach_bin,
        reach_m=reach_m,
        reach_changes=reach_changes,
        reach_limit_m=reach_limit_m,
    )


def reversed_network(network: RoadNetwork) -> RoadNetwork:
    """The same lanes under the same indices, driven backwards: for a search that runs back in time.

    Centrelines run the other way, and predecessors become successors.
    """
    predecessor = np.repeat(np.arange(network.lane_count, dtype=np.int32), np.diff(network.successor_start))
    order = np.lexsort((predecessor, network.successor))
    starts, ends = network.point_start[:-1], network.point_start[1:]
    lane = np.repeat(np.arange(network.lane_count), ends - starts)
    index = starts[lane] + ends[lane] - 1 - np.arange(len(network.points_m))
    return replace(
        network,
        points_m=network.points_m[index],
        successor=predecessor[order],
        successor_start=np.searchsorted(network.successor[order], np.arange(network.lane_count + 1)).astype(np.int32),
    )


def mirrored(graph: LaneBins, bins: IntArray) -> IntArray:
    """Numbers (K,) of the bins of the reversed network's graph that cover the same places as ``bins`` (K,) of this ``graph``.

    A search that runs back in time uses that graph. It has the bins of each lane in reverse order. Negative numbers, which mean
    places off the network, stay as they are.
    """
    lane = graph.lane[np.maximum(bins, 0)]
    return np.where(bins >= 0, graph.lane_start[lane] + graph.lane_start[lane + 1] - 1 - bins, bins).astype(np.int32)


class BinGrid(NamedTuple):
    """Spatial index of the bins: square cells of the plane, row by row.

    The cell in row ``r`` and column ``c`` has the number ``n = r * columns + c``; it holds ``bin[start[n]:start[n + 1]]``.
    """

    start: IntArray  # (rows * columns + 1,)
    bin: IntArray  # (N,)
    origin_m: tuple[float, float]  # lower left corner of the first cell
    cell_m: float  # side of a cell
    columns: int
    rows: int


def bin_grid(graph: LaneBins, cell_m: float = 10.0) -> BinGrid:
    """Sort the bins into square cells, as a spatial index.

    If ``cell_m`` is about the radius of a search, the search reads about 9 cells.
    """
    low = graph.points_m.min(axis=0)
    cell = ((graph.points_m - low) / cell_m).astype(np.int64)
    columns, rows = (int(n) + 1 for n in cell.max(axis=0))
    number = cell[:, 1] * columns + cell[:, 0]
    order = np.argsort(number, kind="stable").astype(np.int32)
    start = np.searchsorted(number[order], np.arange(rows * columns + 1)).astype(np.int32)
    return BinGrid(start, order, (float(low[0]), float(low[1])), cell_m, columns, rows)


class _Bins(NamedTuple):
    """The bins, for compiled functions; fields as in ``LaneGraph``."""

    lane: IntArray
    position_m: FloatArray
    lane_start: IntArray


class _Lanes(NamedTuple):
    """The lanes and how they connect, for compiled functions; fields as in ``RoadNetwork``."""

    length_m: FloatArray
    successor: IntArray
    successor_start: IntArray
    left_lane: IntArray
    right_lane: IntArray


class _Ahead(NamedTuple):
    """Bins that lie ahead of a bin, with their distances and the lane changes on the way, one row each."""

    bin: IntArray
    distance_m: Float32Array
    lane_changes: UInt8Array


@njit(cache=True)
def _push(open_: OpenLanes, size: int, lane: int, begin_m: float, lane_changes: int) -> int:
    """Put a lane on the stack and return the stack's new size; on a full stack the lane is left out."""
    if size == open_.shape[0]:
        return size
    row = open_[size]
    row.lane, row.begin_m, row.lane_changes = lane, begin_m, lane_changes
    return size + 1


@njit(cache=True)
def _push_first_lanes(from_bin: int, bins: _Bins, lanes: _Lanes, open_: OpenLanes) -> int:
    """Open the bin's own lane and those adjacent to it, as seen from the bin's centre; returns the stack's size."""
    own, position_m = bins.lane[from_bin], bins.position_m[from_bin]
    size = _push(open_, 0, own, -position_m, 0)
    for side in (lanes.left_lane[own], lanes.right_lane[own]):
        if side >= 0:
            entry_m = entry_position_m(position_m, lanes.length_m[own], lanes.length_m[side])
            size = _push(open_, size, side, -entry_m, 1)
    return size


@njit(cache=True)
def _walk_ahead(from_bin: int, bins: _Bins, lanes: _Lanes, limit_m: float, open_: OpenLanes, ahead: _Ahead) -> int:
    """Depth-first walk along the lanes: write the bins within ``limit_m`` ahead into ``ahead``, and return their number.

    If ``ahead`` has no rows, they are only counted. ``open_`` is scratch memory for the stack of lanes.
    """
    fill = ahead.bin.shape[0] > 0
    size, count = _push_first_lanes(from_bin, bins, lanes, open_), 0
    while size > 0:
        size -= 1
        lane, begin_m, lane_changes = open_[size].lane, open_[size].begin_m, open_[size].lane_changes
        for j in range(bins.lane_start[lane], bins.lane_start[lane + 1]):
            distance_m = begin_m + bins.position_m[j]
            if distance_m > limit_m:
                break
            if distance_m <= 0.0:
                continue
            if fill:
                ahead.bin[count], ahead.distance_m[count], ahead.lane_changes[count] = j, distance_m, lane_changes
            count += 1
        end_m = begin_m + max(lanes.length_m[lane], SHORTEST_STEP_M)
        if end_m < limit_m:
            for e in range(lanes.successor_start[lane], lanes.successor_start[lane + 1]):
                size = _push(open_, size, lanes.successor[e], end_m, lane_changes)
    return count


@njit(cache=True)
def _reach_table(
    bins: _Bins, lanes: _Lanes, limit_m: float
) -> tuple[NDArray[np.int64], IntArray, Float32Array, NDArray[np.uint8]]:
    """The bins ahead of every bin: where each bin's own begin, (N + 1,), and the fields of ``_Ahead``.

    They are counted first, so that the table has the right size, then written and sorted by distance.
    """
    bin_count = bins.lane.shape[0]
    open_ = np.empty(_MAX_OPEN, _OPEN_LANE)
    start = np.zeros(bin_count + 1, np.int64)
    count_only = _room_for(0)
    for i in range(bin_count):
        start[i + 1] = start[i] + _walk_ahead(i, bins, lanes, limit_m, open_, count_only)
    table = _room_for(start[-1])
    for i in range(bin_count):
        if start[i + 1] == start[i]:
            continue
        row = slice(start[i], start[i + 1])
        own = _Ahead(table.bin[row], table.distance_m[row], table.lane_changes[row])
        _walk_ahead(i, bins, lanes, limit_m, open_, own)
        order = np.argsort(own.distance_m, kind="mergesort")
        own.bin[:], own.distance_m[:], own.lane_changes[:] = own.bin[order], own.distance_m[order], own.lane_changes[order]
    return start, table.bin, table.distance_m, table.lane_changes


@njit(cache=True)
def _room_for(rows: int) -> _Ahead:
    """A table of so many rows, not filled in yet."""
    return _Ahead(np.empty(rows, np.int32), np.empty(rows, np.float32), np.empty(rows, np.uint8))
