"""Costs of the topometric map, Eqs. (10)-(12), Li et al. 2025, as residuals with Jacobians. The state is the poses, row by row.

The paper prints sums of norms and solves "the least squares problem based on (12)"; here each norm is squared, as that needs.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, vstack

from hippodrome.core import se2
from hippodrome.core.solvers.gauss_newton import block_jacobian
from hippodrome.core.types import FloatArray, IntArray

POSE_SIZE = 3


def global_residual(poses: FloatArray, vertex: IntArray, matched_m: FloatArray) -> tuple[FloatArray, csr_array]:
    """Eq. (10), Li et al. 2025: p_t - z_t for the matched vertices (K,) and their matched positions (K, 2). Metres."""
    residual = (poses[vertex, :2] - matched_m).ravel()
    derivative = np.broadcast_to(np.eye(2, POSE_SIZE), (len(vertex), 2, POSE_SIZE))
    return residual, block_jacobian([(derivative, POSE_SIZE * vertex)], poses.size)


def local_residual(
    poses: FloatArray, source: IntArray, target: IntArray, motion: FloatArray, sigma: FloatArray
) -> tuple[FloatArray, csr_array]:
    """Eq. (11), Li et al. 2025: (R_a^T (p_b - p_a) - p_ab, warp(psi_b - psi_a - psi_ab)) over sigma.

    ``motion`` and ``sigma`` (E, 3) along, across, heading: Sigma is diagonal, so the Mahalanobis norm is that quotient's norm.
    """
    a, b = poses[source], poses[target]
    seen = se2.between(a, b)
    residual = np.concatenate([seen[:, :2] - motion[:, :2], se2.wrap(seen[:, 2:] - motion[:, 2:])], axis=1) / sigma
    cos, sin, zero, one = np.cos(a[:, 2]), np.sin(a[:, 2]), np.zeros(len(a)), np.ones(len(a))
    by_target = np.array([[cos, sin, zero], [-sin, cos, zero], [zero, zero, one]]).transpose(2, 0, 1)
    by_source = -by_target.copy()
    by_source[:, 0, 2], by_source[:, 1, 2] = seen[:, 1], -seen[:, 0]
    blocks = [(by_source / sigma[:, :, None], POSE_SIZE * source), (by_target / sigma[:, :, None], POSE_SIZE * target)]
    return residual.ravel(), block_jacobian(blocks, poses.size)


def total_residual(
    local: tuple[FloatArray, csr_array], global_: tuple[FloatArray, csr_array], local_weight: float, global_weight: float
) -> tuple[FloatArray, csr_array]:
    """Eq. (12), Li et al. 2025: w_l F + w_g G, both as least squares; half the squared norm of the result is half of J."""
    w_l, w_g = np.sqrt(local_weight), np.sqrt(global_weight)
    residual = np.concatenate([w_l * local[0], w_g * global_[0]])
    return residual, csr_array(vstack([w_l * local[1], w_g * global_[1]]))
