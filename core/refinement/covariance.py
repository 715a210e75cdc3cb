"""How sure the refined vertices are: the formal covariance, and what no drive can show about itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hippodrome.core.refinement.residuals import (
    Group,
    PairGroup,
    State,
    normal_equations,
)
from hippodrome.core.solvers.chain import factorise, marginals
from hippodrome.core.types import Edges, FloatArray

PLACE_SIGMA_M = 0.1  # of the lane as driven: corners cut, polylines for curves, wander; correlated, so it never averages out
HEADING_SIGMA_RAD = 0.01  # likewise: a wander of 0.1 m over some 60 m


def posterior(state: State, steps: PairGroup, roads: Group, tied: PairGroup, edges: Edges) -> FloatArray:
    """Covariance (S, B, B) of each visit's unknowns.

    The chain's marginals take the far end of a closure as known. It is as uncertain as the near one: a closure informs by
    J^T (1 + K P K^T)^-1 J, with J and K its whitened Jacobians of the near and the far end, and P the far end's covariance
    without any closure. Linear time; what several closures of one place have in common is neglected.
    """
    untied = replace(tied, residual=0.0 * tied.residual, here=0.0 * tied.here, there=0.0 * tied.there)
    alone = marginals(factorise(normal_equations(state, steps, roads, untied, edges)))[0]
    loosened = replace(
        tied,
        here=_loosened(tied.here, tied.there, alone[edges.target]),
        there=_loosened(tied.there, tied.here, alone[edges.source]),
    )
    return marginals(factorise(normal_equations(state, steps, roads, loosened, edges)))[0]


def _loosened(near: FloatArray, far: FloatArray, far_covariance: FloatArray) -> FloatArray:
    """Jacobians (N, M, B) of the near end, whitened anew by what is open about the far one."""
    spread = np.eye(near.shape[1]) + far @ far_covariance @ np.swapaxes(far, 1, 2)
    whitened: FloatArray = np.linalg.solve(np.linalg.cholesky(spread), near)
    return whitened


def calibrated(covariance: FloatArray, survey_sigma_m: float) -> FloatArray:
    """The formal covariance (S, 4, 4) plus what never averages out: how the road is driven, and the network's own error.

    In bends an error across the lane is one along it too, so that it is added to both axes.
    """
    place = PLACE_SIGMA_M**2 + survey_sigma_m**2
    return covariance + np.diag([place, place, HEADING_SIGMA_RAD**2, 0.0])
