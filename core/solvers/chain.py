"""Normal equations of a chain of small blocks with a narrow border, solved directly in linear time.

The unknowns are V blocks of ``B`` (one per visit, coupled to the next) and ``G`` that every block may depend on (gyro gain and
bias). ``A = [[T, C], [C^T, D]]``: T block-tridiagonal, C (V, B, G), D (G, G). What couples distant blocks (loop closures) is
left to conjugate gradients, which this factorisation preconditions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit

from hippodrome.core.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ChainSystem:
    """Symmetric positive definite ``A`` and right-hand side."""

    diagonal: FloatArray  # (V, B, B)
    upper: FloatArray  # (V - 1, B, B) coupling of block i with block i + 1
    border: FloatArray  # (V, B, G)
    corner: FloatArray  # (G, G)
    rhs: FloatArray  # (V, B)
    rhs_border: FloatArray  # (G,)


@dataclass(frozen=True, slots=True, eq=False)
class ChainFactor:
    """Block LDL^T of ``T`` and the Schur complement of the border."""

    inverse_pivot: FloatArray  # (V, B, B)
    gain: FloatArray  # (V - 1, B, B)
    border: FloatArray  # (V, B, G)
    solved_border: FloatArray  # (V, B, G) T^-1 C
    inverse_corner: FloatArray  # (G, G) of the Schur complement


def factorise(system: ChainSystem) -> ChainFactor:
    inverse_pivot, gain = _factorise(system.diagonal, system.upper)
    solved = np.stack(
        [_solve(inverse_pivot, gain, np.ascontiguousarray(system.border[:, :, g])) for g in range(system.border.shape[2])],
        axis=-1,
    )
    schur = system.corner - np.einsum("vbg,vbh->gh", system.border, solved)
    return ChainFactor(inverse_pivot, gain, system.border, solved, np.linalg.inv(schur))


def solve(factor: ChainFactor, rhs: FloatArray, rhs_border: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``A^-1`` times a right-hand side (V, B), (G,)."""
    inner = _solve(factor.inverse_pivot, factor.gain, rhs)
    border = factor.inverse_corner @ (rhs_border - np.einsum("vbg,vb->g", factor.border, inner))
    return inner - factor.solved_border @ border, border


def marginals(factor: ChainFactor) -> tuple[FloatArray, FloatArray]:
    """Blocks of ``A^-1``: each block's own (V, B, B), and with its successor (V - 1, B, B)."""
    own, next_ = _marginals(factor.inverse_pivot, factor.gain)
    bordered = factor.solved_border @ factor.inverse_corner
    own = own + bordered @ np.swapaxes(factor.solved_border, 1, 2)
    next_ = next_ + bordered[:-1] @ np.swapaxes(factor.solved_border[1:], 1, 2)
    return own, next_


def multiply(system: ChainSystem, x: FloatArray, x_border: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``A`` times (V, B), (G,)."""
    product = np.einsum("vbc,vc->vb", system.diagonal, x) + system.border @ x_border
    product[:-1] += np.einsum("vbc,vc->vb", system.upper, x[1:])
    product[1:] += np.einsum("vcb,vc->vb", system.upper, x[:-1])
    return product, np.einsum("vbg,vb->g", system.border, x) + system.corner @ x_border


def solve_coupled(
    system: ChainSystem, couple: Callable[[FloatArray], FloatArray], tolerance: float, max_iterations: int
) -> tuple[FloatArray, FloatArray, ChainFactor]:
    """Solution of ``A + K``, ``couple(x) = K x`` positive semi-definite on the blocks, by preconditioned conjugate gradients.

    With K = 0 the first step is already exact.
    """
    factor = factorise(system)
    x, x_border = np.zeros_like(system.rhs), np.zeros_like(system.rhs_border)
    r, r_border = system.rhs, system.rhs_border
    z, z_border = solve(factor, r, r_border)
    p, p_border = z, z_border
    energy = first = float(np.sum(r * z) + r_border @ z_border)
    for _ in range(max_iterations):
        if energy <= tolerance**2 * first or energy == 0.0:
            break
        q, q_border = multiply(system, p, p_border)
        q = q + couple(p)
        alpha = energy / float(np.sum(p * q) + p_border @ q_border)
        x, x_border = x + alpha * p, x_border + alpha * p_border
        r, r_border = r - alpha * q, r_border - alpha * q_border
        z, z_border = solve(factor, r, r_border)
        last, energy = energy, float(np.sum(r * z) + r_border @ z_border)
        p, p_border = z + energy / last * p, z_border + energy / last * p_border
    return x, x_border, factor


@njit(cache=True)
def _inverse(a: FloatArray) -> FloatArray:
    """Inverse of a small symmetric positive definite matrix through its Cholesky factor."""
    n = a.shape[0]
    lower, inverse = np.zeros((n, n)), np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            total = a[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            lower[i, j] = np.sqrt(total) if i == j else total / lower[j, j]
    for column in range(n):
        for i in range(column, n):
            total = 1.0 if i == column else 0.0
            for k in range(column, i):
                total -= lower[i, k] * inverse[k, column]
            inverse[i, column] = total / lower[i, i]
    out = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(max(i, j), n):
                total += inverse[k, i] * inverse[k, j]
            out[i, j] = total
    return out


@njit(cache=True)
def _factorise(diagonal: FloatArray, upper: FloatArray) -> tuple[FloatArray, FloatArray]:
    count, n = diagonal.shape[0], diagonal.shape[1]
    inverse_pivot, gain = np.empty_like(diagonal), np.empty_like(upper)
    pivot = diagonal[0].copy()
    for v in range(count):
        inverse_pivot[v] = _inverse(pivot)
        if v == count - 1:
            break
        for i in range(n):
            for j in range(n):
                total = 0.0
                for k in range(n):
                    total += inverse_pivot[v, i, k] * upper[v, k, j]
                gain[v, i, j] = total
        for i in range(n):
            for j in range(n):
                total = diagonal[v + 1, i, j]
                for k in range(n):
                    total -= upper[v, k, i] * gain[v, k, j]
                pivot[i, j] = total
    return inverse_pivot, gain


@njit(cache=True)
def _solve(inverse_pivot: FloatArray, gain: FloatArray, rhs: FloatArray) -> FloatArray:
    count, n = rhs.shape
    y, x = rhs.copy(), np.empty_like(rhs)
    for v in range(1, count):
        for i in range(n):
            for k in range(n):
                y[v, i] -= gain[v - 1, k, i] * y[v - 1, k]
    for v in range(count - 1, -1, -1):
        for i in range(n):
            total = 0.0
            for k in range(n):
                total += inverse_pivot[v, i, k] * y[v, k]
                if v < count - 1:
                    total -= gain[v, i, k] * x[v + 1, k]
            x[v, i] = total
    return x


@njit(cache=True)
def _marginals(inverse_pivot: FloatArray, gain: FloatArray) -> tuple[FloatArray, FloatArray]:
    count, n = inverse_pivot.shape[0], inverse_pivot.shape[1]
    own, next_ = inverse_pivot.copy(), np.zeros_like(gain)
    for v in range(count - 2, -1, -1):
        for i in range(n):
            for j in range(n):
                total = 0.0
                for k in range(n):
                    total -= gain[v, i, k] * own[v + 1, k, j]
                next_[v, i, j] = total
        for i in range(n):
            for j in range(n):
                for k in range(n):
                    own[v, i, j] -= next_[v, i, k] * gain[v, j, k]
    return own, next_
