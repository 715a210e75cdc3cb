"""Finding views among very many: a small sketch of each picks the candidates, and only those are scored in full.

The sketch is the view's projection onto the directions in which the map's views differ most. Below ``exhaustive_cells`` every
view is scored. The cells that the current hypotheses lead to are candidates always, so that a sketch can start a hypothesis
late but never loses one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import Any, ClassVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.types import Float32Array, Int8Array, IntArray
from hippodrome.core.views import descriptors as view_cells
from hippodrome.core.views.descriptors import (
    Descriptor,
    QueryMean,
    ViewCellBank,
    ViewCellConfig,
)

CHUNK = 8192  # views projected at once: bounds the memory while the index is made


@dataclass(frozen=True)
class SearchConfig:
    """How much of the exhaustive search is spared."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    exhaustive_cells: int = 12_000  # up to here scoring all views is as fast: 4 ms
    sketch_size: int = 96  # bytes per view; 32 lose one best match in ten, 64 one in fifty, 128 one in two hundred
    candidates: int = 2_000  # best sketches, scored in full: one in fifty at 100,000 views
    hypotheses: int = 256  # best cells of the look before, whose successors are candidates too
    sample: int = 2_000  # views, evenly spread, that the statistics of all are taken from: 2 % of a standard deviation

    def __post_init__(self) -> None:
        if min(self.exhaustive_cells, self.sketch_size, self.candidates, self.hypotheses, self.sample) < 1:
            raise ValueError("search: exhaustive_cells, sketch_size, candidates, hypotheses and sample must be at least 1")


@dataclass(frozen=True, slots=True, eq=False)
class ViewIndex:
    """Sketches of C views in S dimensions."""

    basis: Float32Array  # (D, S), each direction scaled by its range among the views
    sketch: Int8Array  # (C, S)
    sample: IntArray  # cells for the statistics


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """K views scored in full, and the mean and spread of all."""

    cells: IntArray  # (K,) ascending
    similarity: Float32Array  # (K,) best over the sideways shifts
    mean: float
    spread: float


def index_of(bank: ViewCellBank, config: SearchConfig) -> ViewIndex | None:
    """The index of a bank that is worth one."""
    count = len(bank.templates)
    if bank.kind != "gradient" or count <= config.exhaustive_cells:
        return None
    typical = _unit_rows(bank, _spread_evenly(count, 4 * bank.templates.shape[1]))  # 4 views per dimension: a stable covariance
    _, directions = np.linalg.eigh(typical.T @ typical)
    basis: Float32Array = directions[:, : -config.sketch_size - 1 : -1].astype(np.float32)
    chunks = [np.arange(first, min(first + CHUNK, count)) for first in range(0, count, CHUNK)]
    projected = np.concatenate([_unit_rows(bank, chunk) @ basis for chunk in chunks])
    reach = np.abs(projected).max(axis=0)
    sketch = np.rint(projected * (127.0 / reach)).astype(np.int8)
    return ViewIndex(basis * reach, sketch, _spread_evenly(count, config.sample))


def search(
    bank: ViewCellBank,
    index: ViewIndex | None,
    expected: IntArray,
    query: tuple[Descriptor, QueryMean],
    views: ViewCellConfig,
    config: SearchConfig,
) -> Found:
    """Score the query, a descriptor and the running mean, against ``expected`` cells and all that its sketch resembles."""
    if index is None:
        everything = _best_shift(view_cells.score(bank, *query, views))
        cells = np.arange(len(everything), dtype=np.int32)
        return Found(cells, everything, float(everything.mean()), float(everything.std()))
    wanted, sampled = np.zeros((2, len(bank.templates)), dtype=np.bool_)
    wanted[candidates(bank, index, query, views, config.candidates)] = True
    wanted[expected] = True
    sampled[index.sample] = True
    scored = np.flatnonzero(wanted | sampled).astype(np.int32)
    part = ViewCellBank(bank.kind, bank.shape, bank.templates[scored], bank.mean, bank.inverse_norm[scored])
    similarity = _best_shift(view_cells.score(part, *query, views))
    sample, asked = similarity[sampled[scored]], wanted[scored]
    return Found(scored[asked], similarity[asked], float(sample.mean()), float(sample.std()))


def candidates(
    bank: ViewCellBank, index: ViewIndex, query: tuple[Descriptor, QueryMean], views: ViewCellConfig, count: int
) -> IntArray:
    """The ``count`` cells whose sketches are most like the query's at any sideways shift."""
    descriptor, query_mean = query
    shifted = view_cells.shifted_queries(descriptor - query_mean.mean, bank.shape, views.max_shift)
    projected = shifted @ index.basis
    whole = np.rint(projected * (view_cells.QUERY_SCALE / max(float(np.abs(projected).max()), 1e-6))).astype(np.int16)
    likeness = _sketch_likeness(index.sketch, whole)
    return np.argpartition(-likeness, count)[:count].astype(np.int32)


def _best_shift(scores: Float32Array) -> Float32Array:
    """The largest (C,) over the shifts of (C, S): column by column, many times faster than row by row."""
    best: Float32Array = reduce(np.maximum, scores.T)
    return best


def _unit_rows(bank: ViewCellBank, cells: NDArray[Any]) -> Float32Array:
    """Mean-free views of unit length (n, D)."""
    rows: Float32Array = (bank.templates[cells] - bank.mean) * bank.inverse_norm[cells, None]
    return rows


def _spread_evenly(count: int, wanted: int) -> IntArray:
    """At most ``wanted`` cells of ``count``, evenly spread, none twice."""
    return np.unique(np.linspace(0, count - 1, min(count, wanted)).astype(np.int32))


@njit(cache=True)
def _sketch_likeness(sketch: Int8Array, queries: NDArray[np.int16]) -> IntArray:
    """(C,) largest product of each sketch (C, S) with any of the queries (Q, S): integers, whatever the order."""
    count, size = sketch.shape
    best = np.empty(count, dtype=np.int32)
    for i in range(count):
        largest = np.int32(-(2**31) + 1)
        for q in range(queries.shape[0]):
            total = np.int32(0)
            for d in range(size):
                total = np.int32(total + np.int16(sketch[i, d]) * queries[q, d])
            largest = max(largest, total)
        best[i] = largest
    return best
