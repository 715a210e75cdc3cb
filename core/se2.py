"""SE(2) poses as arrays ``(..., 3)`` of (x, y, heading_rad); all functions broadcast and return new arrays.

Angles are wrapped in three ways, each the fastest for its callers: ``wrap`` for arrays in Python, ``wrap_compiled`` for compiled
code and for single numbers, ``wrap_near_zero`` for compiled inner loops whose angles lie within a few turns of zero.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numba import njit

from hippodrome.core.types import FloatArray

Real: TypeAlias = Any  # a float or a FloatArray: numba compiles each case


def wrap(angle_rad: FloatArray) -> FloatArray:
    """``warp`` of Eq. (11), Li et al. 2025: angles into (-pi, pi]."""
    wrapped: FloatArray = np.pi - np.mod(np.pi - np.asarray(angle_rad, dtype=np.float64), 2.0 * np.pi)
    return wrapped


@njit(cache=True)
def wrap_compiled(angle_rad: Real) -> Real:
    """``wrap`` for compiled callers, and for a single number in Python, where it is ten times faster."""
    return math.pi - (math.pi - angle_rad) % (2.0 * math.pi)


@njit(cache=True, error_model="numpy", inline="always")
def wrap_near_zero(angle_rad: float) -> float:
    """An angle into [-pi, pi] by adding or subtracting whole turns: faster than a modulo for at most a few of them."""
    while angle_rad > math.pi:
        angle_rad -= 2.0 * math.pi
    while angle_rad < -math.pi:
        angle_rad += 2.0 * math.pi
    return angle_rad


def compose(a: FloatArray, b: FloatArray) -> FloatArray:
    """Pose ``b``, given in the frame of ``a``, in the frame in which ``a`` is given."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    cos, sin = np.cos(a[..., 2]), np.sin(a[..., 2])
    x = a[..., 0] + cos * b[..., 0] - sin * b[..., 1]
    y = a[..., 1] + sin * b[..., 0] + cos * b[..., 1]
    return np.stack([x, y, wrap(a[..., 2] + b[..., 2])], axis=-1)


def between(a: FloatArray, b: FloatArray) -> FloatArray:
    """Pose ``b`` seen from ``a``: (R_a^T (p_b - p_a), psi_b - psi_a), the bracket of Eq. (11), Li et al. 2025."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    cos, sin = np.cos(a[..., 2]), np.sin(a[..., 2])
    dx, dy = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
    return np.stack([cos * dx + sin * dy, -sin * dx + cos * dy, wrap(b[..., 2] - a[..., 2])], axis=-1)


def inverse(a: FloatArray) -> FloatArray:
    """The pose that ``compose`` cancels: ``compose(a, inverse(a)) == 0``."""
    return between(a, np.zeros(3))


def integrate(start: FloatArray, motions: FloatArray) -> FloatArray:
    """Dead reckoning: poses (N, 3) reached from ``start`` (3,) by body motions (N, 3); row 0 is ``start`` moved by motion 0."""
    motions = np.asarray(motions, dtype=np.float64)
    heading = start[2] + np.cumsum(motions[:, 2])
    before = np.concatenate([[start[2]], heading[:-1]])
    cos, sin = np.cos(before), np.sin(before)
    x = start[0] + np.cumsum(cos * motions[:, 0] - sin * motions[:, 1])
    y = start[1] + np.cumsum(sin * motions[:, 0] + cos * motions[:, 1])
    return np.stack([x, y, wrap(heading)], axis=-1)


def interpolate(t_s: FloatArray, poses: FloatArray, at_s: FloatArray) -> FloatArray:
    """Poses (M, 3) at the times ``at_s`` (M,), linear between poses (N, 3) at ``t_s`` (N,); headings along the shorter arc."""
    x, y = (np.interp(at_s, t_s, poses[:, axis]) for axis in (0, 1))
    heading = np.interp(at_s, t_s, np.unwrap(poses[:, 2]))
    return np.stack([x, y, wrap(heading)], axis=-1)
