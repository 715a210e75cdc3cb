"""The factors of refinement mode ``route``: whitened residuals with their Jacobians, and the normal equations that they add up
to.

The unknowns are (x, y, heading psi, log scale s) at each of S keyframes, s = ln(metres per map unit), and the gyro's gain error g
and bias b. Where the road map has an accuracy, the error of the map (e_x, e_y) at each keyframe is unknown as well: how far the
road there is drawn from where it is. A unary factor depends on one keyframe, a binary factor on two of them and perhaps on the
gyro. Residuals are whitened, that is, divided by their standard deviations, and multiplied by the roots of their robust weights,
as are the Jacobians.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hippodrome.core.refinement.noise import Noise
from hippodrome.core.se2 import between, wrap
from hippodrome.core.solvers.chain import ChainSystem
from hippodrome.core.solvers.robust import geman_mcclure_weight, student_weight
from hippodrome.core.types import Edges, FloatArray, Visits

GAIN_SIGMA = 0.05  # prior sigma of the gyro's gain error: cheap gyros are calibrated to a few percent
BIAS_SIGMA_RADPS = 0.02  # prior sigma of the gyro's bias: about 1 deg/s
LEAST_APART_M = 0.1  # places closer than this have one error of the map, but the equations must keep their condition
GEMAN_MCCLURE = 3.0  # error of a closure in sigmas at which it has lost three quarters of its weight


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Values of the unknowns."""

    poses: FloatArray  # (S, 3) network frame, m, m, rad
    log_scale: FloatArray  # (S,) ln(metres per map unit)
    gyro: FloatArray  # (2,) gain error g and bias b (rad/s): true turn = (1 + g) measured turn + b dt
    map_error_m: FloatArray | None = None  # (S, 2) drawn place of the road less its true one; None: the map is taken as exact

    @property
    def width(self) -> int:
        """Unknowns of each keyframe: 4, or 6 with the error of the map."""
        return 4 if self.map_error_m is None else 6

    @property
    def drawn_points_m(self) -> FloatArray:
        """The keyframes' points (S, 2) on the map as it is drawn: where they are, moved as the map is there."""
        points = self.poses[:, :2]
        return points if self.map_error_m is None else points + self.map_error_m


@dataclass(frozen=True, slots=True)
class MapErrorModel:
    """The error of the road map along the drive: an Ornstein-Uhlenbeck process in each axis, as neighbouring roads err alike.

    Its covariance between two places that are d metres of driving apart is sigma_m^2 exp(-d / length_m).
    """

    sigma_m: float  # standard deviation in each axis
    length_m: float  # correlation length


@dataclass(frozen=True, slots=True, eq=False)
class RoadTargets:
    """The point of its road that each keyframe is drawn to, and how strongly."""

    points_m: FloatArray  # (S, 2)
    heading_rad: FloatArray  # (S,) of the lane
    curvature_1pm: FloatArray  # (S,) of the lane, without sign
    added_lateral_m: FloatArray  # (S,) lateral sigma beyond the driver's: which of several parallel lanes, the survey's error
    weight: FloatArray  # (S,) 1, or next to 0 where nothing vouches for the road
    along_sigma_m: float  # sigma along the lane; infinite: the keyframe is drawn to the line, not to a point of it
    map_error: MapErrorModel | None = None  # None: the map is taken as exact


@dataclass(frozen=True, slots=True, eq=False)
class UnaryFactors:
    """N factors of M components, each on one keyframe: keyframe n for factor n."""

    residual: FloatArray  # (N, M) whitened, times the root of the weight
    jacobian: FloatArray  # (N, M, 4 or 6) by the keyframe's unknowns, likewise
    weight: FloatArray  # (N, M) robust weights


@dataclass(frozen=True, slots=True, eq=False)
class BinaryFactors:
    """N factors of M components between two keyframes, source and target."""

    residual: FloatArray  # (N, M) whitened, times the root of the weight
    source: FloatArray  # (N, M, 4 or 6) Jacobian by the source's unknowns, likewise
    target: FloatArray  # (N, M, 4 or 6) Jacobian by the target's unknowns
    gyro: FloatArray  # (N, M, 2) Jacobian by the gyro's gain error and bias
    weight: FloatArray  # (N, M) robust weights


class Factors(NamedTuple):
    """All factors at one state."""

    odometry: BinaryFactors  # from each keyframe to the next
    road: UnaryFactors  # on each keyframe
    closures: BinaryFactors  # along the closure edges
    map_error: MapErrorFactors | None = None  # where the map is not taken as exact


def all_factors(
    state: State, visits: Visits, closures: Edges, targets: RoadTargets, noise: Noise, scale_step_variance: FloatArray
) -> Factors:
    """Odometry, road and closure factors, and those of the map's error if it is modelled; arguments as of the functions below."""
    return Factors(
        odometry_factors(state, visits, noise, scale_step_variance),
        road_factors(state, targets, noise),
        closure_factors(state, closures, noise),
        None if targets.map_error is None else map_error_factors(state, visits, closures, targets.map_error),
    )


