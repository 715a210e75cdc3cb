"""The error of the road map along a drive, as unknowns of refinement mode ``route``: the factors on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hippodrome.core.refinement.factors import BinaryFactors, State, UnaryFactors, normal_blocks
from hippodrome.core.refinement.noise import Noise
from hippodrome.core.refinement.paint import PAINT_EDGE
from hippodrome.core.types import Edges, FloatArray, Visits

LEAST_APART_M = 0.1  # places closer than this have one error of the map, but the equations must keep their condition


@dataclass(frozen=True, slots=True)
class MapErrorModel:
    """The error of the road map along the drive: an Ornstein-Uhlenbeck process in each axis, as neighbouring roads err alike.

    Its covariance between two places that are d metres of driving apart is sigma_m^2 exp(-d / length_m).
    """

    sigma_m: float  # standard deviation in each axis
    length_m: float  # correlation length


class MapErrorFactors(NamedTuple):
    """What is known of the map's error beforehand; each part has a component for x and one for y."""

    first: UnaryFactors  # N = 1: at the first keyframe
    steps: BinaryFactors  # from each keyframe to the next
    closures: BinaryFactors  # between the two ends of each closure


def map_error_factors(state: State, visits: Visits, closures: Edges, model: MapErrorModel) -> MapErrorFactors:
    """The error of the map as an Ornstein-Uhlenbeck process along the drive, and equal where the drive comes by again.

        r_0 = e_0 / sigma,  r_i = (e_{i+1} - k_i e_i) / (sigma sqrt(1 - k_i^2)),  k_i = exp(-d_i / length)

    d_i is the driven length of step i in metres. The ends of a closure lie d_ab apart, so that their errors differ by a variance
    of 2 sigma^2 (1 - exp(-d_ab / length)).
    """
    error = state.map_error_m
    assert error is not None
    scale = np.where(closures.kind == PAINT_EDGE, 1.0, np.exp(state.log_scale[closures.source]))
    keep = np.exp(-np.maximum(driven_m(state, visits), LEAST_APART_M) / model.length_m)
    step_gain = 1.0 / (model.sigma_m * np.sqrt(1.0 - keep**2))
    apart = np.maximum(scale * np.hypot(closures.motion[:, 0], closures.motion[:, 1]), LEAST_APART_M)
    closure_gain = 1.0 / (model.sigma_m * np.sqrt(-2.0 * np.expm1(-apart / model.length_m)))
    first = np.zeros((1, 2, state.width))
    first[0, 0, 4] = first[0, 1, 5] = 1.0 / model.sigma_m
    return MapErrorFactors(
        UnaryFactors(error[:1] / model.sigma_m, first, np.ones((1, 2))),
        _error_differences(error[1:] - keep[:, None] * error[:-1], keep, step_gain),
        _error_differences(error[closures.target] - error[closures.source], np.ones_like(apart), closure_gain),
    )


def shown_sigma_m(
    model: MapErrorModel, known_freedom: float, state: State, covariance: FloatArray, noise: Noise, visits: Visits
) -> float:
    """The standard deviation of the map's error that the drive has shown, in metres, as far as it shows any.

    The accuracy that was assumed, sigma, is that of maps of this kind; this very map may be a better one. With e the estimated
    errors and P their posterior variances, both in the mean of the two axes, and w the driven metres that each keyframe stands
    for, the drive shows

        freedom D = sum w (1 - P / sigma^2) / length,   variance v = (sum w e^2 / length) / D + odometry's share

    1 - P / sigma^2 is the share of the error that the drive determines, and each axis has one independent error every two
    correlation lengths. This is an estimate of a component of variance at its prior value (MINQUE, Rao 1971). A path bends to
    follow the roads, and what the solution lays to the odometry may be the map's: ``drift_variance_m2`` over two correlation
    lengths is added, so that v is an upper bound. Where drive and roads agree, the map is proven to be good; where they do not,
    either may be wrong, and sigma stays. The prior, a scaled inverse chi-squared distribution, counts as nu errors seen before:

        sigma'^2 = (nu sigma^2 + D min(v, sigma^2)) / (nu + D)

    A short drive, and a road that nothing vouches for, determine next to nothing, and leave it at sigma. The estimate looks at
    the size of the errors and not at their steps from keyframe to keyframe, which tell how smoothly the roads are drawn.

    Args:
        model: the error of the map that was assumed.
        known_freedom: nu.
        state: the solution for S keyframes.
        covariance: (S, 6, 6) of the solution.
        noise: of the odometry, as it was estimated.
        visits: raw motions of the keyframes.
    """
    assert state.map_error_m is not None
    steps_m = driven_m(state, visits)
    weight = 0.5 * (np.append(steps_m, 0.0) + np.append(0.0, steps_m)) / model.length_m
    assumed = model.sigma_m**2
    left = 0.5 * (covariance[:, 4, 4] + covariance[:, 5, 5]) / assumed
    freedom = float(np.sum(weight * np.clip(1.0 - left, 0.0, 1.0)))
    squares = float(np.sum(weight * np.mean(state.map_error_m**2, axis=1)))
    drift = drift_variance_m2(noise, 2.0 * model.length_m)
    shown = min(squares + freedom * drift, freedom * assumed)  # D min(v, sigma^2)
    return float(np.sqrt((known_freedom * assumed + shown) / (known_freedom + freedom)))


def drift_variance_m2(noise: Noise, length_m: float) -> float:
    """Variance in each axis, in the mean of along and across, that odometry gathers over ``length_m`` of driving.

    Errors along and across are random walks; heading and log scale are, too, and move the place by their integrals.
    """
    walks = (noise.along**2 + noise.across**2) * length_m
    integrals = (noise.heading**2 + noise.log_scale**2) * length_m**3 / 3.0
    return 0.5 * (walks + integrals)


def driven_m(state: State, visits: Visits) -> FloatArray:
    """Driven metres (S - 1,) from each keyframe to the next."""
    metres: FloatArray = np.exp(state.log_scale[:-1]) * np.hypot(visits.motion[1:, 0], visits.motion[1:, 1])
    return metres


def _error_differences(residual: FloatArray, keep: FloatArray, gain: FloatArray) -> BinaryFactors:
    """Factors (N,) on e_target - keep e_source = ``residual`` (N, 2), whitened by ``gain`` (N,)."""
    count = len(residual)
    source, target = np.zeros((count, 2, 6)), np.zeros((count, 2, 6))
    for axis in (0, 1):
        source[:, axis, 4 + axis], target[:, axis, 4 + axis] = -keep * gain, gain
    return BinaryFactors(residual * gain[:, None], source, target, np.zeros((count, 2, 2)), np.ones((count, 2)))


def add_map_error(factors: MapErrorFactors, closures: Edges, diagonal: FloatArray, upper: FloatArray, rhs: FloatArray) -> None:
    """Add what is known of the map's error to the blocks of the normal equations, in place."""
    first, steps, closing = factors
    keyframes = len(diagonal)
    for at, jacobian, residual in (
        (np.zeros(1, np.int64), first.jacobian, first.residual),
        (np.arange(keyframes - 1), steps.source, steps.residual),
        (np.arange(1, keyframes), steps.target, steps.residual),
        (closures.source, closing.source, closing.residual),
        (closures.target, closing.target, closing.residual),
    ):
        blocks, sides = normal_blocks(jacobian, residual)
        np.add.at(diagonal, at, blocks)
        np.add.at(rhs, at, sides)
    upper += np.einsum("nmi,nmj->nij", steps.source, steps.target)
