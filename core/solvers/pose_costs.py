"""Costs of the topometric map, Eqs. (10)-(12), Li et al. 2025, as residuals with sparse Jacobians.

The state that the Jacobians refer to is the poses (V, 3), flattened row by row. The paper prints sums of norms and then solves
"the least squares problem based on (12)"; least squares needs the norms squared, and so they are here.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, vstack

from hippodrome.core import se2
from hippodrome.core.solvers.gauss_newton import block_jacobian
from hippodrome.core.types import FloatArray, IntArray

POSE_SIZE = 3


def global_residual(poses: FloatArray, vertex: IntArray, matched_m: FloatArray) -> tuple[FloatArray, csr_array]:
    """Eq. (10), Li et al. 2025: r_t = p_t - z_t, the vector to a vertex from its matched position on the road.

    Args:
        poses: (V, 3) m, m, rad.
        vertex: the matched vertices t, (K,).
        matched_m: their matched positions z_t on the road, (K, 2).

    Returns:
        Residual (2 K,) in metres and its Jacobian (2 K, 3 V).
    """
    residual = (poses[vertex, :2] - matched_m).ravel()
    derivative = np.broadcast_to(np.eye(2, POSE_SIZE), (len(vertex), 2, POSE_SIZE))
    return residual, block_jacobian([(derivative, POSE_SIZE * vertex)], poses.size)


def local_residual(
    poses: FloatArray, source: IntArray, target: IntArray, motion: FloatArray, sigma: FloatArray
) -> tuple[FloatArray, csr_array]:
    """Eq. (11), Li et al. 2025: r_ab = Sigma^(-1/2) (R_a^T (p_b - p_a) - p_ab, warp(psi_b - psi_a - psi_ab)).

    It is the error of each edge, pose b as seen from pose a minus what was measured, over its standard deviations. Sigma is
    diagonal, so that the Mahalanobis norm of the paper is the plain norm of this quotient.

    Args:
        poses: (V, 3), in the unit of ``motion``.
        source: vertex a of each edge, (E,).
        target: vertex b of each edge, (E,).
        motion: measured (p_ab, psi_ab), b seen from a: along, across, heading, (E, 3).
        sigma: standard deviations of ``motion``, (E, 3).

    Returns:
        Whitened residual (3 E,) and its Jacobian (3 E, 3 V).
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
    """Eq. (12), Li et al. 2025: J = w_l F + w_g G as one residual r with |r|^2 = J, and its Jacobian.

    ``local`` and ``global_`` are what ``local_residual`` (F) and ``global_residual`` (G) return. Their Jacobians are stacked.
    """
    w_l, w_g = np.sqrt(local_weight), np.sqrt(global_weight)
    residual = np.concatenate([w_l * local[0], w_g * global_[0]])
    return residual, csr_array(vstack([w_l * local[1], w_g * global_[1]]))
