"""Normal equations of a chain of small blocks with a narrow border, solved in time linear in the length of the chain.

The unknowns are V blocks of B (one block per keyframe, coupled to the next one) and G further ones that every block may depend on
(a gyro's gain and bias). Their symmetric positive definite matrix is

    A = [[T, C], [C^T, D]],    T block-tridiagonal with diagonal blocks T_v and couplings U_v to block v + 1,

a bordered block-tridiagonal ("arrowhead") matrix. The methods, each written as one recursion at its function:

- block LDL^T of T, also called the block Thomas algorithm (Golub and Van Loan, Matrix Computations, 4th ed. 2013, section 4.5);
- the border by its Schur complement (Boyd and Vandenberghe, Convex Optimization, 2004, appendix C.4);
- diagonal and neighbouring blocks of A^-1, which are marginal covariances, by the Takahashi recursion (Takahashi, Fagan, Chin
  1973); for a chain it is the backward pass of a Rauch-Tung-Striebel smoother (Rauch, Tung, Striebel 1965);
- couplings of distant blocks (loop closures) by conjugate gradients, preconditioned with this factorisation (Saad, Iterative
  Methods for Sparse Linear Systems, 2nd ed. 2003, algorithm 9.1).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit

from hippodrome.core.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ChainSystem:
    """The matrix A, symmetric positive definite, and a right-hand side."""

    diagonal: FloatArray  # (V, B, B) T_v
    upper: FloatArray  # (V - 1, B, B) U_v: coupling of block v with block v + 1
    border: FloatArray  # (V, B, G) C
    corner: FloatArray  # (G, G) D
    rhs: FloatArray  # (V, B) right-hand side of the blocks
    rhs_border: FloatArray  # (G,) right-hand side of the border


@dataclass(frozen=True, slots=True, eq=False)
class ChainFactor:
    """Block LDL^T of T and the Schur complement of the border."""

    inverse_pivot: FloatArray  # (V, B, B) P_v^-1
    gain: FloatArray  # (V - 1, B, B) G_v = P_v^-1 U_v; the smoother gain of a Rauch-Tung-Striebel pass, but for its sign
    border: FloatArray  # (V, B, G) C
    solved_border: FloatArray  # (V, B, G) T^-1 C
    inverse_corner: FloatArray  # (G, G) S^-1, S = D - C^T T^-1 C


def factorise(system: ChainSystem) -> ChainFactor:
    """Block LDL^T of T, and the Schur complement S = D - C^T T^-1 C of the border."""
    inverse_pivot, gain = _factorise_blocks(system.diagonal, system.upper)
    solved = np.stack(
        [_solve_blocks(inverse_pivot, gain, np.ascontiguousarray(system.border[:, :, g])) for g in range(system.border.shape[2])],
        axis=-1,
    )
    schur = system.corner - np.einsum("vbg,vbh->gh", system.border, solved)
    return ChainFactor(inverse_pivot, gain, system.border, solved, np.linalg.inv(schur))


def solve(factor: ChainFactor, rhs: FloatArray, rhs_border: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A^-1 times a right-hand side (b, c), by block elimination: z = S^-1 (c - C^T T^-1 b), x = T^-1 b - T^-1 C z.

    Args:
        factor: the factorised matrix A.
        rhs: right-hand side b of the blocks, (V, B).
        rhs_border: right-hand side c of the border, (G,).

    Returns:
        The solution: its blocks x (V, B) and its border z (G,).
    """
    inner = _solve_blocks(factor.inverse_pivot, factor.gain, rhs)
    border = factor.inverse_corner @ (rhs_border - np.einsum("vbg,vb->g", factor.border, inner))
    return inner - factor.solved_border @ border, border


def marginals(factor: ChainFactor) -> tuple[FloatArray, FloatArray]:
    """Blocks of A^-1: the blocks of T^-1 plus, as the border is estimated too, T^-1 C S^-1 (T^-1 C)^T.

    Returns:
        Each block's own covariance (V, B, B), and its cross-covariance with the next block (V - 1, B, B).
    """
    own, next_ = _marginal_blocks(factor.inverse_pivot, factor.gain)
    bordered = factor.solved_border @ factor.inverse_corner
    own = own + bordered @ np.swapaxes(factor.solved_border, 1, 2)
    next_ = next_ + bordered[:-1] @ np.swapaxes(factor.solved_border[1:], 1, 2)
    return own, next_


