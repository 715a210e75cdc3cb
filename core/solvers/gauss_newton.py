"""Sparse nonlinear least squares: Gauss-Newton with a direct factorisation of the normal equations.

Source: Nocedal and Wright, Numerical Optimization, 2nd ed. 2006, section 10.3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, identity
from scipy.sparse.linalg import SuperLU, splu

from hippodrome.core.types import FloatArray, HippodromeError, IntArray

Linearise: TypeAlias = Callable[[FloatArray], tuple[FloatArray, csr_array]]
HALVINGS = 8  # how often a step that raises the cost is halved; 2^-8 of a Gauss-Newton step is no progress worth having


@dataclass(frozen=True, slots=True, eq=False)
class GaussNewtonResult:
    """Where Gauss-Newton stopped."""

    state: FloatArray  # (n,)
    cost: float  # half the sum of squared residuals
    iterations: int
    converged: bool  # the last step was smaller than the tolerance, or lowered the cost no more


def gauss_newton(
    linearise: Linearise, state: FloatArray, *, max_iterations: int = 20, tolerance: float = 1e-6, damping: float = 0.0
) -> GaussNewtonResult:
    """Minimise |r(x)|^2 / 2 by steps (J^T J + damping I) dx = -J^T r; III.B.4, Li et al. 2025. Steps that raise it are halved.

    Args:
        linearise: state (n,) -> residual r (m,) and its Jacobian J (m, n).
        state: where the search begins, (n,).
        max_iterations: steps at most.
        tolerance: the search ends once no entry of a step exceeds this, in the state's own units.
        damping: needed only where the problem leaves a direction undetermined; 0 is plain Gauss-Newton.
    """
    residual, jacobian = linearise(state)
    cost, converged, iterations = _cost(residual), False, 0
    while not converged and iterations < max_iterations:
        iterations += 1
        step = factorise(_normal_matrix(jacobian, damping)).solve(-(jacobian.T @ residual))
        state, residual, jacobian, new_cost = _accept(linearise, state, residual, jacobian, step)
        converged = bool(np.max(np.abs(step), initial=0.0) <= tolerance) or new_cost == cost
        cost = new_cost
    return GaussNewtonResult(state, cost, iterations, converged)


def factorise(matrix: csc_array) -> SuperLU:
    """Sparse factors of a symmetric positive definite matrix.

    SciPy has no sparse Cholesky: this LU keeps its pivots on the diagonal and one order for rows and columns, and so costs and
    fills in no more than Cholesky would.

    Raises:
        HippodromeError: The matrix is singular.
    """
    try:
        return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError as error:  # SciPy has no other one for it
        raise HippodromeError(
            f"the poses of the drive cannot be told from its measurements ({error}): distances or errors are all but zero; "
            "check the speeds and their unit"
        ) from error


def block_jacobian(blocks: list[tuple[FloatArray, IntArray]], state_size: int) -> csr_array:
    """Sparse Jacobian (E * m, state_size) of E residuals of m rows each, from dense blocks.

    Args:
        blocks: for each variable that a residual depends on (an edge's two poses, say), the derivatives (E, m, p) of all
            residuals by that variable, and the index (E,) in the state at which the variable's p entries begin.
        state_size: entries of the state.
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
    """The matrix J^T J + damping I of the normal equations."""
    normal = csc_array(jacobian.T @ jacobian)
    return normal if damping == 0.0 else csc_array(normal + damping * identity(normal.shape[0], format="csc"))


def _accept(
    linearise: Linearise, state: FloatArray, residual: FloatArray, jacobian: csr_array, step: FloatArray
) -> tuple[FloatArray, FloatArray, csr_array, float]:
    """Take the step, halved as often as is needed for the cost not to rise: the state with its residual, Jacobian and cost.

    If even the shortest step raises the cost, everything stays as it was.
    """
    cost = _cost(residual)
    for halving in range(HALVINGS + 1):
        candidate = state + step * 0.5**halving
        new_residual, new_jacobian = linearise(candidate)
        if _cost(new_residual) <= cost:
            return candidate, new_residual, new_jacobian, _cost(new_residual)
    return state, residual, jacobian, cost


def _cost(residual: FloatArray) -> float:
    """Half the sum of squared residuals (m,): what Gauss-Newton minimises."""
    return 0.5 * float(residual @ residual)
