"""The road network as ``core`` sees it: directed lane centrelines and how they connect. Plain arrays, no files, no simulator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hippodrome.core.types import FloatArray, IntArray

BoolArray: TypeAlias = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RoadNetwork:
    """L directed lanes, those inside junctions included.

    Lane ``i`` owns the points ``points_m[point_start[i]:point_start[i + 1]]`` of its centreline, at least 2, and the successors
    ``successor[successor_start[i]:successor_start[i + 1]]``. Two lanes are *adjacent* if they run side by side in the same
    direction, so that a vehicle can change from one to the other.
    """

    lane_ids: tuple[str, ...]
    edge_ids: tuple[str, ...]
    lane_edge: IntArray  # (L,) the road (SUMO edge) of each lane, an index into edge_ids
    is_internal: BoolArray  # (L,) True for a lane inside a junction
    width_m: FloatArray  # (L,)
    speed_limit_mps: FloatArray  # (L,)
    points_m: FloatArray  # (P, 2) centreline points of all lanes, one lane after the other, in driving direction
    point_start: IntArray  # (L + 1,)
    successor: IntArray  # (S,) lanes that begin where a lane ends; the lanes inside a junction lie in between
    successor_start: IntArray  # (L + 1,)
    left_lane: IntArray  # (L,) adjacent lane to the left, -1 where there is none
    right_lane: IntArray  # (L,) adjacent lane to the right, -1 where there is none
    survey_sigma_m: float = 0.0  # standard deviation in each axis of where the roads are drawn; 0: they are where they are drawn

    def __repr__(self) -> str:
        roads, km = len(self.edge_ids), float(self.lane_lengths_m().sum()) / 1e3
        return f"RoadNetwork({roads} roads and ways through junctions, {self.lane_count} lanes, {km:.1f} km of lanes)"

    @property
    def lane_count(self) -> int:
        return len(self.lane_ids)

    def lane_points_m(self, lane: int) -> FloatArray:
        """Centreline (n, 2) of one lane, in driving direction."""
        return self.points_m[self.point_start[lane] : self.point_start[lane + 1]]

    def successors(self, lane: int) -> IntArray:
        """Lanes reached from the end of ``lane``."""
        return self.successor[self.successor_start[lane] : self.successor_start[lane + 1]]

    def running_length_m(self) -> FloatArray:
        """Length (P,) from the first point to each point, in one sum over all lanes and over the gaps between them.

        Only differences between points of the same lane have a meaning: they are arc lengths on that lane.
        """
        steps = np.linalg.norm(np.diff(self.points_m, axis=0), axis=1)
        running: FloatArray = np.concatenate([[0.0], np.cumsum(steps)])
        return running

    def lane_lengths_m(self) -> FloatArray:
        """Length (L,) of each lane along its centreline as drawn; SUMO's own attribute ``length`` may differ."""
        running = self.running_length_m()
        lengths: FloatArray = running[self.point_start[1:] - 1] - running[self.point_start[:-1]]
        return lengths

    def adjacent_lanes(self, lane: int) -> list[int]:
        """The lanes to the left and to the right of ``lane``, in this order, as far as they exist."""
        return [int(side) for side in (self.left_lane[lane], self.right_lane[lane]) if side >= 0]

    def has_adjacent_lane(self) -> BoolArray:
        """Whether each lane (L,) has an adjacent one."""
        mask: BoolArray = (self.left_lane >= 0) | (self.right_lane >= 0)
        return mask

    def are_adjacent(self, a: IntArray, b: IntArray) -> BoolArray:
        """Whether the lanes ``a`` (N,) and ``b`` (N,) are adjacent, pair by pair; False where either is -1."""
        mask: BoolArray = (a >= 0) & (b >= 0) & ((self.left_lane[a] == b) | (self.right_lane[a] == b))
        return mask

    def adjacent_pairs(self) -> IntArray:
        """All pairs (K, 2) of adjacent lanes, each pair once: a lane and the one to its left."""
        lane = np.flatnonzero(self.left_lane >= 0)
        pairs: IntArray = np.column_stack([lane, self.left_lane[lane]]).astype(np.int32)
        return pairs
