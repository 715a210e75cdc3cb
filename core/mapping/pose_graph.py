"""Robust pose-graph optimisation: odometry is trusted, closures must earn it.

Graduated non-convexity with the Geman-McClure loss: first every closure pulls like a spring, then those that disagree with the
rest lose their weight. One false closure in a hundred destroys plain least squares.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from scipy.sparse import csr_array

from hippodrome.core import se2
from hippodrome.core.solvers.gauss_newton import factorise
from hippodrome.core.solvers.pose_costs import local_residual
from hippodrome.core.types import EdgeKind, Edges, FloatArray


@dataclass(frozen=True)
class PoseGraphConfig:
    """The robust loss and when to stop."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    robust_scale: float = 3.0  # sigmas at which a closure's weight has fallen to a quarter
    rounds: int = 15  # of re-weighting, one Gauss-Newton step each
    anneal: float = 4.0  # the loss narrows by this factor a round

    def __post_init__(self) -> None:
        if self.robust_scale <= 0.0 or self.rounds < 1 or self.anneal <= 1.0:
            raise ValueError("pose graph: robust_scale > 0, rounds >= 1 and anneal > 1 are required")


def optimise(poses: FloatArray, edges: Edges, config: PoseGraphConfig) -> FloatArray:
    """Poses (V, 3) that fit the edges best, the first one held. ``poses`` is where the search begins (dead reckoning)."""
    if len(edges.source) == 0:
        return poses.copy()
    weight = np.ones(len(edges.source))
    robust = edges.kind == EdgeKind.CLOSURE
    widening = _first_widening(poses, edges, config)
    for _ in range(config.rounds if robust.any() else 1):
        weight = np.where(robust, _geman_mcclure(_sq_error(poses, edges), config.robust_scale**2 * widening), 1.0)
        poses = _step(poses, edges, weight)
        widening = max(1.0, widening / config.anneal)
    return np.concatenate([poses[:, :2], se2.wrap(poses[:, 2:])], axis=1)


def closure_weights(poses: FloatArray, edges: Edges, config: PoseGraphConfig) -> FloatArray:
    """Weight (E,) in [0, 1] that each edge has at ``poses``; 1 for odometry."""
    weight: FloatArray = _geman_mcclure(_sq_error(poses, edges), config.robust_scale**2)
    return np.where(edges.kind == EdgeKind.CLOSURE, weight, 1.0)


def _first_widening(poses: FloatArray, edges: Edges, config: PoseGraphConfig) -> float:
    """Widening of the loss at which all residuals still lie on its convex part (Yang et al. 2020)."""
    worst = float(_sq_error(poses, edges).max())
    return min(max(1.0, 3.0 * worst / config.robust_scale**2), config.anneal ** (config.rounds - 3))


def _geman_mcclure(sq_error: FloatArray, sq_scale: float) -> FloatArray:
    return (sq_scale / (sq_error + sq_scale)) ** 2


def _sq_error(poses: FloatArray, edges: Edges) -> FloatArray:
    residual, _ = local_residual(poses, edges.source, edges.target, edges.motion, edges.sigma)
    squared: FloatArray = np.sum(residual.reshape(-1, 3) ** 2, axis=1)
    return squared


def _step(poses: FloatArray, edges: Edges, weight: FloatArray) -> FloatArray:
    sigma = edges.sigma / np.sqrt(np.maximum(weight, 1e-12))[:, None]
    residual, jacobian = local_residual(poses, edges.source, edges.target, edges.motion, sigma)
    free = csr_array(jacobian[:, 3:])
    change = factorise((free.T @ free).tocsc()).solve(-(free.T @ residual))
    moved = poses.copy()
    moved[1:] += change.reshape(-1, 3)
    return moved
