"""Residuals of the default refinement over (x, y, heading, log scale) per visit and the gyro's gain and bias.

Residuals are whitened; each group holds its Jacobians by block: of the visit, of the next visit, of the border (gain, bias).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hippodrome.core.refinement.noise import Noise
from hippodrome.core.se2 import between, wrap
from hippodrome.core.solvers.chain import ChainSystem
from hippodrome.core.types import Edges, FloatArray, Visits

GAIN_SIGMA = 0.05  # prior: cheap gyros are calibrated to a few percent
BIAS_SIGMA_RADPS = 0.02  # prior: about 1 deg/s
GEMAN_MCCLURE = 3.0  # sigmas at which a closure has lost three quarters of its weight


@dataclass(frozen=True, slots=True, eq=False)
class State:
    poses: FloatArray  # (S, 3) network frame, m, m, rad
    log_scale: FloatArray  # (S,) ln(metres per map unit)
    gyro: FloatArray  # (2,) gain error, bias (rad/s): turned = (1 + gain) measured + bias dt


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """Where on the road each visit is held."""

    points_m: FloatArray  # (S, 2)
    heading_rad: FloatArray  # (S,) of the lane
    curvature_1pm: FloatArray  # (S,) of the lane, without sign
    freedom_m: FloatArray  # (S,) lateral sigma beyond the driver's, where lanes are parallel
    on_road: FloatArray  # (S,) 1, or 0 where nothing vouches for the road
    along_sigma_m: float  # inf: point to line


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """N whitened residuals of M components, already multiplied by their robust weights' roots."""

    residual: FloatArray  # (N, M)
    here: FloatArray  # (N, M, 4)
    weight: FloatArray  # (N, M) robust weights


@dataclass(frozen=True, slots=True, eq=False)
class PairGroup(Group):
    there: FloatArray  # (N, M, 4)
    border: FloatArray  # (N, M, 2)


def odometry(state: State, visits: Visits, noise: Noise, unseen: FloatArray) -> PairGroup:
    """Components: along, across, heading, log scale, between each visit and the next (N = S - 1).

    The scale may jump: its steps are Student-t. Their weights take the expected square, of which ``unseen`` (N,) is what the
    data leave open: where nothing tells the scale its steps look small without being so. Gyros and wheels have no outliers: where
    a turn is drawn otherwise than driven, it is the road that is wrong.
    """
    a, b = state.poses[:-1], state.poses[1:]
    motion, dt = visits.motion[1:], np.diff(visits.t_s)
    seen, metres = between(a, b), np.exp(state.log_scale[:-1])[:, None] * motion[:, :2]
    turn = wrap(b[:, 2] - a[:, 2] - (1.0 + state.gyro[0]) * motion[:, 2] - state.gyro[1] * dt)
    residual = np.column_stack([seen[:, :2] - metres, turn, np.diff(state.log_scale)])
    here, there = _relative_jacobians(a, seen)
    here[:, :2, 3] = -metres
    here[:, 3, 3], there[:, 3, 3] = -1.0, 1.0
    border = np.zeros((len(a), 4, 2))
    border[:, 2, 0], border[:, 2, 1] = -motion[:, 2], -dt
    root = 1.0 / noise.step_sigmas(np.hypot(metres[:, 0], metres[:, 1]))
    weight = np.ones_like(residual)
    weight[:, 3] = student_weight((residual[:, 3] ** 2 + unseen) * root[:, 3] ** 2, noise.scale_tail)
    root = root * np.sqrt(weight)
    return PairGroup(residual * root, here * root[..., None], weight, there * root[..., None], border * root[..., None])


def road(state: State, targets: Targets, noise: Noise) -> Group:
    """Components: across the lane and lane heading (both Student-t), along the lane."""
    cos, sin = np.cos(targets.heading_rad), np.sin(targets.heading_rad)
    off = state.poses[:, :2] - targets.points_m
    lateral, turned_sigma = noise.road_sigmas(targets.curvature_1pm, targets.freedom_m)
    across = (-sin * off[:, 0] + cos * off[:, 1]) / lateral
    along = (cos * off[:, 0] + sin * off[:, 1]) / targets.along_sigma_m
    turned = wrap(state.poses[:, 2] - targets.heading_rad) / turned_sigma
    residual = np.column_stack([across, turned, along])
    here = np.zeros((len(off), 3, 4))
    here[:, 0, 0], here[:, 0, 1] = -sin / lateral, cos / lateral
    here[:, 1, 2] = 1.0 / turned_sigma
    here[:, 2, 0], here[:, 2, 1] = cos / targets.along_sigma_m, sin / targets.along_sigma_m
    weight = student_weight(residual**2, noise.road_tail)
    weight[:, 2] = 1.0
    weight *= targets.on_road[:, None]
    root = np.sqrt(weight)
    return Group(residual * root, here * root[..., None], weight)