def multiply(system: ChainSystem, x: FloatArray, x_border: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The product of the matrix A and a vector of blocks ``x`` (V, B) and border ``x_border`` (G,), in the same two parts."""
    product = np.einsum("vbc,vc->vb", system.diagonal, x) + system.border @ x_border
    product[:-1] += np.einsum("vbc,vc->vb", system.upper, x[1:])
    product[1:] += np.einsum("vcb,vc->vb", system.upper, x[:-1])
    return product, np.einsum("vbg,vb->g", system.border, x) + system.corner @ x_border


def solve_coupled(
    system: ChainSystem, couple: Callable[[FloatArray], FloatArray], tolerance: float, max_iterations: int
) -> tuple[FloatArray, FloatArray, ChainFactor]:
    """Solution of (A + K) x = b by conjugate gradients, preconditioned with A: r residual, z = A^-1 r, p search direction.

        alpha = r.z / p.(A + K) p,    x += alpha p,    r -= alpha (A + K) p,    beta = new r.z / old r.z,    p = z + beta p

    K couples distant blocks and leaves A + K positive definite. With K = 0 the first iteration is exact already.

    Args:
        system: A and b.
        couple: (V, B) -> (V, B), the product K x.
        tolerance: iterations end when r.z has fallen to ``tolerance**2`` of its first value.
        max_iterations: iterations at most; the solution so far is returned then.

    Returns:
        The blocks (V, B) and the border (G,) of x, and the factor of A.
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
def _factorise_blocks(diagonal: FloatArray, upper: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Factorise the block-tridiagonal matrix T as L diag(P_v) L^T, where L is unit lower block-bidiagonal with blocks G_v^T.

        P_0 = T_0,    G_v = P_v^-1 U_v,    P_{v+1} = T_{v+1} - U_v^T G_v

    Args:
        diagonal: T_v (V, B, B).
        upper: U_v (V - 1, B, B).

    Returns:
        All P_v^-1 (V, B, B) and all G_v (V - 1, B, B).
    """
    inverse_pivot, gain = np.empty_like(diagonal), np.empty_like(upper)
    pivot = diagonal[0].copy()
    for v in range(len(diagonal)):
        inverse_pivot[v] = _inverse(pivot)
        if v < len(upper):
            _multiply_into(gain[v], inverse_pivot[v], upper[v])
            pivot[:] = diagonal[v + 1]
            _subtract_product(pivot, upper[v].T, gain[v])
    return inverse_pivot, gain


@njit(cache=True)
def _solve_blocks(inverse_pivot: FloatArray, gain: FloatArray, rhs: FloatArray) -> FloatArray:
    """Solve T x = b for x (V, B), with T factorised by ``_factorise_blocks``.

    Forwards y_v = b_v - G_{v-1}^T y_{v-1}, then backwards x_v = P_v^-1 y_v - G_v x_{v+1}.
    """
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
def _marginal_blocks(inverse_pivot: FloatArray, gain: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Blocks of Sigma = T^-1, backwards from Sigma_{V-1,V-1} = P_{V-1}^-1 (Takahashi recursion, the smoother's covariances).

        Sigma_{v,v+1} = -G_v Sigma_{v+1,v+1},    Sigma_{v,v} = P_v^-1 - Sigma_{v,v+1} G_v^T

    Returns all Sigma_{v,v} and all Sigma_{v,v+1}.
    """
    own, next_ = inverse_pivot.copy(), np.zeros_like(gain)
    for v in range(len(gain) - 1, -1, -1):
        _subtract_product(next_[v], gain[v], own[v + 1])
        _subtract_product(own[v], next_[v], gain[v].T)
    return own, next_


@njit(cache=True)
def _inverse(a: FloatArray) -> FloatArray:
    """Inverse of a small symmetric positive definite matrix A (n, n) = L L^T from its Cholesky factor L: L^-T L^-1."""
    n = a.shape[0]
    inverse_lower = _inverse_of_lower(_cholesky(a))
    out = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(max(i, j), n):
                total += inverse_lower[k, i] * inverse_lower[k, j]
            out[i, j] = total
    return out


@njit(cache=True, inline="always")
def _cholesky(a: FloatArray) -> FloatArray:
    """Lower triangular L with L L^T = A, row by row (``np.linalg.cholesky`` costs more than this on 4 x 4)."""
    n = a.shape[0]
    lower = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            total = a[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            lower[i, j] = np.sqrt(total) if i == j else total / lower[j, j]
    return lower


@njit(cache=True, inline="always")
def _inverse_of_lower(lower: FloatArray) -> FloatArray:
    """Inverse of a small lower triangular matrix L (n, n), by forward substitution, column by column."""
    n = lower.shape[0]
    inverse = np.zeros((n, n))
    for column in range(n):
        for i in range(column, n):
            total = 1.0 if i == column else 0.0
            for k in range(column, i):
                total -= lower[i, k] * inverse[k, column]
            inverse[i, column] = total / lower[i, i]
    return inverse


@njit(cache=True, inline="always")
def _multiply_into(out: FloatArray, a: FloatArray, b: FloatArray) -> None:
    """out = A B."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            total = 0.0
            for k in range(a.shape[1]):
                total += a[i, k] * b[k, j]
            out[i, j] = total


@njit(cache=True, inline="always")
def _subtract_product(out: FloatArray, a: FloatArray, b: FloatArray) -> None:
    """out -= A B."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            total = out[i, j]
            for k in range(a.shape[1]):
                total -= a[i, k] * b[k, j]
            out[i, j] = total
