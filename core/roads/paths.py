"""Paths that a car can follow: from stretches of lanes to one smooth curve, joints rounded within the turning circle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from scipy.ndimage import gaussian_filter1d

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray

STEP_M: Final = 0.25  # sampling of the path, finer than one simulation step at town speed
ROUNDING_M: Final = 1.5  # standard deviation of the smoothing: a 30 degree joint becomes a bend of 7 m radius
CHANGE_S: Final = 3.5  # duration of a lane change: 5.8 * 3.2 m / (3.5 s)^2 = 1.5 m/s^2 sideways
MIN_CHANGE_M: Final = 12.0  # a slow car cannot change lanes on the spot
MAX_CURVATURE_1PM: Final = 0.32  # turning circle of a small car: 3.1 m at the rear axle, 10 m at the outer front corner
MAX_CURVATURE_SLOPE_1PM2: Final = 0.25  # from straight on to full lock within 1.3 m: 0.6 s at walking pace
RETURN_M: Final = 3.0  # distance over which a car that could not follow comes back to the lane
LOOK_AHEAD_M: Final = 0.6  # steering begins before the bend, by half the way that it takes
MIN_STRETCH: Final = 0.05  # where a smoothed hairpin nearly stands still
FINE_STEP_M: Final = 0.05  # integration step of the turning circle


@dataclass(frozen=True, slots=True)
class Piece:
    """A stretch of one lane, driven without leaving it."""

    lane: int
    begin_m: float  # arc length on the lane's centreline
    end_m: float
    side_step: bool  # the stretch begins beside the end of the one before: a lane change
    speed_mps: float  # at its beginning

    @property
    def length_m(self) -> float:
        return self.end_m - self.begin_m


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A smooth curve sampled every ``STEP_M`` of ``u``, the distance driven along lane centrelines, from ``u = 0``."""

    points_m: FloatArray  # (n, 2)
    heading_rad: FloatArray  # (n,) continuous, not wrapped
    curvature_1pm: FloatArray  # (n,) left positive
    stretch: FloatArray  # (n,) metres of curve per metre of u


def centreline(network: RoadNetwork, lane: int, along_m: FloatArray) -> FloatArray:
    """Points (n, 2) of a lane's centreline at arc lengths."""
    points = network.lane_points_m(lane)
    knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return np.stack([np.interp(along_m, knots, points[:, 0]), np.interp(along_m, knots, points[:, 1])], axis=1)


def smooth_path(
    network: RoadNetwork, pieces: Sequence[Piece], aside_m: FloatArray | None = None, look_ahead_m: float = LOOK_AHEAD_M
) -> Path:
    """Joints rounded, lane changes spread over ``CHANGE_S``, shifted left by ``aside_m`` (n,) where given.

    ``look_ahead_m`` is how far before a bend the wheels begin to turn: a sharp corner is cut less far out if that is longer.
    """
    starts = piece_starts(pieces)
    points = _on_centrelines(network, pieces, starts)
    points = points + _lane_changes(points, pieces, starts)
    points = _rounded(points)
    if aside_m is not None:
        points = points + aside_m[:, None] * _left(points)
    return _within_turning_circle(_as_path(points), look_ahead_m)


def sample_count(pieces: Sequence[Piece]) -> int:
    """Number of samples of the path over these pieces."""
    return int(piece_starts(pieces)[-1] / STEP_M) + 2


def piece_starts(pieces: Sequence[Piece]) -> FloatArray:
    """``u`` (P + 1,) at which each piece begins, and the end of the last."""
    return np.concatenate([[0.0], np.cumsum([piece.length_m for piece in pieces])])


def piece_of_samples(pieces: Sequence[Piece]) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """The piece (n,) that each sample of the path lies on."""
    u = STEP_M * np.arange(sample_count(pieces))
    return np.clip(np.searchsorted(piece_starts(pieces), u, side="right") - 1, 0, len(pieces) - 1)


def _on_centrelines(network: RoadNetwork, pieces: Sequence[Piece], starts: FloatArray) -> FloatArray:
    u = STEP_M * np.arange(sample_count(pieces))
    owner = piece_of_samples(pieces)
    points = np.empty((len(u), 2))
    for k in np.unique(owner):
        mine = owner == k
        points[mine] = centreline(network, pieces[k].lane, pieces[k].begin_m + u[mine] - starts[k])
    return points


def _lane_changes(points_m: FloatArray, pieces: Sequence[Piece], starts: FloatArray) -> FloatArray:
    """Offsets (n, 2) that turn each sideways jump into a quintic blend round it (no jerk at its ends)."""
    offsets = np.zeros_like(points_m)
    index = np.arange(len(points_m))
    jumps = [(int(np.ceil(u / STEP_M)), u, p.speed_mps) for p, u in zip(pieces, starts[:-1], strict=True) if p.side_step]
    jumps = [jump for jump in jumps if 1 <= jump[0] < len(points_m) - 1]
    left = _left_beside_jumps(points_m, [after for after, _, _ in jumps])
    for after, start, speed in jumps:
        jump = float((points_m[after] - points_m[after - 1]) @ left[after])
        share = np.clip((STEP_M * index - start) / max(MIN_CHANGE_M, CHANGE_S * speed) + 0.5, 0.0, 1.0)
        blend = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        offsets += (jump * (blend - (index >= after)))[:, None] * left
    return offsets