def student_weight(sq: FloatArray, tail: float) -> FloatArray:
    """Weights of squared whitened residuals under a Student-t with 1 / ``tail`` degrees of freedom."""
    weight: FloatArray = (1.0 + tail) / (1.0 + tail * sq)
    return weight


def closures(state: State, edges: Edges, noise: Noise) -> PairGroup:
    """Closure edges, Geman-McClure weighted as a whole; source and target index visits."""
    a, b = state.poses[edges.source], state.poses[edges.target]
    scale = np.exp(state.log_scale[edges.source])[:, None]
    seen, metres = between(a, b), scale * edges.motion[:, :2]
    residual = np.column_stack([seen[:, :2] - metres, wrap(seen[:, 2] - edges.motion[:, 2])])
    here, there = _relative_jacobians(a, seen)
    here, there = here[:, :3], there[:, :3]
    here[:, :2, 3] = -metres
    root = 1.0 / (noise.closure_factor * np.column_stack([scale * edges.sigma[:, :2], edges.sigma[:, 2]]))
    sq = np.sum((residual * root) ** 2, axis=1)
    weight = (GEMAN_MCCLURE**2 / (GEMAN_MCCLURE**2 + sq)) ** 2
    root = root * np.sqrt(weight)[:, None]
    border = np.zeros((len(a), 3, 2))
    return PairGroup(residual * root, here * root[..., None], np.repeat(weight[:, None], 3, 1), there * root[..., None], border)


def normal_equations(state: State, steps: PairGroup, roads: Group, tied: PairGroup, edges: Edges) -> ChainSystem:
    """J^T J and -J^T r, without the coupling between the two ends of a closure, which lies off the chain."""
    count = len(state.poses)
    diagonal, rhs = _squares(roads.here, roads.residual)
    here, rhs_here = _squares(steps.here, steps.residual)
    there, rhs_there = _squares(steps.there, steps.residual)
    diagonal[:-1] += here
    diagonal[1:] += there
    rhs[:-1] += rhs_here
    rhs[1:] += rhs_there
    for index, jacobian in ((edges.source, tied.here), (edges.target, tied.there)):
        blocks, sides = _squares(jacobian, tied.residual)
        np.add.at(diagonal, index, blocks)
        np.add.at(rhs, index, sides)
    border = np.zeros((count, 4, 2))
    border[:-1] += np.einsum("nmi,nmg->nig", steps.here, steps.border)
    border[1:] += np.einsum("nmi,nmg->nig", steps.there, steps.border)
    prior = np.array([GAIN_SIGMA, BIAS_SIGMA_RADPS]) ** -2.0
    return ChainSystem(
        diagonal=diagonal,
        upper=np.einsum("nmi,nmj->nij", steps.here, steps.there),
        border=border,
        corner=np.einsum("nmg,nmh->gh", steps.border, steps.border) + np.diag(prior),
        rhs=rhs,
        rhs_border=-np.einsum("nmg,nm->g", steps.border, steps.residual) - prior * state.gyro,
    )


def moved(state: State, step: FloatArray, gyro_step: FloatArray) -> State:
    """The state after a Gauss-Newton step (S, 4), (2,)."""
    poses = state.poses + step[:, :3]
    poses[:, 2] = wrap(poses[:, 2])
    return State(poses, state.log_scale + step[:, 3], state.gyro + gyro_step)


def _squares(jacobian: FloatArray, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
    return np.einsum("nmi,nmj->nij", jacobian, jacobian), -np.einsum("nmi,nm->ni", jacobian, residual)


def _relative_jacobians(a: FloatArray, seen: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Derivatives (N, 4, 4) of ``between(a, b)`` by a and by b, as far as (x, y, heading) go."""
    cos, sin = np.cos(a[:, 2]), np.sin(a[:, 2])
    here, there = np.zeros((len(a), 4, 4)), np.zeros((len(a), 4, 4))
    there[:, 0, 0], there[:, 0, 1], there[:, 1, 0], there[:, 1, 1] = cos, sin, -sin, cos
    here[:, :2, :2] = -there[:, :2, :2]
    here[:, 0, 2], here[:, 1, 2] = seen[:, 1], -seen[:, 0]
    here[:, 2, 2], there[:, 2, 2] = -1.0, 1.0
    return here, there
