"""How alike a query view is to every stored one, at every small sideways shift: one dense operation over the whole bank.

"gradient" templates are compared by the cosine of their angle, once the mean of all views is subtracted: what all views of a town
share (road, horizon, haze) tells no place from another. "grey" ones are compared as RatSLAM does, by mean absolute difference.

In the order of use, by the mapper and the localizer alike: ``describe`` a frame, ``update_query_mean``, ``score`` against a
``ViewCellBank``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.types import Float32Array, IntArray, ViewCells
from hippodrome.core.views.config import Kind, ViewCellConfig
from hippodrome.core.views.descriptors import Descriptor

QUERY_SCALE = 2047.0  # largest entry of a query as int16: a sum of D products 127 * 2047 stays within int32 for D <= 8000


@dataclass(frozen=True, slots=True, eq=False)
class ViewCellBank:
    """Stored views (local view cells), ready to be scored against a query."""

    kind: Kind
    shape: tuple[int, ...]  # shape of a descriptor before flattening
    templates: Descriptor  # (C, D)
    mean: Float32Array  # (D,) what all views share
    inverse_norm: Float32Array  # (C,) 1 / |template - mean|; ones for "grey"


@dataclass(frozen=True, slots=True, eq=False)
class QueryMean:
    """Running mean of the latest query descriptors: what they all share, such as the present light. It tells no place."""

    mean: Float32Array  # (D,)
    count: int  # number of views in it; a mean from elsewhere counts for as many as it is trusted for


def bank_of(cells: ViewCells) -> ViewCellBank:
    """The stored views of a map as a bank, against which queries can be scored."""
    return make_bank(cells.kind, cells.shape, cells.templates, cells.mean)


def make_bank(kind: Kind, shape: tuple[int, ...], templates: Descriptor, mean: Float32Array) -> ViewCellBank:
    """A bank of templates (C, D) and their common mean (D,), with the inverse norms that the cosine needs."""
    inverse = np.ones(len(templates), dtype=np.float32)
    if kind == "gradient":
        norm = np.array([np.linalg.norm(template - mean) for template in templates])
        inverse = (1.0 / np.maximum(norm, 1.0)).astype(np.float32)
    return ViewCellBank(kind, shape, templates, mean, inverse)


def template_mean(kind: Kind, templates: Descriptor) -> Float32Array:
    """What all views (C, D) share, which scoring subtracts, (D,): their mean for "gradient"; zeros for "grey"."""
    if kind == "grey" or len(templates) == 0:
        return np.zeros(templates.shape[1], dtype=np.float32)
    mean: Float32Array = templates.mean(axis=0, dtype=np.float32)
    return mean


def start_query_mean(mean: Float32Array, count: int = 0) -> QueryMean:
    """A running mean that begins at ``mean`` (D,), trusted like the mean of ``count`` views."""
    return QueryMean(mean, count)


def update_query_mean(state: QueryMean, descriptor: Descriptor, config: ViewCellConfig) -> QueryMean:
    """The running mean of the queries, which ``score`` subtracts from each query, after one more view (D,).

    It is the plain average of the first ``mean_horizon`` views. Later it is an exponential average, which follows the light.
    """
    weight = np.float32(1.0 / min(state.count + 1, config.mean_horizon))
    return QueryMean(state.mean + weight * (descriptor - state.mean), state.count + 1)


def score(bank: ViewCellBank, descriptor: Descriptor, query_mean: QueryMean, config: ViewCellConfig) -> Float32Array:
    """Similarity of one query to all stored views at each sideways shift; higher is more alike.

    With q the query minus its running mean, shifted and of unit length, and t the template minus the bank's mean, a "gradient"
    score is the cosine q . t / |t|. It is computed as (q . template - q . mean) / |t|, the first product in whole numbers: fast,
    and exact in whatever order it is summed. A "grey" score is minus the mean absolute difference.

    Args:
        bank: C stored views.
        descriptor: the query, (D,).
        query_mean: running mean of the latest queries.
        config: how views are compared; its ``max_shift`` is used.

    Returns:
        (C, 2 max_shift + 1). Column ``max_shift + s`` compares the query moved ``s`` columns to the right; the best shift is
        positive when the query looks further right than the template.
    """
    if bank.kind == "grey":
        grey: Float32Array = _negative_absolute_difference(bank.templates, descriptor, config.max_shift, bank.shape[1])
        return grey
    queries = shifted_queries(descriptor - query_mean.mean, bank.shape, config.max_shift)
    scale = QUERY_SCALE / np.maximum(np.abs(queries).max(), 1e-6)
    whole = np.rint(queries * scale).astype(np.int16)
    offset = (whole @ bank.mean) / scale
    cosine: Float32Array = (_dot_products(bank.templates, whole) / np.float32(scale) - offset) * bank.inverse_norm[:, None]
    return cosine.astype(np.float32, copy=False)


def best_over_shifts(scores: Float32Array, max_shift: int) -> tuple[Float32Array, IntArray]:
    """Each template's best score (C,), and the shift (C,) in columns that reached it; of equal scores the smallest shift wins."""
    order = np.argsort(np.abs(np.arange(-max_shift, max_shift + 1)), kind="stable")
    column = order[np.argmax(scores[:, order], axis=1)]
    return scores[np.arange(len(scores)), column], (column - max_shift).astype(np.int32)


