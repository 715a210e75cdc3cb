"""Finding views among very many: a small sketch of each view picks the candidates, and only those are scored in full.

A view's sketch is its projection onto the directions in which the map's views differ most (principal components). Up to
``exhaustive_cells`` every view is scored and there is no index. The cells that the present hypotheses lead to are candidates
always, so that a sketch that misses may delay a new hypothesis but never lose one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import Any, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.types import Float32Array, Int8Array, IntArray
from hippodrome.core.views.config import SearchConfig, ViewCellConfig
from hippodrome.core.views.descriptors import Descriptor
from hippodrome.core.views.scoring import QUERY_SCALE, QueryMean, ViewCellBank, score, shifted_queries

CHUNK = 8192  # views projected at once: bounds the memory while the index is made

Query: TypeAlias = tuple[Descriptor, QueryMean]  # a descriptor (D,), and the running mean to subtract from it


@dataclass(frozen=True, slots=True, eq=False)
class ViewIndex:
    """Sketches of C views in S dimensions."""

    basis: Float32Array  # (D, S) principal directions, each times the largest projection of a view on it
    sketch: Int8Array  # (C, S) projections over that largest one, as -127 to 127
    sample: IntArray  # cells whose scores stand for all in the statistics


@dataclass(frozen=True, slots=True, eq=False)
class ScoredViews:
    """K views scored in full against a query, and the mean and spread that the scores of all views have."""

    cells: IntArray  # (K,) ascending
    similarity: Float32Array  # (K,) best over the sideways shifts
    mean: float
    spread: float  # standard deviation


def index_of(bank: ViewCellBank, config: SearchConfig) -> ViewIndex | None:
    """The index of a bank; None where exhaustive search is as fast, or the views are "grey" and have no sketches."""
    count = len(bank.templates)
    if bank.kind != "gradient" or count <= config.exhaustive_cells:
        return None
    typical = _unit_rows(bank, _evenly_spread(count, 4 * bank.templates.shape[1]))  # 4 views per dimension: a stable covariance
    _, directions = np.linalg.eigh(typical.T @ typical)
    basis: Float32Array = directions[:, : -config.sketch_size - 1 : -1].astype(np.float32)
    chunks = [np.arange(first, min(first + CHUNK, count)) for first in range(0, count, CHUNK)]
    projected = np.concatenate([_unit_rows(bank, chunk) @ basis for chunk in chunks])
    largest = np.abs(projected).max(axis=0)
    sketch = np.rint(projected * (127.0 / largest)).astype(np.int8)
    return ViewIndex(basis * largest, sketch, _evenly_spread(count, config.sample))


def search(
    bank: ViewCellBank, index: ViewIndex | None, expected: IntArray, query: Query, views: ViewCellConfig, config: SearchConfig
) -> ScoredViews:
    """Score a query against the expected cells and against all whose sketches resemble its own.

    Args:
        bank: the stored views.
        index: their sketches; None scores every view.
        expected: cells that are scored whatever their sketch, in any order, repeated or not.
        query: a descriptor and the running mean to subtract from it.
        views: how views are compared.
        config: how many candidates there are.
    """
    if index is None:
        everything = _best_shift(score(bank, *query, views))
        cells = np.arange(len(everything), dtype=np.int32)
        return ScoredViews(cells, everything, float(everything.mean()), float(everything.std()))
    wanted, sampled = np.zeros((2, len(bank.templates)), dtype=np.bool_)
    wanted[candidates(bank, index, query, views, config.candidates)] = True
    wanted[expected] = True
    sampled[index.sample] = True
    scored = np.flatnonzero(wanted | sampled).astype(np.int32)
    part = ViewCellBank(bank.kind, bank.shape, bank.templates[scored], bank.mean, bank.inverse_norm[scored])
    similarity = _best_shift(score(part, *query, views))
    sample, asked = similarity[sampled[scored]], wanted[scored]
    return ScoredViews(scored[asked], similarity[asked], float(sample.mean()), float(sample.std()))


def candidates(bank: ViewCellBank, index: ViewIndex, query: Query, views: ViewCellConfig, count: int) -> IntArray:
    """The ``count`` cells whose sketches are most like the query's at any sideways shift, in no order."""
    descriptor, query_mean = query
    shifted = shifted_queries(descriptor - query_mean.mean, bank.shape, views.max_shift)
    projected = shifted @ index.basis
    whole = np.rint(projected * (QUERY_SCALE / max(float(np.abs(projected).max()), 1e-6))).astype(np.int16)
    similarity = _sketch_similarity(index.sketch, whole)
    return np.argpartition(-similarity, count)[:count].astype(np.int32)


def _best_shift(scores: Float32Array) -> Float32Array:
    """The largest score (C,) over the shifts of (C, S), taken shift by shift: many times faster than view by view."""
    best: Float32Array = reduce(np.maximum, scores.T)
    return best


def _unit_rows(bank: ViewCellBank, cells: NDArray[Any]) -> Float32Array:
    """The mean-free views of n cells, each of unit length, (n, D)."""
    rows: Float32Array = (bank.templates[cells] - bank.mean) * bank.inverse_norm[cells, None]
    return rows


def _evenly_spread(count: int, wanted: int) -> IntArray:
    """At most ``wanted`` of ``count`` cells, evenly spread, none twice."""
    return np.unique(np.linspace(0, count - 1, min(count, wanted)).astype(np.int32))


@njit(cache=True)
def _sketch_similarity(sketch: Int8Array, queries: NDArray[np.int16]) -> IntArray:
    """Similarity (C,) of each sketch (C, S) to a query: the largest dot product with any of its shifted copies (Q, S).

    Integers are summed, so that the result does not depend on the order of summation.
    """
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
