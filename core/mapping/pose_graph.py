"""Robust pose-graph optimisation: odometry is trusted, loop closures have to prove themselves.

One false closure in a hundred destroys plain least squares. The remedy is graduated non-convexity with the Geman-McClure loss
(Yang et al. 2020, "Graduated Non-Convexity for Robust Spatial Perception"): at first the loss is so wide that every closure pulls
as in least squares; then it narrows round by round, and closures that disagree with all the rest lose their weight.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from hippodrome.core import se2
from hippodrome.core.mapping.config import PoseGraphConfig
from hippodrome.core.solvers.gauss_newton import factorise
from hippodrome.core.solvers.pose_costs import local_residual
from hippodrome.core.solvers.robust import geman_mcclure_weight
from hippodrome.core.types import EdgeKind, Edges, FloatArray


def relax_pose_graph(poses: FloatArray, edges: Edges, config: PoseGraphConfig) -> FloatArray:
    """Poses (V, 3) that fit the edges best, with robust weights for closures; the first pose is held.

    Args:
        poses: where the search begins, (V, 3); dead reckoning will do.
        edges: odometry and closures.
        config: the robust loss, and when to stop.
    """
    if len(edges.source) == 0:
        return poses.copy()
    sq_width = config.robust_scale**2
    widening = _first_widening(poses, edges, config)
    for _ in range(config.rounds if np.any(edges.kind == EdgeKind.CLOSURE) else 1):
        poses = _gauss_newton_step(poses, edges, edge_weights(poses, edges, sq_width * widening))
        widening = max(1.0, widening / config.anneal)
    return np.concatenate([poses[:, :2], se2.wrap(poses[:, 2:])], axis=1)


def edge_weights(poses: FloatArray, edges: Edges, sq_width: float) -> FloatArray:
    """Weight (E,) of each edge at ``poses``: that of the Geman-McClure loss for closures, 1 for odometry.

    ``sq_width`` is the square of the error, in sigmas, at which the weight has fallen to a quarter.
    """
    weight = geman_mcclure_weight(_sq_error(poses, edges), sq_width)
    return np.where(edges.kind == EdgeKind.CLOSURE, weight, 1.0)


def _first_widening(poses: FloatArray, edges: Edges, config: PoseGraphConfig) -> float:
    """Factor on the squared width at which all errors still lie on the loss's convex part (Yang et al. 2020), within limits.

    At most as wide as the rounds can narrow, so that the last ones run at ``robust_scale`` itself.
    """
    worst = float(_sq_error(poses, edges).max())
    return min(max(1.0, 3.0 * worst / config.robust_scale**2), config.anneal ** (config.rounds - 3))


def _sq_error(poses: FloatArray, edges: Edges) -> FloatArray:
    """Squared error of each edge in sigmas, (E,): the squared norm of Eq. (11), Li et al. 2025."""
    residual, _ = local_residual(poses, edges.source, edges.target, edges.motion, edges.sigma)
    squared: FloatArray = np.sum(residual.reshape(-1, 3) ** 2, axis=1)
    return squared


def _gauss_newton_step(poses: FloatArray, edges: Edges, weight: FloatArray) -> FloatArray:
    """Poses (V, 3) after one Gauss-Newton step on the sum of squares of Eq. (11), Li et al. 2025, weighted by ``weight`` (E,).

    The first pose is held, as edges between poses do not determine where the whole map lies.
    """
    sigma = edges.sigma / np.sqrt(np.maximum(weight, 1e-12))[:, None]
    residual, jacobian = local_residual(poses, edges.source, edges.target, edges.motion, sigma)
    free = csr_array(jacobian[:, 3:])
    change = factorise((free.T @ free).tocsc()).solve(-(free.T @ residual))
    moved = poses.copy()
    moved[1:] += change.reshape(-1, 3)
    return moved
