"""How sure the refined keyframes are: the formal covariance, and the errors that no drive can show about itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hippodrome.core.refinement.factors import BinaryFactors, State
from hippodrome.core.refinement.residuals import Factors, normal_equations
from hippodrome.core.roads.network import BoolArray
from hippodrome.core.solvers.chain import factorise, marginals
from hippodrome.core.types import Edges, FloatArray

# How far a lane as it is driven lies from the lane as it is drawn: corners are cut, curves are polylines, drivers wander. These
# errors are correlated along the lane, so that they never average out.
PLACE_SIGMA_M = 0.1
HEADING_SIGMA_RAD = 0.01  # a wander of 0.1 m over some 60 m
READ_PLACE_SIGMA_M, READ_HEADING_SIGMA_RAD = 0.05, 0.004  # the same where the camera read the place in the lane


def posterior_covariance(state: State, factors: Factors, closures: Edges) -> FloatArray:
    """Covariance (S, B, B) of each keyframe's B unknowns, closures included, in linear time.

    The marginals of the chain alone would take the far end of a closure as known, whereas it is as uncertain as the near one.
    With J and K the closure's whitened Jacobians of its near and its far end, and P the far end's covariance without any closure,
    a closure informs its near end by J^T (1 + K P K^T)^-1 J. What several closures of one place have in common is neglected.
    """
    alone = _without_closures(state, factors, closures)

    def loosened(closing: BinaryFactors) -> BinaryFactors:
        return replace(
            closing,
            source=_near_end(closing.source, closing.target, alone[closures.target]),
            target=_near_end(closing.target, closing.source, alone[closures.source]),
        )

    return marginals(factorise(normal_equations(state, _with_closures(factors, loosened), closures)))[0]


def covariance_under_map_error(state: State, factors: Factors, closures: Edges) -> FloatArray:
    """Covariance (S, 6, 6) of each keyframe's unknowns where the error of the map is among them; (S, 4, 4) without it.

    Who comes by again meets the same error of the map, and learns nothing new of it. ``posterior_covariance`` takes the far end
    of a closure as one more witness, which it is of a pose but not of that error: three passes would seem to halve it. So what
    the error of the map adds to the poses is taken from the drive without closures, and what closures tell from an exact map:

        P = P(closures, e = 0) + (P(no closures) - P(no closures, e = 0))

    The second part is what is left of the error once odometry is known. It is never negative, as knowing e can only help.
    """
    if state.map_error_m is None:
        return posterior_covariance(state, factors, closures)
    exact_state, exact = _with_exact_map(state, factors)
    alone = _without_closures(state, factors, closures)
    poses = posterior_covariance(exact_state, exact, closures) - _without_closures(exact_state, exact, closures)
    covariance = alone.copy()
    covariance[:, :4, :4] += poses
    return covariance


def _with_exact_map(state: State, factors: Factors) -> tuple[State, Factors]:
    """State and factors with the error of the map known to be what was found."""
    road = replace(factors.road, jacobian=factors.road.jacobian[..., :4])
    odometry, closing = (
        replace(part, source=part.source[..., :4], target=part.target[..., :4]) for part in (factors.odometry, factors.closures)
    )
    read = None if factors.read is None else replace(factors.read, jacobian=factors.read.jacobian[..., :4])
    passed = factors.passed
    if passed is not None:
        passed = replace(passed, source=passed.source[..., :4], target=passed.target[..., :4])
    return replace(state, map_error_m=None), Factors(odometry, road, closing, None, read, passed)


def _without_closures(state: State, factors: Factors, closures: Edges) -> FloatArray:
    """Covariance (S, B, B) of each keyframe's unknowns by the chain alone."""
    silent = _with_closures(factors, lambda closing: replace(closing, source=0.0 * closing.source, target=0.0 * closing.target))
    return marginals(factorise(normal_equations(state, silent, closures)))[0]


def _with_closures(factors: Factors, changed: Callable[[BinaryFactors], BinaryFactors]) -> Factors:
    """The factors with all those along closures changed: of the poses and, where it is modelled, of the map's error."""
    map_error = factors.map_error
    if map_error is not None:
        map_error = map_error._replace(closures=changed(map_error.closures))
    return factors._replace(closures=changed(factors.closures), map_error=map_error)


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


def with_systematic_errors(covariance: FloatArray, read: BoolArray | None = None) -> FloatArray:
    """The formal covariance (S, B, B) plus the errors that do not average out along a lane.

    This is the distance between the lane as driven and as drawn. It is an error across the lane, but in bends an error across the
    lane is one along it too, so that it is added to both axes. ``read`` (S,) masks the keyframes at which the place in the lane
    was read; there it is smaller.
    """
    added = np.zeros_like(covariance[0])
    added[0, 0] = added[1, 1] = PLACE_SIGMA_M**2
    added[2, 2] = HEADING_SIGMA_RAD**2
    enlarged: FloatArray = covariance + added
    if read is not None:
        less = np.zeros_like(added)
        less[0, 0] = less[1, 1] = READ_PLACE_SIGMA_M**2
        less[2, 2] = READ_HEADING_SIGMA_RAD**2
        enlarged[read] = covariance[read] + less
    return enlarged
