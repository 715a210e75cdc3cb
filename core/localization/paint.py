"""How far along the road the vehicle is, by the dashes that the map has seen there.

Views change slowly along a road: the one that looks most alike tells the place to a metre. The ends of dashes tell it to one or
two decimetres, once it is known well enough that no dash can be taken for the next (``core.reading.dashes``). A vehicle beside
the lane that was mapped sees the line between both lanes from its other side.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from hippodrome.core.localization.beliefs.motion import PoseMeasurement
from hippodrome.core.reading.dashes import NEXT_LANE_M, SAME_LANE_M, SAME_WAY_RAD, SIGMA_M, ahead_by_paint, shared_borders
from hippodrome.core.se2 import wrap
from hippodrome.core.types import CognitiveMap, FloatArray, IntArray, MatchStatus, UInt8Array

NEAR_M = 6.0  # along the road, within which two frames have seen enough of the same paint
COMPARED = 4  # of the nearest visits
APART_M = 2.5  # way between two comparisons: closer ones err together
LEAST_KNOWN_M = 1.3  # standard deviation along the road, above which a dash may be taken for the next
REACH_SIGMAS, REACH_M = 3.0, (1.0, 4.0)  # how far about the believed place paint is compared; dashes repeat after 6 m and more
STEADY_M = 0.3  # added to that standard deviation: the map may be wrong where the belief is sure
UNREAD_M, UNREAD_RAD = 100.0, 1.0  # standard deviations of what paint does not tell


class PaintSense:
    """Compares the paint ahead with that of the map's visits.

    Args:
        cognitive_map: a refined map; without paint nothing is ever told.
    """

    def __init__(self, cognitive_map: CognitiveMap) -> None:
        self._since_m = math.inf  # driven since paint told last
        lane, vertex = cognitive_map.visits.lane, cognitive_map.visits.vertex
        rows: IntArray = np.zeros(0, dtype=np.int32)
        if lane is not None and lane.paint is not None:
            match = cognitive_map.road_match
            matched = True if match is None else match.status[vertex] == MatchStatus.MATCHED
            rows = np.flatnonzero(lane.paint.any(axis=(1, 2)) & matched).astype(np.int32)
            self._paint: UInt8Array = lane.paint[rows]
        self._poses_m = cognitive_map.poses[vertex[rows]]
        ahead = np.stack([np.cos(self._poses_m[:, 2]), np.sin(self._poses_m[:, 2])], axis=1)
        covariance = np.zeros((len(rows), 2, 2))
        if cognitive_map.covariance is not None:
            covariance = cognitive_map.covariance[vertex[rows], :2, :2]
        self._variance_m2: FloatArray = np.einsum("ni,nij,nj->n", ahead, covariance, ahead)  # (N,) of the map along the road
        self._tree = cKDTree(self._poses_m[:, :2]) if len(rows) > 0 else None

    def move(self, moved_m: float) -> None:
        """Count the way driven."""
        self._since_m += abs(moved_m)

    def measure(self, seen: Callable[[], UInt8Array], pose: FloatArray, covariance: FloatArray) -> PoseMeasurement | None:
        """The pose as paint tells it, which is nothing but how far along the road it is; None where it tells nothing.

        Args:
            seen: returns the paint (2, PAINT_PLACES) ahead; it is asked only if something may come of it.
            pose: (3,) as believed.
            covariance: (3, 3) of the belief.
        """
        ahead = np.array([math.cos(pose[2]), math.sin(pose[2])])
        sigma_m = math.sqrt(float(ahead @ covariance[:2, :2] @ ahead))
        if self._tree is None or self._since_m < APART_M or sigma_m > LEAST_KNOWN_M:
            return None
        near = np.array(self._tree.query_ball_point(pose[:2], math.hypot(NEAR_M, NEXT_LANE_M[1])), dtype=np.int32)
        told = self._told(near, seen, pose, sigma_m) if len(near) > 0 else []
        if not told:
            return None
        off_m = float(np.median([one[0] for one in told]))
        variance_m2 = SIGMA_M**2 + float(np.mean([one[1] for one in told]))
        if off_m**2 > REACH_SIGMAS**2 * (variance_m2 + sigma_m**2):
            return None
        self._since_m = 0.0
        axes = np.array([[ahead[0], -ahead[1], 0.0], [ahead[1], ahead[0], 0.0], [0.0, 0.0, 1.0]])
        spread = np.diag([variance_m2, UNREAD_M**2, UNREAD_RAD**2])
        return PoseMeasurement(pose + np.array([*(off_m * ahead), 0.0]), axes @ spread @ axes.T)

    def _told(
        self, near: IntArray, seen: Callable[[], UInt8Array], pose: FloatArray, sigma_m: float
    ) -> list[tuple[float, float]]:
        """By how far the vehicle is farther along than believed, and the map's variance there, by each border that tells it."""
        visits = self._poses_m[near]
        off, cos, sin = pose[:2] - visits[:, :2], np.cos(visits[:, 2]), np.sin(visits[:, 2])
        along, left = cos * off[:, 0] + sin * off[:, 1], cos * off[:, 1] - sin * off[:, 0]
        lanes = (np.abs(left) < SAME_LANE_M) | ((np.abs(left) > NEXT_LANE_M[0]) & (np.abs(left) < NEXT_LANE_M[1]))
        same_way = np.abs(wrap(pose[2] - visits[:, 2])) < SAME_WAY_RAD
        rows = np.flatnonzero(same_way & (np.abs(along) < NEAR_M) & lanes)
        rows = rows[np.argsort(np.abs(along[rows]), kind="stable")][:COMPARED]
        if len(rows) == 0 or not (paint := seen()).any():
            return []
        reach_m = min(max(REACH_SIGMAS * math.hypot(sigma_m, STEADY_M), REACH_M[0]), REACH_M[1])
        told = []
        for row in rows.tolist():
            across = left[row] if abs(left[row]) < SAME_LANE_M else 0.0  # in a bend a vehicle goes aside as it goes on
            apart_m = math.copysign(math.hypot(along[row], across), along[row])
            for of_visit, own in shared_borders(float(left[row])):
                ahead_m = ahead_by_paint(self._paint[near[row], of_visit], paint[own], apart_m, reach_m)
                if math.isfinite(ahead_m):
                    told.append((ahead_m - apart_m, float(self._variance_m2[near[row]])))
        return told
