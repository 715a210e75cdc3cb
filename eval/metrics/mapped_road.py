"""Which part of a drive lies on mapped road. Elsewhere nothing can be recognised, which is not the localizer's fault."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from hippodrome.core import se2
from hippodrome.core.localization.places import SAME_PLACE_M
from hippodrome.core.types import CognitiveMap, FloatArray
from hippodrome.eval.metrics.localization import FALSE_FIX_M, LocalizationScore
from hippodrome.eval.metrics.trajectory import path_length_m

# A vertex shows the road in directions that differ from its own by less than this: a street that was mapped in the opposite
# direction only has been seen from behind, and counts as not mapped.
SAME_WAY_RAD: Final = np.deg2rad(60.0)
MAPPED: Final = f"road with a place of the map within {SAME_PLACE_M:g} m, facing the same way"


@dataclass(frozen=True, slots=True, eq=False)
class OnMap:
    """A localization score, split into steps on mapped road and steps elsewhere."""

    localized_after_m: float | None  # metres of mapped road until the initial localization; None if there was none
    errors_m: FloatArray  # errors of the declared steps on mapped road, from the initial localization on
    off_map_errors_m: FloatArray  # errors of the declared steps elsewhere, where the localizer reckons dead
    steps: int  # number of steps from the initial localization on
    way_m: float  # metres of mapped road in the whole drive


def split_by_map(score: LocalizationScore, poses_m: FloatArray, cognitive_map: CognitiveMap) -> OnMap:
    """Split a localization score by whether the road was mapped.

    Args:
        score: The score of N steps.
        poses_m: True poses (N, 3) of these steps.
        cognitive_map: The map that the drive was localized in.
    """
    mapped, errors_m = on_mapped_road(poses_m, cognitive_map), score.errors_m
    right = score.localized & (errors_m <= FALSE_FIX_M)
    first = int(np.argmax(right)) if right.any() else len(right)
    declared = score.localized & (np.arange(len(right)) >= first)
    way_m = mapped_way_m(poses_m, mapped)
    after_m = float(way_m[first]) if right.any() else None
    return OnMap(after_m, errors_m[declared & mapped], errors_m[declared & ~mapped], len(right) - first, float(way_m[-1]))


def on_mapped_road(poses_m: FloatArray, cognitive_map: CognitiveMap) -> NDArray[np.bool_]:
    """Which of the true poses (T, 3) have a vertex of the map within ``SAME_PLACE_M``, facing the same way."""
    near = cKDTree(cognitive_map.poses[:, :2]).query_ball_point(poses_m[:, :2], SAME_PLACE_M)
    headings_rad = cognitive_map.poses[:, 2]
    return np.array([
        bool((np.abs(se2.wrap(headings_rad[vertices] - pose[2])) < SAME_WAY_RAD).any())
        for vertices, pose in zip(near, poses_m, strict=True)
    ], dtype=np.bool_)  # fmt: skip


def mapped_way_m(poses_m: FloatArray, mapped: NDArray[np.bool_]) -> FloatArray:
    """Metres (T,) driven on mapped road up to each pose."""
    steps_m = np.diff(path_length_m(poses_m), prepend=0.0)
    way_m: FloatArray = np.cumsum(np.where(mapped, steps_m, 0.0))
    return way_m
