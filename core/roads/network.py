"""The road network as ``core`` sees it: directed lane centrelines and how they connect. Plain arrays, no files, no simulator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hippodrome.core.types import FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class RoadNetwork:
    """L lanes, those inside junctions included.

    Lane ``i`` owns ``points_m[point_start[i]:point_start[i + 1]]``, at least 2 points.
    """

    lane_ids: tuple[str, ...]
    edge_ids: tuple[str, ...]
    lane_edge: IntArray  # (L,) index into edge_ids
    is_internal: np.ndarray[tuple[int], np.dtype[np.bool_]]  # (L,) lane inside a junction
    width_m: FloatArray  # (L,)
    speed_limit_mps: FloatArray  # (L,)
    points_m: FloatArray  # (P, 2)
    point_start: IntArray  # (L + 1,)
    successor: IntArray  # (S,) lanes that follow, internal lanes in between
    successor_start: IntArray  # (L + 1,)
    left_lane: IntArray  # (L,) lane to the left in the same direction, -1: none
    right_lane: IntArray  # (L,)

    @property
    def lane_count(self) -> int:
        return len(self.lane_ids)

    def lane_points_m(self, lane: int) -> FloatArray:
        """Centreline (n, 2) of one lane, in driving direction."""
        return self.points_m[self.point_start[lane] : self.point_start[lane + 1]]

    def successors(self, lane: int) -> IntArray:
        """Lanes reached from the end of ``lane``."""
        return self.successor[self.successor_start[lane] : self.successor_start[lane + 1]]

    def lane_lengths_m(self) -> FloatArray:
        """Arc length (L,) of each centreline as drawn (SUMO's own ``length`` attribute may differ)."""
        steps = np.linalg.norm(np.diff(self.points_m, axis=0), axis=1)
        along = np.concatenate([[0.0], np.cumsum(steps)])
        starts, ends = self.point_start[:-1], self.point_start[1:] - 1
        lengths: FloatArray = along[ends] - along[starts]
        return lengths
