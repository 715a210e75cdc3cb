"""Sparse nonlinear least squares: Gauss-Newton with a direct factorisation of the normal equations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, identity
from scipy.sparse.linalg import SuperLU, splu

from hippodrome.core.types import FloatArray, IntArray

Linearise: TypeAlias = Callable[[FloatArray], tuple[FloatArray, csr_array]]
HALVINGS = 8  # of a step that does not lower the cost; 2^-8 of a Gauss-Newton step is no progress worth having


@dataclass(frozen=True, slots=True)
class Solution:
    """Where Gauss-Newton stopped."""

    state: FloatArray  # (n,)
    cost: float  # half the sum of squared residuals
    iterations: int
    converged: bool
    information: csc_array  # (n, n) J^T J at the last linearisation


def gauss_newton(
    linearise: Linearise, state: FloatArray, *, max_iterations: int = 20, tolerance: float = 1e-6, damping: float = 0.0
) -> Solution:
    """Minimise half the squared norm of the residual that ``linearise`` returns with its Jacobian; III.B.4, Li et al. 2025.

    Steps that raise the cost are halved. Stops once no entry of a step exceeds ``tolerance``. ``damping`` adds a multiple of the
    identity to the normal equations: needed only where the problem leaves a direction undetermined.
    """
    residual, jacobian = linearise(state)
    cost, converged, iterations = _cost(residual), False, 0
    while not converged and iterations < max_iterations:
        iterations += 1
        step = factorise(_normal_matrix(jacobian, damping)).solve(-(jacobian.T @ residual))
        state, residual, jacobian, new_cost = _accept(linearise, state, residual, jacobian, step)
        converged = bool(np.max(np.abs(step), initial=0.0) <= tolerance) or new_cost == cost
        cost = new_cost
    return Solution(state, cost, iterations, converged, _normal_matrix(jacobian, 0.0))


def factorise(matrix: csc_array) -> SuperLU:
    """LU factors of a symmetric positive definite matrix; symmetric order, diagonal pivots: the work and fill of Cholesky."""
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def block_jacobian(blocks: list[tuple[FloatArray, IntArray]], state_size: int) -> csr_array:
    """Jacobian (E * m, state_size) of E residuals of m rows each.

    ``blocks``: for each variable that a residual depends on, its derivatives (E, m, p) and the index (E,) in the state at which
    that variable's p entries begin.
    """
    rows, columns, values = [], [], []
    for derivative, first in blocks:
        count, size, parameters = derivative.shape
        row = np.arange(count * size).reshape(count, size, 1)
        column = np.asarray(first, dtype=np.int64)[:, None, None] + np.arange(parameters)
        rows.append(np.broadcast_to(row, derivative.shape).ravel())
        columns.append(np.broadcast_to(column, derivative.shape).ravel())
        values.append(derivative.ravel())
    height = blocks[0][0].shape[0] * blocks[0][0].shape[1]
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return csr_array(coo_array(entries, shape=(height, state_size)))


def _normal_matrix(jacobian: csr_array, damping: float) -> csc_array:
    normal = csc_array(jacobian.T @ jacobian)
    return normal if damping == 0.0 else csc_array(normal + damping * identity(normal.shape[0], format="csc"))


def _accept(
    linearise: Linearise, state: FloatArray, residual: FloatArray, jacobian: csr_array, step: FloatArray
) -> tuple[FloatArray, FloatArray, csr_array, float]:
    """The longest halving of the step that does not raise the cost; the old state where there is none."""
    cost = _cost(residual)
    for halving in range(HALVINGS + 1):
        candidate = state + step * 0.5**halving
        new_residual, new_jacobian = linearise(candidate)
        if _cost(new_residual) <= cost:
            return candidate, new_residual, new_jacobian, _cost(new_residual)
    return state, residual, jacobian, cost


def _cost(residual: FloatArray) -> float:
    return 0.5 * float(residual @ residual)