def _left_beside_jumps(points_m: FloatArray, jumps: list[int]) -> FloatArray:
    """Left normals (n, 2) of the lanes, undisturbed by the jumps from one to another."""
    steps = np.diff(points_m, axis=0)
    for after in jumps:
        steps[after - 1] = steps[after]
    straightened = np.concatenate([points_m[:1], points_m[0] + np.cumsum(steps, axis=0)])
    return _left(_rounded(straightened))


def _rounded(points_m: FloatArray) -> FloatArray:
    """Gaussian smoothing along the path; beyond its ends the path is taken to go straight on."""
    pad = min(len(points_m) - 1, int(4 * ROUNDING_M / STEP_M))
    before = 2.0 * points_m[0] - points_m[pad:0:-1]
    after = 2.0 * points_m[-1] - points_m[-2 : -pad - 2 : -1]
    padded = np.concatenate([before, points_m, after])
    smooth: FloatArray = gaussian_filter1d(padded, ROUNDING_M / STEP_M, axis=0, mode="nearest")[pad : pad + len(points_m)]
    return smooth


def _left(points_m: FloatArray) -> FloatArray:
    tangent = np.gradient(points_m, axis=0)
    length = np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
    left: FloatArray = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1) / length
    return left


def _as_path(points_m: FloatArray) -> Path:
    """Derivatives by u turn into heading, curvature kappa = (x'y'' - y'x'') / |p'|^3 and stretch |p'|."""
    first = np.gradient(points_m, STEP_M, axis=0)
    second = np.gradient(first, STEP_M, axis=0)
    stretch = np.maximum(np.linalg.norm(first, axis=1), MIN_STRETCH)
    curvature = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / stretch**3
    return Path(points_m, np.unwrap(np.arctan2(first[:, 1], first[:, 0])), curvature, stretch)


def _within_turning_circle(path: Path, look_ahead_m: float) -> Path:
    """Where a car goes that follows the path but cannot turn tighter than ``MAX_CURVATURE_1PM``."""
    x, y = np.ascontiguousarray(path.points_m[:, 0]), np.ascontiguousarray(path.points_m[:, 1])
    driven: FloatArray = _steer_along(x, y, path.heading_rad, path.curvature_1pm, path.stretch, look_ahead_m)
    stretch = np.maximum(np.linalg.norm(np.gradient(driven[:, :2], STEP_M, axis=0), axis=1), MIN_STRETCH)
    return Path(driven[:, :2], driven[:, 2], driven[:, 3], stretch)


@njit(cache=True)
def _steer_along(
    x: FloatArray, y: FloatArray, heading: FloatArray, curvature: FloatArray, stretch: FloatArray, look_ahead_m: float
) -> FloatArray:
    """kappa = kappa_path - e / l^2 - 2 psi / l (Samson, 1993, linearised), integrated over distance within the car's limits."""
    n = len(x)
    driven = np.stack((x, y, heading, curvature), axis=1)  # row: x, y, heading, curvature beside each sample of the path
    px, py, psi, kappa, u, filled = x[0], y[0], heading[0], 0.0, 0.0, 1
    for _ in range(int(20 * n * STEP_M / FINE_STEP_M)):
        k = min(int(u / STEP_M), n - 2)
        share = u / STEP_M - k
        ref = heading[k] + share * (heading[k + 1] - heading[k])
        dx, dy = px - (x[k] + share * (x[k + 1] - x[k])), py - (y[k] + share * (y[k + 1] - y[k]))
        offset, turn = np.cos(ref) * dy - np.sin(ref) * dx, psi - ref
        ahead = min(int((u + look_ahead_m) / STEP_M), n - 1)
        wanted = curvature[ahead] - offset / RETURN_M**2 - 2.0 * turn / RETURN_M
        wanted = min(max(wanted, -MAX_CURVATURE_1PM), MAX_CURVATURE_1PM)
        most = MAX_CURVATURE_SLOPE_1PM2 * FINE_STEP_M
        kappa += min(max(wanted - kappa, -most), most)
        before, before_u = np.array((px, py, psi, kappa)), u
        px, py = px + FINE_STEP_M * np.cos(psi), py + FINE_STEP_M * np.sin(psi)
        psi += FINE_STEP_M * kappa
        dx, dy = px - (x[k] + share * (x[k + 1] - x[k])), py - (y[k] + share * (y[k + 1] - y[k]))
        u += max((np.cos(ref) * dx + np.sin(ref) * dy) / stretch[k], 0.0)
        while filled < n and filled * STEP_M <= u:
            part = (filled * STEP_M - before_u) / (u - before_u)
            driven[filled] = before + part * (np.array((px, py, psi, kappa)) - before)
            filled += 1
        if filled == n:
            break
    return driven
