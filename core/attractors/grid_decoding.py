"""The position that the phases of several grid modules encode together. Each tells it up to whole periods of its own."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray


def decode(mean_rad: FloatArray, reliability: FloatArray, period: FloatArray, near: FloatArray, reach: float) -> FloatArray:
    """The position (2,) that the phases of all modules encode.

    Each phase tells the position only up to whole periods. Of the positions that are possible within about ``reach`` of ``near``
    (2,), the one whose phases fit those of the modules best is returned. A ``reach`` of 0 takes the possible position nearest to
    ``near``, as after each step of path integration.

    Args:
        mean_rad: phases (M modules, 2 axes).
        reliability: reliabilities of the phases, the same shape, 1/rad^2.
        period: periods of the modules, (M,).
        near: a prior position, (2,).
        reach: how far from ``near`` to search, in the unit of the periods.
    """
    position: FloatArray = decode_compiled(mean_rad, reliability, period, near, reach)
    return position


@njit(cache=True)
def decode_compiled(mean: FloatArray, reliability: FloatArray, period: FloatArray, near: FloatArray, reach: float) -> FloatArray:
    """The compiled part of ``decode``: the two axes are independent of each other, and each is decoded by itself."""
    position = np.empty(2)
    for a in range(2):
        position[a] = _decode_axis(mean, reliability, period, a, near[a], reach)
    return position


@njit(cache=True)
def _decode_axis(mean: FloatArray, reliability: FloatArray, period: FloatArray, a: int, near: float, reach: float) -> float:
    """Coordinate on axis ``a`` that fits the phases of all modules best.

    On each sheet of the first module the modules' weighted mean is a candidate; the one of the least misfit wins, and of equal
    misfits the one nearest to ``near``.
    """
    sheets = math.ceil(reach / period[0])
    home = near + wrap_compiled(mean[0, a] - 2.0 * math.pi * near / period[0]) * period[0] / (2.0 * math.pi)
    best, least = near, math.inf
    for k in range(-sheets, sheets + 1):
        candidate = _weighted_mean(mean, reliability, period, a, home + k * period[0])
        misfit = _misfit(mean, reliability, period, a, candidate)
        if misfit < least or (misfit == least and abs(candidate - near) < abs(best - near)):
            best, least = candidate, misfit
    return best


@njit(cache=True)
def _weighted_mean(mean: FloatArray, reliability: FloatArray, period: FloatArray, a: int, about: float) -> float:
    """Mean over the modules of the coordinate on axis ``a``, weighted by information: the least-squares solution.

    A phase stands for many coordinates, one period apart; each module contributes the one nearest to ``about``.
    """
    shift, weight = 0.0, 0.0
    for m in range(mean.shape[0]):
        per_length = 2.0 * math.pi / period[m]
        information = reliability[m, a] * per_length**2
        shift += information * wrap_compiled(mean[m, a] - about * per_length) / per_length
        weight += information
    return about + shift / weight


@njit(cache=True)
def _misfit(mean: FloatArray, reliability: FloatArray, period: FloatArray, a: int, coordinate: float) -> float:
    """How badly a coordinate on axis ``a`` fits the phases (M, 2): the sum of their squared errors over their variances."""
    total = 0.0
    for m in range(mean.shape[0]):
        total += reliability[m, a] * wrap_compiled(mean[m, a] - 2.0 * math.pi * coordinate / period[m]) ** 2
    return total
