"""Sequence evidence on the graph of view cells: one view may lie, three along a path that exists hardly do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numba import njit

from hippodrome.core.types import Float32Array, IntArray
from hippodrome.core.views.graph import (
    WALK_LIMIT,
    Links,
    neighbourhood,
    walk_back_into,
)


@dataclass(frozen=True)
class SequenceConfig:
    """Lengths are in view spacings, so that nothing depends on the unit."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    memory: float = 0.6  # lambda: about three views; longer chains run straight on at junctions
    length_tolerance: float = 0.6  # predecessors 2-8 m behind at 5 m spacing
    turn_tolerance_rad: float = 0.5  # between the turn driven and the turn along the path: tells the legs of a junction apart
    neighbourhood: float = 3.0  # cells closer than this to the best one show the same place and are no rivals
    min_cells: int = 30  # fewer make no statistics: a z-score over a handful divides by next to nothing
    sigma_floor: float = 0.03  # cosine: the spread that pure noise has at 1,024 dimensions
    grey_sigma_floor: float = 1.0  # grey levels, the same for "grey"

    def __post_init__(self) -> None:
        if not 0.0 <= self.memory < 1.0:
            raise ValueError(f"sequence: memory must lie in [0, 1), got {self.memory}")
        if min(self.length_tolerance, self.turn_tolerance_rad, self.neighbourhood, self.sigma_floor, self.grey_sigma_floor) <= 0:
            raise ValueError("sequence: tolerances, neighbourhood and floors must be positive")
        if self.min_cells < 2:
            raise ValueError(f"sequence: min_cells must be at least 2, got {self.min_cells}")


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Filtered evidence for each cell after one view."""

    filtered: Float32Array  # (C,) F_t
    z_score: Float32Array  # (C,) z_t
    predecessor: IntArray  # (C,) cell of the view before on the best path here, -1: none


@dataclass(frozen=True, slots=True)
class Peak:
    """The best cell and how far it stands out."""

    cell: int  # -1: no cells
    margin: float  # best minus best outside its neighbourhood


NO_EVIDENCE = Evidence(np.zeros(0, dtype=np.float32), np.zeros(0, dtype=np.float32), np.zeros(0, dtype=np.int32))


def standardise(similarity: Float32Array, min_cells: int, sigma_floor: float) -> Float32Array:
    """z-scores (C,) of the similarities; zeros while there are too few for statistics."""
    if len(similarity) < min_cells:
        return np.zeros(len(similarity), dtype=np.float32)
    z: Float32Array = (similarity - similarity.mean()) / np.float32(max(float(similarity.std()), sigma_floor))
    return z


def filter_step(
    before: Evidence, z: Float32Array, links: Links, travelled: float, turned_rad: float, spacing: float, config: SequenceConfig
) -> Evidence:
    """F_t(j) = (1 - lambda) z_t(j) + lambda max(0, max over predecessors i of j of F_{t-1}(i)).

    A predecessor lies one driven step behind: a path of about ``travelled`` length and ``turned_rad`` leads from it to j.
    """
    filtered, predecessor = _propagate(
        before.filtered, z, links, travelled, turned_rad,
        config.length_tolerance * spacing, config.turn_tolerance_rad, np.float32(config.memory),
    )  # fmt: skip
    return Evidence(filtered, z, predecessor)


@njit(cache=True)
def _propagate(
    before: Float32Array, z: Float32Array, links: Links, travelled: float, turned_rad: float,
    length_tolerance: float, turn_tolerance_rad: float, memory: np.float32,
) -> tuple[Float32Array, IntArray]:  # fmt: skip
    filtered = np.empty(len(z), dtype=np.float32)
    predecessor = np.full(len(z), -1, dtype=np.int32)
    cells, lengths, turns = np.empty(WALK_LIMIT, dtype=np.int32), np.empty(WALK_LIMIT), np.empty(WALK_LIMIT)
    for j in range(len(z)):
        best = np.float32(0.0)
        for k in range(walk_back_into(links, j, travelled + length_tolerance, cells, lengths, turns)):
            i = cells[k]
            fits = abs(lengths[k] - travelled) <= length_tolerance and abs(turns[k] - turned_rad) <= turn_tolerance_rad
            if fits and i < len(before) and before[i] > best:
                best, predecessor[j] = before[i], i
        filtered[j] = (np.float32(1.0) - memory) * z[j] + memory * best
    return filtered, predecessor


def peak(evidence: Evidence, links: Links, reach: float) -> Peak:
    """The best cell and its margin over the best one farther than ``reach`` along the graph (0 when there is none)."""
    if len(evidence.filtered) == 0:
        return Peak(-1, 0.0)
    best = int(np.argmax(evidence.filtered))
    return Peak(best, margin_over(evidence.filtered, best, ~neighbourhood(links, best, reach)))


def margin_over(filtered: Float32Array, best: int, rivals: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> float:
    """Best minus best of the rivals (mask (C,)); 0 without rivals. A localizer with a metric map passes those > 15 m away."""
    if not rivals.any():
        return 0.0
    return float(filtered[best] - filtered[rivals].max())
