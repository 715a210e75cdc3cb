"""The factors of refinement mode ``route``: whitened residuals with their Jacobians, and the normal equations that they add up
to.

The unknowns are (x, y, heading psi, log scale s) at each of S keyframes, s = ln(metres per map unit), and the gyro's gain error g
and bias b. Where the road map has an accuracy, the error of the map (e_x, e_y) at each keyframe is unknown as well: how far the
road there is drawn from where it is (``map_error``). Residuals are whitened, that is, divided by their standard deviations, and
multiplied by the roots of their robust weights, as are the Jacobians.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hippodrome.core.refinement.factors import BinaryFactors, State, UnaryFactors, normal_blocks
from hippodrome.core.refinement.map_error import MapErrorFactors, MapErrorModel, add_map_error, map_error_factors
from hippodrome.core.refinement.noise import Noise
from hippodrome.core.refinement.paint import PAINT_EDGE, passed_factors
from hippodrome.core.refinement.readings import ReadTargets, reading_factors
from hippodrome.core.se2 import between, wrap
from hippodrome.core.solvers.chain import ChainSystem
from hippodrome.core.solvers.robust import geman_mcclure_weight, student_weight
from hippodrome.core.types import Edges, FloatArray, Visits

GAIN_SIGMA = 0.05  # prior sigma of the gyro's gain error: cheap gyros are calibrated to a few percent
BIAS_SIGMA_RADPS = 0.02  # prior sigma of the gyro's bias: about 1 deg/s
SLIP_SIGMA_M = 0.1  # prior sigma of the slip (``odometry_factors``)
GYRO = 2  # the gyro's gain error and bias are the first entries of ``State.gyro``; the slip follows them
GEMAN_MCCLURE = 3.0  # error of a closure in sigmas at which it has lost three quarters of its weight


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
    read: ReadTargets | None = None  # what the camera read of the road
    passed_m: FloatArray | None = None  # (S - 1,) way to the next keyframe by the paint that passed; nan: not told
    bend_1pm: FloatArray | None = None  # (S,) by which the lane's heading changes along it; None: it is that of the point


class Factors(NamedTuple):
    """All factors at one state."""

    odometry: BinaryFactors  # from each keyframe to the next
    road: UnaryFactors  # on each keyframe
    closures: BinaryFactors  # along the closure edges
    map_error: MapErrorFactors | None = None  # where the map is not taken as exact
    read: UnaryFactors | None = None  # where the road was read
    passed: BinaryFactors | None = None  # from each keyframe to the next, by the paint that passed


def all_factors(
    state: State, visits: Visits, closures: Edges, targets: RoadTargets, noise: Noise, scale_step_variance: FloatArray
) -> Factors:
    """Odometry, road and closure factors, and those of the map's error if it is modelled; arguments as of the functions below."""
    return Factors(
        odometry_factors(state, visits, noise, scale_step_variance),
        road_factors(state, targets, noise),
        closure_factors(state, closures, noise),
        None if targets.map_error is None else map_error_factors(state, visits, closures, targets.map_error),
        None if targets.read is None else reading_factors(state, targets.points_m, targets.heading_rad, targets.read),
        None if targets.passed_m is None else passed_factors(state, targets.passed_m, len(state.gyro)),
    )


