"""What else a map gets right or wrong beside its poses: the lanes of its vertices, and its loop closures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from hippodrome.core import se2
from hippodrome.core.types import CognitiveMap, EdgeKind, FloatArray, IntArray, RoadMatch
from hippodrome.eval.metrics.trajectory import MetricError

REVISIT_RADIUS_M = 15.0  # views that are farther apart do not show the same place through a forward camera
REVISIT_HEADING_RAD = np.pi / 4.0  # views whose directions differ by more do not either
REVISIT_GAP_S = 20.0  # a vertex that is nearer in time belongs to the same visit of the place


@dataclass(frozen=True, slots=True)
class LaneAccuracy:
    """How many vertices are on the lane that was driven. Unmatched vertices count as neither right nor wrong."""

    right: int
    wrong: int
    unmatched: int
    right_edge: int  # on the right road in the right direction, whatever the lane

    @property
    def total(self) -> int:
        return self.right + self.wrong + self.unmatched

    @property
    def share_right(self) -> float:
        """Share of all vertices that are right."""
        return self.right / self.total

    @property
    def precision(self) -> float:
        """Share of the matched vertices that are right, 1 if none is matched."""
        matched = self.right + self.wrong
        return self.right / matched if matched else 1.0


def matched_lane_accuracy(estimated: Sequence[str | None], true: Sequence[str]) -> LaneAccuracy:
    """Compare the lanes of vertices.

    Args:
        estimated: Lane id of each vertex, None where it is unmatched. SUMO calls a lane by its edge and index, ``edge_index``.
        true: Lane id of the lane that was driven at each vertex's time.

    Raises:
        MetricError: The two do not belong together, or are empty.
    """
    if len(estimated) != len(true) or not true:
        raise MetricError(f"{len(estimated)} estimated lanes for {len(true)} true ones: one each per vertex, at least one")
    pairs = [(lane, other) for lane, other in zip(estimated, true, strict=True) if lane is not None]
    right = sum(lane == other for lane, other in pairs)
    right_edge = sum(lane.rpartition("_")[0] == other.rpartition("_")[0] for lane, other in pairs)
    return LaneAccuracy(right, len(pairs) - right, len(true) - len(pairs), right_edge)


def matched_lane_ids(match: RoadMatch) -> list[str | None]:
    """The lane id of each vertex, None where unmatched."""
    return [match.lane_ids[lane] if lane >= 0 else None for lane in match.lane]


@dataclass(frozen=True, slots=True)
class PlaceRecognition:
    """Loop closures judged by where their vertices truly were."""

    definition: str
    accepted: int  # closures in the map
    false: int  # closures between different places
    revisits: int  # vertices at which the vehicle truly came back to a place
    recalled: int  # revisits with a right closure

    @property
    def precision(self) -> float:
        """Share of the closures that are right, 1 if there are none."""
        return 1.0 - self.false / self.accepted if self.accepted else 1.0

    @property
    def recall(self) -> float:
        """Share of the revisits found, 1 if there are none."""
        return self.recalled / self.revisits if self.revisits else 1.0


def closures(cognitive_map: CognitiveMap) -> tuple[IntArray, IntArray]:
    """Source and target vertices (E,) of the loop closures."""
    chosen = cognitive_map.edges.kind == EdgeKind.CLOSURE
    return cognitive_map.edges.source[chosen], cognitive_map.edges.target[chosen]


def score_closures(
    source: IntArray, target: IntArray, true_poses: FloatArray, t_s: FloatArray, radius_m: float = REVISIT_RADIUS_M
) -> PlaceRecognition:
    """Judge loop closures by the true poses of their vertices.

    Args:
        source: Source vertex of each closure (E,).
        target: Target vertex of each closure (E,).
        true_poses: True poses (V, 3) of all vertices.
        t_s: Times (V,) of all vertices.
        radius_m: Poses that are farther apart are different places.
    """
    same = _same_place(true_poses[source], true_poses[target], radius_m)
    later = np.where(t_s[source] >= t_s[target], source, target)
    is_revisit = _revisits(true_poses, t_s, radius_m)
    recalled = np.intersect1d(later[same], np.flatnonzero(is_revisit))
    return PlaceRecognition(
        definition=f"closures; right if within {radius_m:g} m and {np.rad2deg(REVISIT_HEADING_RAD):.0f} deg in truth; "
        f"revisits: vertices with such another {REVISIT_GAP_S:g} s earlier or more",
        accepted=len(source),
        false=int(np.count_nonzero(~same)),
        revisits=int(is_revisit.sum()),
        recalled=len(recalled),
    )


def _same_place(a: FloatArray, b: FloatArray, radius_m: float) -> NDArray[np.bool_]:
    near: NDArray[np.bool_] = np.hypot(a[:, 0] - b[:, 0], a[:, 1] - b[:, 1]) <= radius_m
    aligned: NDArray[np.bool_] = np.abs(se2.wrap(a[:, 2] - b[:, 2])) <= REVISIT_HEADING_RAD
    return near & aligned


def _revisits(poses: FloatArray, t_s: FloatArray, radius_m: float) -> NDArray[np.bool_]:
    """Whether each vertex (V,) lies where the vehicle passed before in the same direction."""
    pairs = cKDTree(poses[:, :2]).query_pairs(radius_m, output_type="ndarray")
    same = pairs[_same_place(poses[pairs[:, 0]], poses[pairs[:, 1]], radius_m)]
    apart = same[np.abs(t_s[same[:, 0]] - t_s[same[:, 1]]) >= REVISIT_GAP_S]
    later = np.where(t_s[apart[:, 0]] > t_s[apart[:, 1]], apart[:, 0], apart[:, 1])
    found = np.zeros(len(poses), dtype=np.bool_)
    found[later] = True
    return found
