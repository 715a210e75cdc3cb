"""How sure the refined keyframes are: the formal covariance, and the errors that no drive can show about itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hippodrome.core.refinement.residuals import Factors, State, normal_equations
from hippodrome.core.solvers.chain import factorise, marginals
from hippodrome.core.types import Edges, FloatArray

# How far a lane as it is driven lies from the lane as it is drawn: corners are cut, curves are polylines, drivers wander. These
# errors are correlated along the lane, so that they never average out.
PLACE_SIGMA_M = 0.1
HEADING_SIGMA_RAD = 0.01  # a wander of 0.1 m over some 60 m


def posterior_covariance(state: State, factors: Factors, closures: Edges) -> FloatArray:
    """Covariance (S, 4, 4) of each keyframe's unknowns, closures included, in linear time.

    The marginals of the chain alone would take the far end of a closure as known, whereas it is as uncertain as the near one.
    With J and K the closure's whitened Jacobians of its near and its far end, and P the far end's covariance without any closure,
    a closure informs its near end by J^T (1 + K P K^T)^-1 J. What several closures of one place have in common is neglected.
    """
    closing = factors.closures
    silent = replace(closing, residual=0.0 * closing.residual, source=0.0 * closing.source, target=0.0 * closing.target)
    alone = marginals(factorise(normal_equations(state, factors._replace(closures=silent), closures)))[0]
    loosened = replace(
        closing,
        source=_near_end(closing.source, closing.target, alone[closures.target]),
        target=_near_end(closing.target, closing.source, alone[closures.source]),
    )
    return marginals(factorise(normal_equations(state, factors._replace(closures=loosened), closures)))[0]


def _near_end(near: FloatArray, far: FloatArray, far_covariance: FloatArray) -> FloatArray:
    """Jacobians of closures by their near ends that take the uncertainty of the far ends into account, (N, M, 4).

    They are L^-1 J with L L^T = 1 + K P K^T (see ``posterior_covariance``), so that their normal equations are
    J^T (1 + K P K^T)^-1 J.

    Args:
        near: J, the whitened Jacobians by the near end's unknowns, (N, M, 4).
        far: K, the same by the far end's unknowns.
        far_covariance: P, the covariance of the far end's unknowns, (N, 4, 4).
    """
    residual_covariance = np.eye(near.shape[1]) + far @ far_covariance @ np.swapaxes(far, 1, 2)
    whitened: FloatArray = np.linalg.solve(np.linalg.cholesky(residual_covariance), near)
    return whitened


def with_systematic_errors(covariance: FloatArray, survey_sigma_m: float) -> FloatArray:
    """The formal covariance (S, 4, 4) plus the errors that do not average out along a lane.

    These are the distance between the lane as driven and as drawn, and the network's own error, with a standard deviation of
    ``survey_sigma_m``. Both are errors across the lane, but in bends an error across the lane is one along it too, so that they
    are added to both axes.
    """
    place = PLACE_SIGMA_M**2 + survey_sigma_m**2
    return covariance + np.diag([place, place, HEADING_SIGMA_RAD**2, 0.0])
