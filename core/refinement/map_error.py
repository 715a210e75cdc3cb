"""The error of the road map along a drive, as unknowns of refinement mode ``route``: the factors on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hippodrome.core.refinement.factors import BinaryFactors, State, UnaryFactors, normal_blocks
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
    scale = np.exp(state.log_scale)
    driven = scale[:-1] * np.hypot(visits.motion[1:, 0], visits.motion[1:, 1])
    keep = np.exp(-np.maximum(driven, LEAST_APART_M) / model.length_m)
    step_gain = 1.0 / (model.sigma_m * np.sqrt(1.0 - keep**2))
    apart = np.maximum(scale[closures.source] * np.hypot(closures.motion[:, 0], closures.motion[:, 1]), LEAST_APART_M)
    closure_gain = 1.0 / (model.sigma_m * np.sqrt(-2.0 * np.expm1(-apart / model.length_m)))
    first = np.zeros((1, 2, state.width))
    first[0, 0, 4] = first[0, 1, 5] = 1.0 / model.sigma_m
    return MapErrorFactors(
        UnaryFactors(error[:1] / model.sigma_m, first, np.ones((1, 2))),
        _error_differences(error[1:] - keep[:, None] * error[:-1], keep, step_gain),
        _error_differences(error[closures.target] - error[closures.source], np.ones_like(apart), closure_gain),
    )


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
