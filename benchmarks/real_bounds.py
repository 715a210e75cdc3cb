"""What the figures of a drive can be at best: the NEES that a right covariance has, and the RPE that roads can tell.

*NEES.* The truth is laid over the result by one rigid fit of the whole drive, which takes from the errors what they have in
common, and the roads around a drive are drawn wrong alike. So the NEES of a right covariance is below 1. Errors that are drawn
from the normal equations of the refinement itself, fitted alike, tell what it is.

*RPE.* A monocular odometry whose scale errs from step to step learns its way from roads only where they bend: there, a place
across one direction is a place along the other. The best linear estimate (Wiener; kriging) that knows the true statistics of the
scale's error, and is told its place along the road by each bend of a map that is itself off, errs by what ``best_rpe_m`` says.
No linear estimate from the same roads and the same odometry does better in the mean.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from benchmarks.real_drives import RealDrive
from hippodrome.core.matching.route_line import RouteLine
from hippodrome.core.refinement.factors import BinaryFactors, UnaryFactors
from hippodrome.core.refinement.residuals import (
    BIAS_SIGMA_RADPS,
    GAIN_SIGMA,
    Factors,
    normal_equations,
)
from hippodrome.core.refinement.solver import RouteSolution
from hippodrome.core.roads.network import BoolArray
from hippodrome.core.solvers.chain import factorise, solve
from hippodrome.core.types import Edges, FloatArray
from hippodrome.eval.metrics.alignment import umeyama

DRAWS = 100
BEND_M = 20.0  # over which a bend is measured
STRAIGHT_RAD = 0.4  # turned between two places whose roads' errors are compared across
NEAR_M = 15.0  # a place is looked for so far along the line from where the refinement has it
LEAST_BEND_RAD = 0.001  # a smaller bend tells as little
ANYWHERE_M = 100.0  # sigma of the place at which the drive began


def nees_after_fit(points_m: FloatArray, covariance: FloatArray, true_m: FloatArray, vouched: BoolArray) -> float:
    """NEES per dimension of points (S, 2), in the mean of those that are vouched for, after a rigid fit of them all."""
    fit = umeyama(points_m, true_m, with_scale=False)
    off = points_m @ fit.rotation.T + fit.translation_m - true_m
    turned = fit.rotation @ covariance @ fit.rotation.T
    nees = np.einsum("ni,nij,nj->n", off, np.linalg.inv(turned), off) / 2.0
    return float(np.mean(nees[vouched])) if np.any(vouched) else float("nan")


def expected_nees(
    solution: RouteSolution, closures: Edges, true_m: FloatArray, vouched: BoolArray, rng: np.random.Generator
) -> tuple[float, float, float]:
    """The ``nees_after_fit`` that a drive without closures has if its covariance is right: mean, and where 90 % of them lie.

    x = A^-1 J^T z has the covariance A^-1 = (J^T J)^-1 if z is standard normal.
    """
    assert not len(closures.source), "the covariance of a drive with closures is none of one system of equations"
    covariance, drawn = solution.covariance[:, :2, :2], []
    factor = factorise(normal_equations(solution.state, solution.factors, closures))
    for _ in range(DRAWS):
        gyro = rng.standard_normal(2) * [GAIN_SIGMA, BIAS_SIGMA_RADPS]
        system = normal_equations(replace(solution.state, gyro=gyro), _random(solution.factors, rng), closures)
        error_m = solve(factor, system.rhs, system.rhs_border)[0][:, :2]
        drawn.append(nees_after_fit(true_m + error_m, covariance, true_m, vouched))
    low, high = np.quantile(drawn, [0.05, 0.95])
    return float(np.mean(drawn)), float(low), float(high)


def _random(factors: Factors, rng: np.random.Generator) -> Factors:
    """The factors with standard normal residuals."""

    def unary(part: UnaryFactors) -> UnaryFactors:
        return replace(part, residual=rng.standard_normal(part.residual.shape))

    def binary(part: BinaryFactors) -> BinaryFactors:
        return replace(part, residual=rng.standard_normal(part.residual.shape))

    of_map = factors.map_error
    if of_map is not None:
        of_map = of_map._replace(first=unary(of_map.first), steps=binary(of_map.steps))
    return factors._replace(odometry=binary(factors.odometry), road=unary(factors.road), map_error=of_map)


def map_sigma_m(drive: RealDrive, solution: RouteSolution, line: RouteLine, length_m: float) -> float:
    """How far the driven roads are drawn off one against the other: sigma of an Ornstein-Uhlenbeck process of ``length_m``.

    It has the mean squared difference, over ``BEND_M`` of a fairly straight road, of how far beside its drawn lane the vehicle
    drove. An error that all roads have in common, and driving beside the middle of the lane, are no part of it.
    """
    fit = umeyama(drive.true_poses[:, :2], solution.state.poses[:, :2], with_scale=False)
    there = drive.true_poses[:, :2] @ fit.rotation.T + fit.translation_m
    aside = np.array([_aside_m(line, arc, point) for arc, point in zip(solution.arc_m, there, strict=True)])
    arc, turned = _arc_m(drive), np.append(0.0, np.cumsum(np.abs(np.diff(_headings(drive)))))
    after = np.searchsorted(arc, arc + BEND_M)
    first = np.flatnonzero(after < len(arc))
    first = first[turned[after[first]] - turned[first] < STRAIGHT_RAD]
    half_squared = 0.5 * np.mean((aside[after[first]] - aside[first]) ** 2)
    return float(np.sqrt(half_squared / -np.expm1(-BEND_M / length_m)))


def best_rpe_m(drive: RealDrive, log_scale: FloatArray, sigma_m: float, length_m: float, over_m: float) -> float:
    """The least RPE along the road over ``over_m`` that a linear estimate has, which is told its place by every bend of the road.

    Args:
        drive: the drive.
        log_scale: (S - 1,) by which each step of the odometry is wrong.
        sigma_m: how far roads are drawn off, one against the other; errors have a correlation length of ``length_m``.
        length_m: see above.
        over_m: length of the way over which the motion is compared.
    """
    arc, step_m = _arc_m(drive), drive.true_steps_m
    covariance = scale_covariance(0.5 * (arc[1:] + arc[:-1]), log_scale)
    way = np.vstack([np.zeros(len(step_m)), np.tri(len(step_m)) * step_m])  # (S, S - 1) metres driven, by each log scale
    begin = np.hstack([np.ones((len(arc), 1)), way])  # where the drive began is unknown, too
    prior = np.zeros((len(arc), len(arc)))
    prior[0, 0], prior[1:, 1:] = ANYWHERE_M**2, covariance
    told = begin @ prior @ begin.T + np.diag(told_sigmas_m(drive, sigma_m, length_m) ** 2)
    left = prior - prior @ begin.T @ np.linalg.solve(told, begin @ prior)
    after = np.searchsorted(arc, arc + over_m)
    first = np.flatnonzero(after < len(arc))
    ahead = begin[after[first]] - begin[first]
    variance = np.einsum("ni,ij,nj->n", ahead, left, ahead)
    return float(np.sqrt(2.0 / np.pi) * np.mean(np.sqrt(np.maximum(variance, 0.0))))


def told_sigmas_m(drive: RealDrive, sigma_m: float, length_m: float) -> FloatArray:
    """How well (S,) the road around each keyframe tells the place along it, in metres.

    Where it turns by an angle over ``BEND_M``, the error across, that of one direction against the other, is one along it, over
    the sine of the angle. Keyframes whose bends overlap are taken for witnesses that know nothing of each other: more than is
    known.
    """
    arc, headings = _arc_m(drive), _headings(drive)
    turned = np.interp(arc + BEND_M / 2, arc, headings) - np.interp(arc - BEND_M / 2, arc, headings)
    across_m = sigma_m * np.sqrt(-2.0 * np.expm1(-BEND_M / length_m))
    sigmas: FloatArray = across_m / np.sin(np.clip(np.abs(turned), LEAST_BEND_RAD, np.pi / 2))
    return sigmas


def scale_covariance(arc_m: FloatArray, log_scale: FloatArray) -> FloatArray:
    """Covariance (N, N) of the log scale at places (N,) along the way: the most likely sum of two exponentials and a nugget."""
    apart = np.abs(arc_m[:, None] - arc_m)
    wanted = log_scale - np.median(log_scale)
    spread = 1.4826 * np.median(np.abs(wanted))
    wanted = np.clip(wanted, -4.0 * spread, 4.0 * spread)  # steps on the spot have no scale

    def covariance(logs: FloatArray) -> FloatArray:
        fast, fast_m, slow, slow_m, nugget = np.exp(logs)
        each = (nugget + 1e-4) ** 2 * np.eye(len(arc_m))
        found: FloatArray = fast**2 * np.exp(-apart / fast_m) + slow**2 * np.exp(-apart / slow_m) + each
        return found

    def unlikely(logs: FloatArray) -> float:
        lower = np.linalg.cholesky(covariance(logs))
        return 0.5 * float(np.sum(np.linalg.solve(lower, wanted) ** 2)) + float(np.sum(np.log(np.diag(lower))))

    start = np.log([0.7 * spread, 10.0, 0.7 * spread, 100.0, 0.1 * spread])
    return covariance(minimize(unlikely, start, method="Nelder-Mead", options={"maxiter": 200}).x)


def _arc_m(drive: RealDrive) -> FloatArray:
    return np.concatenate([[0.0], np.cumsum(drive.true_steps_m)])


def _headings(drive: RealDrive) -> FloatArray:
    return np.unwrap(drive.true_poses[:, 2])


def _aside_m(line: RouteLine, arc_m: float, point_m: FloatArray) -> float:
    """How far to the left of the line a point lies whose place on it is about ``arc_m``."""
    first, end = np.searchsorted(line.arc_m, [arc_m - NEAR_M, arc_m + NEAR_M])
    near = slice(min(int(first), len(line.arc_m) - 1), max(int(end), 1))
    off = point_m - line.points_m[near]
    nearest = int(np.argmin(np.hypot(off[:, 0], off[:, 1])))
    heading = line.heading_rad[near][nearest]
    return float(np.cos(heading) * off[nearest, 1] - np.sin(heading) * off[nearest, 0])
