"""The rounds of refinement mode ``route``: project on to the route's line, solve by Gauss-Newton, estimate the noise anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hippodrome.core.matching.lane_choice import unknown_lane_sigma_m
from hippodrome.core.matching.projection import reproject
from hippodrome.core.matching.route_line import RouteLine
from hippodrome.core.refinement.config import SolverConfig
from hippodrome.core.refinement.covariance import covariance_under_map_error, posterior_covariance, with_systematic_errors
from hippodrome.core.refinement.factors import State
from hippodrome.core.refinement.map_error import MapErrorModel, driven_m, map_error_factors, shown_sigma_m
from hippodrome.core.refinement.noise import Noise, rescaled, variance_factors
from hippodrome.core.refinement.paint import PAINT_EDGE, painted, passed_m, revisits, with_revisits
from hippodrome.core.refinement.readings import ReadLanes
from hippodrome.core.refinement.residuals import (
    Factors,
    RoadTargets,
    all_factors,
    normal_equations,
    stepped,
)
from hippodrome.core.roads.network import BoolArray, RoadNetwork
from hippodrome.core.solvers.chain import ChainFactor, marginals, solve_coupled
from hippodrome.core.types import Edges, FloatArray, Visits

MOST_CG_STEPS = 100  # iterations of conjugate gradients; 10-30 are usual, and the next round makes up for a step cut short

UNTOLD_SIGMA = 1000.0  # (m, rad) of what nothing tells
CAR_M = 4.0  # a car's length, over which a bend is seen at least
BEND_SIGMAS = 4.0  # half the length over which a bend tells the place along it, in sigmas of the map: so far off it is drawn

_HELD_SIGMAS_M = (1000.0, 30.0)  # sigmas along a line that leaves the place on it open: they tell little and keep the condition


@dataclass(frozen=True, slots=True, eq=False)
class RouteSolution:
    """The refined keyframes, and what was estimated on the way."""

    state: State
    arc_m: FloatArray  # (S,) place of each keyframe on the route's line
    noise: Noise
    covariance: FloatArray  # (S, 4, 4) x, y, heading, log scale; (S, 6, 6) with the error of the map
    assumed_covariance: FloatArray  # the same if the map is as accurate as was assumed, not as the drive has shown it to be
    factors: Factors  # what the covariance was made of, at the solution
    shown_survey_sigma_m: float | None = None  # how accurate the drive has shown the map to be; None: it was not asked


def refine_along_route(
    visits: Visits,
    closures: Edges,
    line: RouteLine,
    arc_m: FloatArray,
    log_scale: FloatArray,
    vouched: FloatArray,
    free: BoolArray,
    config: SolverConfig,
    network: RoadNetwork | None = None,
) -> RouteSolution:
    """The most likely poses and scales of S keyframes along a route, with their covariances and the noise of all factors.

    Every round projects the keyframes onto the line, takes a few Gauss-Newton steps, and estimates the noise anew. The first
    rounds hold the keyframes to their projections also along the line, ever more loosely, so that they find their places. The
    later rounds hold them across the line only.

    Args:
        visits: raw motions of the keyframes.
        closures: loop closures between keyframes.
        line: the line of the route, P samples.
        arc_m: first guess of each keyframe's arc length on the line, (S,).
        log_scale: first guess of ln(metres per map unit), (S,).
        vouched: 1 where a keyframe is believed to be on the road of the route, 0 where it may be off the network, (S,).
        free: mask (P,) of the samples of the line whose lane may be the wrong one of several parallel ones.
        config: number and constants of the rounds; without ``survey_sigma_m`` the line is taken as exact.
        network: the roads of the line, if what was read of them is to be used.

    Where the whole line is straight, nothing tells how far along it the keyframes are, nor their scale. They are then held to
    where the search has put them, loosely, so that a large covariance says so. Of what even then nothing tells it is
    ``UNTOLD_SIGMA`` squared.
    """
    for most_sigma_m in (np.inf, *_HELD_SIGMAS_M):
        held = replace(config, along_sigma_m=tuple(min(sigma_m, most_sigma_m) for sigma_m in config.along_sigma_m))
        solution = _refined(visits, closures, line, arc_m, log_scale, vouched, free, held, network)
        if np.isfinite(solution.state.poses).all() and np.isfinite(solution.covariance).all():
            break
    told, assumed = _all_told(solution.covariance), _all_told(solution.assumed_covariance)
    return replace(solution, covariance=told, assumed_covariance=assumed)


def _all_told(covariance: FloatArray) -> FloatArray:
    """Covariances (S, B, B), those that are not finite as of poses of which nothing is known.

    So end drives that lead nowhere: their scale goes to zero, and with it what the wheels tell.
    """
    told = covariance.copy()
    told[~np.isfinite(covariance).all(axis=(1, 2))] = UNTOLD_SIGMA**2 * np.eye(covariance.shape[1])
    return told


def _refined(
    visits: Visits, closures: Edges, line: RouteLine, arc_m: FloatArray, log_scale: FloatArray, vouched: FloatArray,
    free: BoolArray, config: SolverConfig, network: RoadNetwork | None,
) -> RouteSolution:  # fmt: skip
    """As ``refine_along_route``; not finite if the line leaves the unknowns open."""
    points, heading = points_on_line(line, arc_m)
    map_error = MapErrorModel(config.survey_sigma_m, config.survey_length_m) if config.survey_sigma_m else None
    readings = None if network is None or visits.lane is None else ReadLanes(visits.lane, line, network, config.survey_slope)
    no_error_yet = None if map_error is None else np.zeros_like(points)
    state = State(np.column_stack([points, heading]), log_scale, np.zeros(2 if readings is None else 3), no_error_yet)
    noise = Noise() if readings is None else Noise(closure_along_factor=1.0)
    scale_step_variance = prior_scale_step_variance(state, visits, noise)
    road_weight = np.maximum(vouched, config.unvouched_weight)
    paint = None if network is None else painted(visits)
    passed = None
    for number, along_sigma_m in enumerate(config.along_sigma_m):
        arc_m = reproject(line, state.drawn_points_m, arc_m, config.reprojection_m)
        points, heading = points_on_line(line, arc_m)
        added_lateral_m = unknown_lane_sigma_m(line, arc_m, free)
        bend = curvature(line, arc_m)
        read = None if readings is None else readings.at(arc_m, bend, added_lateral_m, config.loose_m(number))
        if paint is not None and number == config.paint_round and np.isfinite(state.poses).all():
            passed, closures = passed_m(paint, state), with_revisits(closures, revisits(paint, state))
        targets = RoadTargets(points, heading, bend, added_lateral_m, road_weight, along_sigma_m, map_error, read, passed)
        if map_error is not None:
            targets = replace(targets, bend_1pm=signed_curvature(line, arc_m, max(CAR_M, BEND_SIGMAS * map_error.sigma_m)))
        for _ in range(config.inner_iterations):
            state, factor = gauss_newton_step(state, visits, closures, targets, noise, scale_step_variance)
        noise, scale_step_variance = estimate_noise(state, visits, closures, targets, noise, scale_step_variance, factor)
    no_bends = replace(targets, bend_1pm=None)  # where a bend is drawn is good enough to be followed, but nothing to be sure of
    factors = all_factors(state, visits, closures, no_bends, noise, scale_step_variance)
    assumed = posterior_covariance(state, factors, closures)
    covariance = covariance_under_map_error(state, factors, closures) if map_error is not None else assumed
    shown_m = None
    if map_error is not None and config.survey_freedom is not None:
        shown_m = shown_sigma_m(map_error, config.survey_freedom, state, assumed, noise, visits)
        shown = map_error_factors(state, visits, closures, replace(map_error, sigma_m=shown_m))
        factors = factors._replace(map_error=shown)
        covariance = covariance_under_map_error(state, factors, closures)
    was_read = None if targets.read is None else np.isfinite(targets.read.across_sigma_m)
    told, as_assumed = (with_systematic_errors(one, was_read) for one in (covariance, assumed))
    return RouteSolution(state, arc_m, noise, told, as_assumed, factors, shown_survey_sigma_m=shown_m)


def prior_scale_step_variance(state: State, visits: Visits, noise: Noise) -> FloatArray:
    """Prior variance (S - 1,) of the change of the log scale between consecutive keyframes.

    The log scale is a random walk, whose variance grows with the driven metres.
    """
    variance: FloatArray = noise.step_sigmas(driven_m(state, visits))[:, 3] ** 2
    return variance


def curvature(line: RouteLine, arc_m: FloatArray) -> FloatArray:
    """Absolute curvature (S,) of the line in 1/m at the arc lengths (S,), as roads hold a vehicle less tightly in bends."""
    magnitude: FloatArray = np.abs(signed_curvature(line, arc_m, CAR_M))
    return magnitude


def signed_curvature(line: RouteLine, arc_m: FloatArray, half_m: float) -> FloatArray:
    """Curvature (S,) of the line in 1/m at the arc lengths (S,), positive to the left.

    It is the change of heading from ``half_m`` behind to as far ahead, over that distance.
    """
    heading = np.unwrap(line.heading_rad)
    turned = np.interp(arc_m + half_m, line.arc_m, heading) - np.interp(arc_m - half_m, line.arc_m, heading)
    curved: FloatArray = turned / (2.0 * half_m)
    return curved


def gauss_newton_step(
    state: State,
    visits: Visits,
    closures: Edges,
    targets: RoadTargets,
    noise: Noise,
    scale_step_variance: FloatArray,
    tolerance: float = 1e-4,
) -> tuple[State, ChainFactor]:
    """The state after one Gauss-Newton step on all factors, and the factorised normal equations of the chain.

    ``tolerance`` is that of the linear solution (``chain.solve_coupled``); the other arguments are those of ``all_factors``.
    """
    factors = all_factors(state, visits, closures, targets, noise, scale_step_variance)
    system = normal_equations(state, factors, closures)
    step, gyro_step, factor = solve_coupled(system, _closure_coupling(factors, closures), tolerance, MOST_CG_STEPS)
    return stepped(state, step, gyro_step), factor


def _closure_coupling(factors: Factors, closures: Edges) -> Callable[[FloatArray], FloatArray]:
    """The product x -> K x (S, B) by which ``chain.solve_coupled`` takes the closures into account.

    K consists of the blocks J_a^T J_b and J_b^T J_a of each closure from a to b, which lie off the block-tridiagonal chain.
    """
    cross = np.einsum("nmi,nmj->nij", factors.closures.source, factors.closures.target)
    if factors.map_error is not None:
        cross += np.einsum("nmi,nmj->nij", factors.map_error.closures.source, factors.map_error.closures.target)

    def couple(x: FloatArray) -> FloatArray:
        product = np.zeros_like(x)
        np.add.at(product, closures.source, np.einsum("nij,nj->ni", cross, x[closures.target]))
        np.add.at(product, closures.target, np.einsum("nij,ni->nj", cross, x[closures.source]))
        return product

    return couple


def estimate_noise(
    state: State,
    visits: Visits,
    closures: Edges,
    targets: RoadTargets,
    noise: Noise,
    scale_step_variance: FloatArray,
    factor: ChainFactor,
) -> tuple[Noise, FloatArray]:
    """The noise re-estimated from the residuals, and the posterior variance (S - 1,) of each step of the log scale.

    Each variance of odometry and road is multiplied by its sum of squared whitened residuals over the degrees of freedom that
    are left (``variance_factors``). A residual uses up the share J Sigma J^T of one, its variance as predicted by the solution,
    with Sigma from ``factor``. Closures may be false, so that their noise follows from a median without robust weights.

    For a step of the log scale, J Sigma J^T over its robust weight and times its prior variance is its posterior variance. The
    next round adds it to the squared step when it sets the robust weight (``odometry_factors``).
    """
    odometry, road, closing, *_ = all_factors(state, visits, closures, targets, noise, scale_step_variance)
    own, next_ = marginals(factor)
    joint = np.block([[own[:-1], next_], [np.swapaxes(next_, 1, 2), own[1:]]])
    jacobian = np.concatenate([odometry.source, odometry.target], axis=2)
    odometry_used = np.einsum("nmi,nij,nmj->nm", jacobian, joint, jacobian)
    road_used = np.einsum("nmi,nij,nmj->m", road.jacobian, own, road.jacobian)
    of_views = closures.kind != PAINT_EDGE
    each_sq = closing.residual[of_views] ** 2 / np.maximum(closing.weight[of_views, :1], 1e-12)
    unweighted_sq = np.sum(each_sq, axis=1)
    updated = rescaled(
        noise,
        variance_factors(odometry.residual, len(odometry.residual), np.sum(odometry_used, axis=0)),
        variance_factors(road.residual, float(np.sum(targets.weight)), road_used),
        float(np.median(unweighted_sq)) if len(unweighted_sq) else None,
        float(np.median(each_sq[:, 0])) if len(unweighted_sq) else None,
    )
    return updated, odometry_used[:, 3] / odometry.weight[:, 3] * prior_scale_step_variance(state, visits, noise)


def points_on_line(line: RouteLine, arc_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (S, 2) and headings (S,) at arc lengths (S,) of the line; beyond its ends it runs straight on."""
    heading = np.interp(arc_m, line.arc_m, np.unwrap(line.heading_rad))
    points = np.column_stack([np.interp(arc_m, line.arc_m, line.points_m[:, axis]) for axis in (0, 1)])
    beyond = arc_m - np.clip(arc_m, line.arc_m[0], line.arc_m[-1])
    return points + beyond[:, None] * np.column_stack([np.cos(heading), np.sin(heading)]), heading