def shifted_queries(query: Float32Array, shape: tuple[int, ...], max_shift: int) -> Float32Array:
    """Copies (2 max_shift + 1, D) of a mean-free query (D,) as the vehicle would see it with a slightly different heading.

    The copies are moved sideways by -``max_shift`` to ``max_shift`` columns and normalised to unit length, so that their products
    with unit templates are cosines. Columns that a shift opens up are filled with zeros, which is the mean.
    """
    image, columns = query.reshape(shape), shape[0]
    moved = np.zeros((2 * max_shift + 1, *shape), dtype=np.float32)
    for row, shift in enumerate(range(-max_shift, max_shift + 1)):
        moved[row, max(0, shift) : columns + min(0, shift)] = image[max(0, -shift) : columns - max(0, shift)]
    flat = moved.reshape(len(moved), -1)
    norm = np.linalg.norm(flat, axis=1, keepdims=True)
    unit: Float32Array = flat / np.maximum(norm, np.float32(1e-6))
    return unit


@njit(cache=True)
def _dot_products(templates: Descriptor, queries: NDArray[np.int16]) -> Float32Array:
    """Dot products (C, S) of int8 templates (C, D) and int16 queries (S, D).

    Integers are summed, so that the result does not depend on the order of summation.
    """
    count, size = templates.shape
    products = np.empty((count, queries.shape[0]), dtype=np.float32)
    for i in range(count):
        for s in range(queries.shape[0]):
            total = np.int32(0)
            for d in range(size):
                total = np.int32(total + np.int16(templates[i, d]) * queries[s, d])
            products[i, s] = total
    return products


@njit(cache=True)
def _negative_absolute_difference(templates: Descriptor, query: Descriptor, max_shift: int, rows: int) -> Float32Array:
    """Minus the mean absolute difference of each template (C, columns * rows) and the query, over the columns that overlap.

    Returns (C, 2 max_shift + 1), a column for each shift of the query.
    """
    count, size = templates.shape
    scores = np.empty((count, 2 * max_shift + 1), dtype=np.float32)
    for i in range(count):
        for s in range(-max_shift, max_shift + 1):
            template = templates[i, max(0, s) * rows : size + min(0, s) * rows]
            image = query[max(0, -s) * rows : size - max(0, s) * rows]
            total = np.int32(0)
            for d in range(len(template)):
                total = np.int32(total + abs(np.int32(template[d]) - np.int32(image[d])))
            scores[i, s + max_shift] = -np.float32(total) / np.float32(len(template))
    return scores
