"""Place recognition alone: frames of a second drive answered with frames of the first, judged by where both truly were."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from hippodrome.core import se2
from hippodrome.core.types import FloatArray

# A query can be recognised if a place lies this near and faces the same way.
MAPPED_M: Final = 5.0
MAPPED_RAD: Final = float(np.deg2rad(30.0))
# An answer this near is the same place. A query that has no place this near is on an unmapped road.
SAME_M: Final = 15.0
SAME_RAD: Final = float(np.deg2rad(60.0))
PRECISION: Final = 0.99  # the recall at this precision is the figure of the tables
DEFINITION: Final = (
    f"place recognition by the nearest descriptor: share of the queries with a place within {MAPPED_M:g} m, facing the same "
    f"way, whose answer is right within {SAME_M:g} m; recalled: their share at {100 * PRECISION:g} % precision, by distance"
)


@dataclass(frozen=True, slots=True)
class PlaceScore:
    """How well a descriptor tells places apart."""

    definition: str
    places: int  # frames of the first drive
    queries: int  # frames of the second drive
    mapped: int  # queries that have a place
    best_is_right: float  # share of these whose nearest descriptor is of the same place
    recall: float  # share of these that are answered, rightly, at ``PRECISION``


def score_places(places: FloatArray, place_poses_m: FloatArray, queries: FloatArray, query_poses_m: FloatArray) -> PlaceScore:
    """Score a descriptor.

    Args:
        places: Descriptors (P, D) of frames of the first drive.
        place_poses_m: Where these truly were (P, 3).
        queries: Descriptors (Q, D) of frames of the second drive.
        query_poses_m: Where these truly were (Q, 3).
    """
    apart = _distances(queries, places)
    best = np.argmin(apart, axis=1)
    offset_m, turn_rad = _offsets(query_poses_m, place_poses_m)
    rows = np.arange(len(best))
    right = (offset_m[rows, best] <= SAME_M) & (turn_rad[rows, best] <= SAME_RAD)
    mapped = ((offset_m <= MAPPED_M) & (turn_rad <= MAPPED_RAD)).any(axis=1)
    order = np.argsort(apart[rows, best], kind="stable")
    accepted, correct = np.arange(1, len(order) + 1), np.cumsum(right[order])
    recalled = np.cumsum((right & mapped)[order]) / max(int(mapped.sum()), 1)
    return PlaceScore(
        DEFINITION,
        places=len(places),
        queries=len(queries),
        mapped=int(mapped.sum()),
        best_is_right=float(right[mapped].mean()) if mapped.any() else 0.0,
        recall=float(np.max(recalled, where=correct / accepted >= PRECISION, initial=0.0)),
    )


def _distances(queries: FloatArray, places: FloatArray) -> FloatArray:
    """Euclidean distances (Q, P)."""
    squares = (queries**2).sum(axis=1)[:, None] + (places**2).sum(axis=1)[None, :] - 2.0 * queries @ places.T
    apart: FloatArray = np.sqrt(np.maximum(squares, 0.0))
    return apart


def _offsets(queries: FloatArray, places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distances (Q, P) and turns (Q, P) between poses."""
    between = queries[:, None, :2] - places[None, :, :2]
    return np.hypot(between[..., 0], between[..., 1]), np.abs(se2.wrap(queries[:, None, 2] - places[None, :, 2]))