def odometry_factors(state: State, visits: Visits, noise: Noise, scale_step_variance: FloatArray) -> BinaryFactors:
    """Odometry from each keyframe i to the next (N = S - 1): residuals along, across, in heading and in log scale.

        r_i = Sigma_i^(-1/2) (R_i^T (p_{i+1} - p_i) - e^{s_i} m_i,
                              warp(psi_{i+1} - psi_i - (1 + g) w_i - b dt_i),
                              s_{i+1} - s_i)

    m_i (map units) and w_i (rad) are the raw motion and turn, dt_i (s) the time between the keyframes. Only the steps of the log
    scale have a Student-t weight, as the scale may jump. Gyros and wheels have no outliers: where the road disagrees with a
    measured turn, it is the road that is drawn wrong, and its factors are robust.

    Args:
        state: where the factors are linearised.
        visits: raw motions of the S keyframes.
        noise: standard deviations.
        scale_step_variance: (N,) variance that is left of each step of the log scale once the data are known. The robust weight
            takes the expected squared step, which is the squared estimate plus this variance: the estimate alone looks small
            where no data determine the step.
    """
    a, b = state.poses[:-1], state.poses[1:]
    motion, dt = visits.motion[1:], np.diff(visits.t_s)
    seen, metres = between(a, b), np.exp(state.log_scale[:-1])[:, None] * motion[:, :2]
    turn = wrap(b[:, 2] - a[:, 2] - (1.0 + state.gyro[0]) * motion[:, 2] - state.gyro[1] * dt)
    residual = np.column_stack([seen[:, :2] - metres, turn, np.diff(state.log_scale)])
    source, target = _relative_pose_jacobians(a, seen, state.width)
    source[:, :2, 3] = -metres
    source[:, 3, 3], target[:, 3, 3] = -1.0, 1.0
    gyro = np.zeros((len(a), 4, 2))
    gyro[:, 2, 0], gyro[:, 2, 1] = -motion[:, 2], -dt
    per_sigma = 1.0 / noise.step_sigmas(np.hypot(metres[:, 0], metres[:, 1]))
    weight = np.ones_like(residual)
    expected_sq = (residual[:, 3] ** 2 + scale_step_variance) * per_sigma[:, 3] ** 2
    weight[:, 3] = student_weight(expected_sq, noise.scale_inverse_freedom)
    gain = per_sigma * np.sqrt(weight)
    return BinaryFactors(residual * gain, source * gain[..., None], target * gain[..., None], gyro * gain[..., None], weight)


def road_factors(state: State, targets: RoadTargets, noise: Noise) -> UnaryFactors:
    """The road at each keyframe: across the lane and heading against the lane's (both Student-t), and along the lane.

        r = (n . (p + e - q) / sigma_n,  warp(psi - theta) / sigma_theta,  t . (p + e - q) / sigma_t)

    e is the error of the map, 0 where the map is taken as exact. q and theta are the target's point and heading, t the lane's
    direction and n the one to its left. With an infinite sigma_t this is the distance from a line, not from a point: the
    projection's error along the road is then not passed on to the pose.
    """
    cos, sin = np.cos(targets.heading_rad), np.sin(targets.heading_rad)
    off = state.drawn_points_m - targets.points_m
    lateral, turned_sigma = noise.road_sigmas(targets.curvature_1pm, targets.added_lateral_m)
    across = (-sin * off[:, 0] + cos * off[:, 1]) / lateral
    along = (cos * off[:, 0] + sin * off[:, 1]) / targets.along_sigma_m
    turned = wrap(state.poses[:, 2] - targets.heading_rad) / turned_sigma
    residual = np.column_stack([across, turned, along])
    jacobian = np.zeros((len(off), 3, state.width))
    jacobian[:, 0, 0], jacobian[:, 0, 1] = -sin / lateral, cos / lateral
    jacobian[:, 1, 2] = 1.0 / turned_sigma
    jacobian[:, 2, 0], jacobian[:, 2, 1] = cos / targets.along_sigma_m, sin / targets.along_sigma_m
    jacobian[:, :, 4:] = jacobian[:, :, : state.width - 4]  # an error of the map moves the road as a pose would move the car
    weight = student_weight(residual**2, noise.road_inverse_freedom)
    weight[:, 2] = 1.0
    weight *= targets.weight[:, None]
    gain = np.sqrt(weight)
    return UnaryFactors(residual * gain, jacobian * gain[..., None], weight)


