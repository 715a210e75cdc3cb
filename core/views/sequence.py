"""Sequence evidence: similarity scores of single views, filtered along the paths between view cells.

One view may look like a wrong place by chance. Several views in a row hardly do so along a path that exists. The filter therefore
adds to the score of each cell the evidence that the cells one driven step behind it had gathered. The mapper applies it to the
paths that it has driven, the localizer to all paths that the geometry of the finished map allows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.types import Float32Array, IntArray
from hippodrome.core.views.config import SequenceConfig
from hippodrome.core.views.graph import Links, Paths, Predecessors, empty_walk, neighbourhood, walk_back_into


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Filtered evidence for each cell after view t."""

    filtered: Float32Array  # (C,) F_t
    z_score: Float32Array  # (C,) z_t
    predecessor: IntArray  # (C,) cell of the view before, on the best path to this cell; -1: none


@dataclass(frozen=True, slots=True)
class Peak:
    """The cell with the most evidence, and how far it stands out."""

    cell: int  # -1: no cells
    margin: float  # its evidence minus that of the best cell outside its neighbourhood


class Step(NamedTuple):
    """Motion between two views, along a path or as driven."""

    length: float  # in the unit of the map: map units while mapping, metres while localizing
    turn_rad: float


NO_EVIDENCE = Evidence(np.zeros(0, dtype=np.float32), np.zeros(0, dtype=np.float32), np.zeros(0, dtype=np.int32))


def standardise(similarity: Float32Array, min_cells: int, sigma_floor: float) -> Float32Array:
    """z-scores (C,) of the similarities, by a standard deviation of at least ``sigma_floor``; zeros below ``min_cells`` cells."""
    if len(similarity) < min_cells:
        return np.zeros(len(similarity), dtype=np.float32)
    z: Float32Array = (similarity - similarity.mean()) / np.float32(max(float(similarity.std()), sigma_floor))
    return z


def filter_step(
    before: Evidence, z: Float32Array, links: Links, travelled: float, turned_rad: float, spacing: float, config: SequenceConfig
) -> Evidence:
    """Evidence for all C cells of a growing graph after one more view. See ``_evidence_at`` for the formula.

    Args:
        before: evidence after the view before; cells that were added since had none.
        z: z-scores (C,) of this view.
        links: the graph of the C cells.
        travelled: path length since the view before, in the unit of the links.
        turned_rad: turn since the view before.
        spacing: typical distance between views, in the unit of the links.
        config: memory and tolerances of the filter.
    """
    tolerance = Step(config.length_tolerance * spacing, config.turn_tolerance_rad)
    filtered, predecessor = _propagate_along(
        links, before.filtered, z, Step(travelled, turned_rad), tolerance, np.float32(config.memory)
    )
    return Evidence(filtered, z, predecessor)


@njit(cache=True)
def _propagate_along(
    links: Links, before: Float32Array, z: Float32Array, driven: Step, tolerance: Step, memory: np.float32
) -> tuple[Float32Array, IntArray]:
    """The compiled part of ``filter_step``: the evidence F_t (C,) of all cells, and their predecessors (C,), -1: none.

    For each cell the paths that lead to it are looked for in the graph, as the graph grows with every view.
    """
    filtered, predecessor = np.empty(len(z), dtype=np.float32), np.full(len(z), -1, dtype=np.int32)
    walk = empty_walk()
    for j in range(len(z)):
        count = walk_back_into(walk, links, j, driven.length + tolerance.length)
        filtered[j], predecessor[j] = _evidence_at(before, z[j], walk, 0, count, driven, tolerance, memory)
    return filtered, predecessor


@njit(cache=True)
def propagate(
    before: Float32Array,
    cells: IntArray,
    z: Float32Array,
    predecessors: Predecessors,
    driven: Step,
    tolerance: Step,
    memory: np.float32,
) -> Float32Array:
    """Evidence F_t (C,) on a finished map, whose paths are known beforehand; ``_evidence_at`` has the formula.

    Args:
        before: evidence F_{t-1} (C,) after the view before.
        cells: cells (K,) that this view was scored against; the other cells are left without evidence.
        z: z-scores (K,) of these cells.
        predecessors: the paths that lead to each of the C cells.
        driven: motion since the view before.
        tolerance: largest differences between the motion driven and a path.
        memory: lambda, the weight of the evidence so far, in [0, 1).
    """
    filtered = np.zeros_like(before)
    for n in range(len(cells)):
        first, last = predecessors.start[cells[n]], predecessors.start[cells[n] + 1]
        filtered[cells[n]], _ = _evidence_at(before, z[n], predecessors.paths, first, last, driven, tolerance, memory)
    return filtered


@njit(cache=True, inline="always")  # a call for each cell would take half as long again
def _evidence_at(
    before: Float32Array, z: np.float32, paths: Paths, first: int, last: int, driven: Step, tolerance: Step, memory: np.float32
) -> tuple[np.float32, int]:
    """Evidence of a cell j after view t, and the predecessor that it took evidence from, or -1.

        F_t(j) = (1 - memory) z_t(j) + memory max(0, max over predecessors i of j of F_{t-1}(i))

    The predecessors are the cells at which those of ``paths[first:last]`` begin that are as long as the distance driven and turn
    as the vehicle did. Cells beyond the end of ``before`` were added since and have no evidence. Of equal predecessors the first
    is taken.
    """
    best, predecessor = np.float32(0.0), -1
    for k in range(first, last):
        i = paths.source[k]
        as_long = abs(paths.length[k] - driven.length) <= tolerance.length
        fits = as_long and abs(paths.turn_rad[k] - driven.turn_rad) <= tolerance.turn_rad
        if fits and i < len(before) and before[i] > best:
            best, predecessor = before[i], i
    return (np.float32(1.0) - memory) * z + memory * best, predecessor


def peak(evidence: Evidence, links: Links, reach: float) -> Peak:
    """The cell with the most evidence, and its margin over the best cell elsewhere.

    Elsewhere is farther than ``reach`` along the graph; without such a cell the margin is 0.
    """
    if len(evidence.filtered) == 0:
        return Peak(-1, 0.0)
    best = int(np.argmax(evidence.filtered))
    return Peak(best, margin_over(evidence.filtered, best, ~neighbourhood(links, best, reach)))


def margin_over(filtered: Float32Array, best: int, rivals: NDArray[np.bool_]) -> float:
    """How far the best cell stands out: its evidence minus that of the best of the ``rivals`` (mask (C,)); 0 without rivals."""
    if not rivals.any():
        return 0.0
    return float(filtered[best] - filtered[rivals].max())
