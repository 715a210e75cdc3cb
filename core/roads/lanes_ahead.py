"""Lanes cut into bins, with a table of the lanes ahead of every lane: what the route search walks on.

``lane_graph`` tabulates the bins ahead of every bin. That is the fastest way to look them up, but takes 300 MB for 1,000 km of
lanes. Here only lanes are tabulated, and the bins within them follow by arithmetic: all bins of a lane have the same length.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.roads.geometry import SHORTEST_LANE_M
from hippodrome.core.roads.lane_graph import SHORTEST_STEP_M, LaneBins, cut_lanes
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, IntArray

WAYS = 3  # ways on from a lane: along the lane itself, from the lane on its left, and from the one on its right
_MAX_OPEN = 4096  # lanes still to be walked ahead of one lane; a junction of 6 roads x 3 lanes stays below 100
_LEAST_BIN_M = 1e-9  # one divides by the length of a bin, and some lanes have no length

AheadRows: TypeAlias = NDArray[Any]  # rows of LANE_AHEAD
LANE_AHEAD = np.dtype(
    [
        ("begin_m", np.float64),  # arc length from the beginning of the way's first lane to the beginning of this lane
        ("bin_m", np.float64),  # length of its bins
        ("first_bin", np.int32),
        ("bin_count", np.int32),
    ],
    align=True,
)


class LanesAhead(NamedTuple):
    """Lanes ahead of each of L lanes, by way: rows ``start[3 * lane + way]:start[3 * lane + way + 1]``, the nearest first.

    A vehicle at arc length p of its lane is at ``entry[3 * lane + way]`` p on the first lane of the way.
    """

    start: NDArray[np.int64]  # (3 L + 1,)
    entry: FloatArray  # (3 L,) 1 along the lane itself; adjacent lanes differ in length, so that positions are scaled
    rows: AheadRows  # (R,)


@dataclass(frozen=True, slots=True, eq=False)
class SearchGraph(LaneBins):
    """N bins, and the lanes ahead of each lane."""

    ahead: LanesAhead
    reach_limit_m: float  # how far ahead of every bin the table goes, at least


def build_search_graph(network: RoadNetwork, reach_limit_m: float, bin_m: float = 1.0) -> SearchGraph:
    """Cut every lane into equal bins of at most ``bin_m`` and tabulate the lanes that begin within ``reach_limit_m`` of any bin.

    A drive may begin with a change to an adjacent lane; it keeps to that lane from there on.
    """
    bins = cut_lanes(network, bin_m)
    ahead = lanes_ahead(network, np.diff(bins.lane_start), reach_limit_m)
    return SearchGraph(bins.lane, bins.position_m, bins.points_m, bins.heading_rad, bins.lane_start, ahead, reach_limit_m)


def lanes_ahead(network: RoadNetwork, bin_counts: IntArray, reach_limit_m: float) -> LanesAhead:
    """The lanes that begin within ``reach_limit_m`` of a lane's end, for every lane and way.

    Args:
        network: the roads.
        bin_counts: (L,) number of bins that each lane is cut into.
        reach_limit_m: how far the table reaches.
    """
    length = network.lane_lengths_m()
    first = np.column_stack([np.arange(len(length), dtype=np.int32), network.left_lane, network.right_lane]).astype(np.int32)
    ratio = length[np.maximum(first, 0)] / np.maximum(length, SHORTEST_LANE_M)[:, None]
    ratio[:, 0] = 1.0
    lanes = _Lanes(length, bin_counts.astype(np.int32), network.successor, network.successor_start)
    start, rows = _table(first.ravel(), lanes, float(reach_limit_m))
    return LanesAhead(start, np.where(first >= 0, ratio, 0.0).ravel(), rows)


class _Lanes(NamedTuple):
    """The lanes and how they connect, for compiled functions."""

    length_m: FloatArray
    bin_count: IntArray
    successor: IntArray
    successor_start: IntArray


@njit(cache=True)
def _table(first: IntArray, lanes: _Lanes, limit_m: float) -> tuple[NDArray[np.int64], AheadRows]:
    """The table of ``lanes_ahead``: counted first, so that it has the right size, then written and sorted by distance."""
    first_bin = np.zeros(lanes.length_m.shape[0] + 1, np.int64)
    first_bin[1:] = np.cumsum(lanes.bin_count)
    open_lane, open_m = np.empty(_MAX_OPEN, np.int32), np.empty(_MAX_OPEN, np.float64)
    start, nothing = np.zeros(first.shape[0] + 1, np.int64), np.empty(0, LANE_AHEAD)
    for way in range(first.shape[0]):
        start[way + 1] = start[way] + _walk(first[way], lanes, first_bin, limit_m, open_lane, open_m, nothing)
    rows = np.empty(start[-1], LANE_AHEAD)
    for way in range(first.shape[0]):
        own = rows[start[way] : start[way + 1]]
        _walk(first[way], lanes, first_bin, limit_m, open_lane, open_m, own)
        own[:] = own[np.argsort(own["begin_m"], kind="mergesort")]
    return start, rows


@njit(cache=True)
def _walk(
    lane: int,
    lanes: _Lanes,
    first_bin: NDArray[np.int64],
    limit_m: float,
    open_lane: IntArray,
    open_m: FloatArray,
    out: AheadRows,
) -> int:
    """Depth-first walk from the beginning of a lane, -1 for none, to ``limit_m`` beyond its end; returns the number of lanes.

    They are written into ``out``, or only counted if that has no rows. ``open_lane`` and ``open_m`` are scratch memory.
    """
    if lane < 0:
        return 0
    farthest_m = lanes.length_m[lane] + limit_m
    open_lane[0], open_m[0] = lane, 0.0
    size, count = 1, 0
    while size > 0:
        size -= 1
        lane, begin_m = open_lane[size], open_m[size]
        if out.shape[0] > 0:
            row = out[count]
            row.begin_m, row.bin_m = begin_m, max(lanes.length_m[lane] / lanes.bin_count[lane], _LEAST_BIN_M)
            row.first_bin, row.bin_count = first_bin[lane], lanes.bin_count[lane]
        count += 1
        end_m = begin_m + max(lanes.length_m[lane], SHORTEST_STEP_M)
        if end_m < farthest_m:
            for e in range(lanes.successor_start[lane], lanes.successor_start[lane + 1]):
                if size < open_lane.shape[0]:
                    open_lane[size], open_m[size] = lanes.successor[e], end_m
                    size += 1
    return count