def odometry_factors(state: State, visits: Visits, noise: Noise, scale_step_variance: FloatArray) -> BinaryFactors:
    """Odometry from each keyframe i to the next (N = S - 1): residuals along, across, in heading and in log scale.

        r_i = Sigma_i^(-1/2) (R_i^T (p_{i+1} - p_i) - e^{s_i} m_i,
                              warp(psi_{i+1} - psi_i - (1 + g) w_i - b dt_i),
                              s_{i+1} - s_i)

    Where the road was read, the slip l is unknown, too: l (cos w_i - 1, sin w_i) is taken from the first two. It is how far ahead
    of the pose's point that point of the vehicle lies which moves the way the vehicle heads; tyres and the seats of the sensors
    decide it. Without it all corners are laid a decimetre too soon or too late, which the place in the next street shows.

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
    swing = np.column_stack([np.cos(motion[:, 2]) - 1.0, np.sin(motion[:, 2])])  # of a point a metre ahead, as the vehicle turns
    turn = wrap(b[:, 2] - a[:, 2] - (1.0 + state.gyro[0]) * motion[:, 2] - state.gyro[1] * dt)
    residual = np.column_stack([seen[:, :2] - metres, turn, np.diff(state.log_scale)])
    if len(state.gyro) > GYRO:
        residual[:, :2] -= state.gyro[GYRO] * swing
    source, target = _relative_pose_jacobians(a, seen, state.width)
    source[:, :2, 3] = -metres
    source[:, 3, 3], target[:, 3, 3] = -1.0, 1.0
    gyro = np.zeros((len(a), 4, len(state.gyro)))
    gyro[:, 2, 0], gyro[:, 2, 1] = -motion[:, 2], -dt
    gyro[:, :2, GYRO:] = -swing[:, :, None]
    per_sigma = 1.0 / noise.step_sigmas(np.hypot(metres[:, 0], metres[:, 1]))
    weight = np.ones_like(residual)
    expected_sq = (residual[:, 3] ** 2 + scale_step_variance) * per_sigma[:, 3] ** 2
    weight[:, 3] = student_weight(expected_sq, noise.scale_inverse_freedom)
    gain = per_sigma * np.sqrt(weight)
    return BinaryFactors(residual * gain, source * gain[..., None], target * gain[..., None], gyro * gain[..., None], weight)


def road_factors(state: State, targets: RoadTargets, noise: Noise) -> UnaryFactors:
    """The road at each keyframe: across the lane and heading against the lane's (both Student-t), and along the lane.

        r = (n . (p + e - q) / sigma_n,  warp(psi - theta - kappa t . (p + e - q)) / sigma_theta,  t . (p + e - q) / sigma_t)

    e is the error of the map, 0 where the map is taken as exact. q and theta are the target's point and heading, t the lane's
    direction and n the one to its left. With an infinite sigma_t this is the distance from a line, not from a point: the
    projection's error along the road is then not passed on to the pose.

    kappa is the bend of the lane. With it a vehicle may slide along a bend, and its turns tell where in the bend it is. Without
    it (0) the heading of one point holds it back: an exact map is followed so.
    """
    cos, sin = np.cos(targets.heading_rad), np.sin(targets.heading_rad)
    off = state.drawn_points_m - targets.points_m
    lateral, turned_sigma = noise.road_sigmas(targets.curvature_1pm, targets.added_lateral_m)
    across = (-sin * off[:, 0] + cos * off[:, 1]) / lateral
    along = (cos * off[:, 0] + sin * off[:, 1]) / targets.along_sigma_m
    turned = wrap(state.poses[:, 2] - targets.heading_rad) / turned_sigma
    if targets.bend_1pm is not None:
        ahead_rad = targets.bend_1pm * (cos * off[:, 0] + sin * off[:, 1])
        turned = wrap(state.poses[:, 2] - targets.heading_rad - ahead_rad) / turned_sigma
    residual = np.column_stack([across, turned, along])
    jacobian = np.zeros((len(off), 3, state.width))
    jacobian[:, 0, 0], jacobian[:, 0, 1] = -sin / lateral, cos / lateral
    jacobian[:, 1, 2] = 1.0 / turned_sigma
    if targets.bend_1pm is not None:
        jacobian[:, 1, :2] = -(targets.bend_1pm / turned_sigma)[:, None] * np.column_stack([cos, sin])
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
    Paint that was seen again tells metres, so that its scale is 1, and its noise is known.
    """
    a, b = state.poses[closures.source], state.poses[closures.target]
    paint = closures.kind == PAINT_EDGE
    scale = np.where(paint, 1.0, np.exp(state.log_scale[closures.source]))[:, None]
    seen, metres = between(a, b), scale * closures.motion[:, :2]
    residual = np.column_stack([seen[:, :2] - metres, wrap(seen[:, 2] - closures.motion[:, 2])])
    source, target = _relative_pose_jacobians(a, seen, state.width)
    source, target = source[:, :3], target[:, :3]
    source[:, :2, 3] = np.where(paint[:, None], 0.0, -metres)
    per_sigma = 1.0 / (noise.closure_factor * np.column_stack([scale * closures.sigma[:, :2], closures.sigma[:, 2]]))
    if noise.closure_along_factor is not None:
        per_sigma[:, 0] *= noise.closure_factor / noise.closure_along_factor
    per_sigma[paint] = 1.0 / closures.sigma[paint]
    weight = geman_mcclure_weight(np.sum((residual * per_sigma) ** 2, axis=1), GEMAN_MCCLURE**2)
    gain = per_sigma * np.sqrt(weight)[:, None]
    no_gyro, weights = np.zeros((len(a), 3, 2)), np.repeat(weight[:, None], 3, 1)
    return BinaryFactors(residual * gain, source * gain[..., None], target * gain[..., None], no_gyro, weights)