def closure_factors(state: State, closures: Edges, noise: Noise) -> BinaryFactors:
    """Loop closures from keyframe a to keyframe b: along, across, heading; each with one Geman-McClure weight.

        r_ab = Sigma^(-1/2) (R_a^T (p_b - p_a) - e^{s_a} p_ab,  warp(psi_b - psi_a - psi_ab))

    That is Eq. (11), Li et al. 2025, with the scale at the source as an unknown. Source and target of ``closures`` are keyframes.
    """
    a, b = state.poses[closures.source], state.poses[closures.target]
    scale = np.exp(state.log_scale[closures.source])[:, None]
    seen, metres = between(a, b), scale * closures.motion[:, :2]
    residual = np.column_stack([seen[:, :2] - metres, wrap(seen[:, 2] - closures.motion[:, 2])])
    source, target = _relative_pose_jacobians(a, seen, state.width)
    source, target = source[:, :3], target[:, :3]
    source[:, :2, 3] = -metres
    per_sigma = 1.0 / (noise.closure_factor * np.column_stack([scale * closures.sigma[:, :2], closures.sigma[:, 2]]))
    weight = geman_mcclure_weight(np.sum((residual * per_sigma) ** 2, axis=1), GEMAN_MCCLURE**2)
    gain = per_sigma * np.sqrt(weight)[:, None]
    no_gyro, weights = np.zeros((len(a), 3, 2)), np.repeat(weight[:, None], 3, 1)
    return BinaryFactors(residual * gain, source * gain[..., None], target * gain[..., None], no_gyro, weights)


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


def normal_equations(state: State, factors: Factors, closures: Edges) -> ChainSystem:
    """J^T J and -J^T r of all factors and of the gyro's prior, as a chain over the keyframes with the gyro as its border.

    The coupling J_a^T J_b between the two ends of a closure lies off the chain and is left out: the solver adds it.
    """
    odometry, road, closing, map_error = factors
    diagonal, rhs = _normal_blocks(road.jacobian, road.residual)
    by_source, rhs_source = _normal_blocks(odometry.source, odometry.residual)
    by_target, rhs_target = _normal_blocks(odometry.target, odometry.residual)
    diagonal[:-1] += by_source
    diagonal[1:] += by_target
    rhs[:-1] += rhs_source
    rhs[1:] += rhs_target
    for keyframe, jacobian in ((closures.source, closing.source), (closures.target, closing.target)):
        blocks, sides = _normal_blocks(jacobian, closing.residual)
        np.add.at(diagonal, keyframe, blocks)
        np.add.at(rhs, keyframe, sides)
    upper = np.einsum("nmi,nmj->nij", odometry.source, odometry.target)
    if map_error is not None:
        _add_map_error(map_error, closures, diagonal, upper, rhs)
    border = np.zeros((len(state.poses), state.width, 2))
    border[:-1] += np.einsum("nmi,nmg->nig", odometry.source, odometry.gyro)
    border[1:] += np.einsum("nmi,nmg->nig", odometry.target, odometry.gyro)
    prior = np.array([GAIN_SIGMA, BIAS_SIGMA_RADPS]) ** -2.0
    return ChainSystem(
        diagonal=diagonal,
        upper=upper,
        border=border,
        corner=np.einsum("nmg,nmh->gh", odometry.gyro, odometry.gyro) + np.diag(prior),
        rhs=rhs,
        rhs_border=-np.einsum("nmg,nm->g", odometry.gyro, odometry.residual) - prior * state.gyro,
    )


def _add_map_error(factors: MapErrorFactors, closures: Edges, diagonal: FloatArray, upper: FloatArray, rhs: FloatArray) -> None:
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
        blocks, sides = _normal_blocks(jacobian, residual)
        np.add.at(diagonal, at, blocks)
        np.add.at(rhs, at, sides)
    upper += np.einsum("nmi,nmj->nij", steps.source, steps.target)


def stepped(state: State, step: FloatArray, gyro_step: FloatArray) -> State:
    """The state after a Gauss-Newton step of the keyframes (S, 4 or 6) and of the gyro (2,)."""
    poses = state.poses + step[:, :3]
    poses[:, 2] = wrap(poses[:, 2])
    map_error = None if state.map_error_m is None else state.map_error_m + step[:, 4:]
    return State(poses, state.log_scale + step[:, 3], state.gyro + gyro_step, map_error)


def _normal_blocks(jacobian: FloatArray, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Contribution of each factor to the normal equations: J^T J (N, B, B) and -J^T r (N, B)."""
    return np.einsum("nmi,nmj->nij", jacobian, jacobian), -np.einsum("nmi,nm->ni", jacobian, residual)


def _relative_pose_jacobians(a: FloatArray, seen: FloatArray, width: int) -> tuple[FloatArray, FloatArray]:
    """Derivatives of ``seen = between(a, b)`` (N, 3) by a and by b, with room for more rows and columns: (N, 4, width)."""
    cos, sin = np.cos(a[:, 2]), np.sin(a[:, 2])
    by_a, by_b = np.zeros((len(a), 4, width)), np.zeros((len(a), 4, width))
    by_b[:, 0, 0], by_b[:, 0, 1], by_b[:, 1, 0], by_b[:, 1, 1] = cos, sin, -sin, cos
    by_a[:, :2, :2] = -by_b[:, :2, :2]
    by_a[:, 0, 2], by_a[:, 1, 2] = seen[:, 1], -seen[:, 0]
    by_a[:, 2, 2], by_b[:, 2, 2] = -1.0, 1.0
    return by_a, by_b