def normal_equations(state: State, factors: Factors, closures: Edges) -> ChainSystem:
    """J^T J and -J^T r of all factors and of the gyro's prior, as a chain over the keyframes with the gyro as its border.

    The coupling J_a^T J_b between the two ends of a closure lies off the chain and is left out: the solver adds it.
    """
    odometry, road, closing, map_error, read, passed = factors
    diagonal, rhs = normal_blocks(road.jacobian, road.residual)
    if read is not None:
        read_diagonal, read_rhs = normal_blocks(read.jacobian, read.residual)
        diagonal, rhs = diagonal + read_diagonal, rhs + read_rhs
    by_source, rhs_source = normal_blocks(odometry.source, odometry.residual)
    by_target, rhs_target = normal_blocks(odometry.target, odometry.residual)
    diagonal[:-1] += by_source
    diagonal[1:] += by_target
    rhs[:-1] += rhs_source
    rhs[1:] += rhs_target
    for keyframe, jacobian in ((closures.source, closing.source), (closures.target, closing.target)):
        blocks, sides = normal_blocks(jacobian, closing.residual)
        np.add.at(diagonal, keyframe, blocks)
        np.add.at(rhs, keyframe, sides)
    upper = np.einsum("nmi,nmj->nij", odometry.source, odometry.target)
    if passed is not None:
        for ends, jacobian in ((slice(None, -1), passed.source), (slice(1, None), passed.target)):
            blocks, sides = normal_blocks(jacobian, passed.residual)
            diagonal[ends] += blocks
            rhs[ends] += sides
        upper += np.einsum("nmi,nmj->nij", passed.source, passed.target)
    if map_error is not None:
        add_map_error(map_error, closures, diagonal, upper, rhs)
    border = np.zeros((len(state.poses), state.width, len(state.gyro)))
    border[:-1] += np.einsum("nmi,nmg->nig", odometry.source, odometry.gyro)
    border[1:] += np.einsum("nmi,nmg->nig", odometry.target, odometry.gyro)
    prior = np.array([GAIN_SIGMA, BIAS_SIGMA_RADPS, SLIP_SIGMA_M][: len(state.gyro)]) ** -2.0
    return ChainSystem(
        diagonal=diagonal,
        upper=upper,
        border=border,
        corner=np.einsum("nmg,nmh->gh", odometry.gyro, odometry.gyro) + np.diag(prior),
        rhs=rhs,
        rhs_border=-np.einsum("nmg,nm->g", odometry.gyro, odometry.residual) - prior * state.gyro,
    )


def stepped(state: State, step: FloatArray, gyro_step: FloatArray) -> State:
    """The state after a Gauss-Newton step of the keyframes (S, 4 or 6) and of the gyro (2,)."""
    poses = state.poses + step[:, :3]
    poses[:, 2] = wrap(poses[:, 2])
    map_error = None if state.map_error_m is None else state.map_error_m + step[:, 4:]
    return State(poses, state.log_scale + step[:, 3], state.gyro + gyro_step, map_error)


def _relative_pose_jacobians(a: FloatArray, seen: FloatArray, width: int) -> tuple[FloatArray, FloatArray]:
    """Derivatives of ``seen = between(a, b)`` (N, 3) by a and by b, with room for more rows and columns: (N, 4, width)."""
    cos, sin = np.cos(a[:, 2]), np.sin(a[:, 2])
    by_a, by_b = np.zeros((len(a), 4, width)), np.zeros((len(a), 4, width))
    by_b[:, 0, 0], by_b[:, 0, 1], by_b[:, 1, 0], by_b[:, 1, 1] = cos, sin, -sin, cos
    by_a[:, :2, :2] = -by_b[:, :2, :2]
    by_a[:, 0, 2], by_a[:, 1, 2] = seen[:, 1], -seen[:, 0]
    by_a[:, 2, 2], by_b[:, 2, 2] = -1.0, 1.0
    return by_a, by_b
