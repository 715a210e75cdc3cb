"""Gauss-Newton rounds of the default refinement: project onto the route's line, solve, estimate the noise anew."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hippodrome.core.matching.lane_choice import unknown_lane_sigma_m
from hippodrome.core.matching.projection import reproject
from hippodrome.core.matching.route_line import RouteLine
from hippodrome.core.refinement.covariance import calibrated, posterior
from hippodrome.core.refinement.noise import Noise, per_freedom, reestimated
from hippodrome.core.refinement.residuals import (
    State,
    Targets,
    closures,
    moved,
    normal_equations,
    odometry,
    road,
)
from hippodrome.core.roads.network import BoolArray
from hippodrome.core.solvers.chain import ChainFactor, marginals, solve_coupled
from hippodrome.core.types import Edges, FloatArray, Visits


@dataclass(frozen=True, slots=True)
class SolverConfig:
    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    along_sigma_m: tuple[float, ...] = (3.0, 6.0, 12.0, *[np.inf] * 8)  # per round: let go slowly, then let the noise settle
    inner_iterations: int = 2
    reprojection_m: float = 4.0  # arc length that a vertex may slide in one round
    unvouched_weight: float = 1e-6  # of the road where nothing vouches for it: too little to pull, enough to be determined
    survey_sigma_m: float = 0.0  # of the road network itself, per axis; no drive shows it, so whoever knows it must say it


MOST_CG_STEPS = 100  # 10-30 are usual; a step cut short is made up for by the next round


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    state: State
    arc_m: FloatArray  # (S,) on the route line
    noise: Noise
    covariance: FloatArray  # (S, 4, 4) x, y, heading, log scale


def optimise(
    visits: Visits,
    edges: Edges,
    line: RouteLine,
    arc_m: FloatArray,
    log_scale: FloatArray,
    vouched: FloatArray,
    free: BoolArray,
    config: SolverConfig,
) -> Solution:
    """The most likely poses and scales of S visits, from their places ``arc_m`` (S,) on the line.

    ``vouched`` (S,): 1 on this road, 0 not known. ``free`` (P,): where the line's lane may be the wrong one of several.
    """
    points, heading = on_line(line, arc_m)
    state = State(np.column_stack([points, heading]), log_scale, np.zeros(2))
    noise, unseen = Noise(), scale_variance(state, visits, Noise())
    on_road = np.maximum(vouched, config.unvouched_weight)
    for along_sigma_m in config.along_sigma_m:
        arc_m = reproject(line, state.poses[:, :2], arc_m, config.reprojection_m)
        points, heading = on_line(line, arc_m)
        freedom = np.hypot(unknown_lane_sigma_m(line, arc_m, free), config.survey_sigma_m)
        targets = Targets(points, heading, curvature(line, arc_m), freedom, on_road, along_sigma_m)
        for _ in range(config.inner_iterations):
            state, factor = gauss_newton_step(state, visits, edges, targets, noise, unseen)
        noise, unseen = estimate_noise(state, visits, edges, targets, noise, unseen, factor)
    groups = odometry(state, visits, noise, unseen), road(state, targets, noise), closures(state, edges, noise)
    return Solution(state, arc_m, noise, calibrated(posterior(state, *groups, edges), config.survey_sigma_m))


def scale_variance(state: State, visits: Visits, noise: Noise) -> FloatArray:
    """Variance (S - 1,) of the steps of the log scale before anything is seen."""
    metres = np.exp(state.log_scale[:-1]) * np.hypot(visits.motion[1:, 0], visits.motion[1:, 1])
    variance: FloatArray = noise.step_sigmas(metres)[:, 3] ** 2
    return variance


def curvature(line: RouteLine, arc_m: FloatArray, half_m: float = 4.0) -> FloatArray:
    """Curvature (S,) without sign, 1/m, over ``half_m`` (a car's length) either way."""
    heading = np.unwrap(line.heading_rad)
    turned = np.interp(arc_m + half_m, line.arc_m, heading) - np.interp(arc_m - half_m, line.arc_m, heading)
    magnitude: FloatArray = np.abs(turned) / (2.0 * half_m)
    return magnitude


def gauss_newton_step(
    state: State, visits: Visits, edges: Edges, targets: Targets, noise: Noise, unseen: FloatArray, tolerance: float = 1e-4
) -> tuple[State, ChainFactor]:
    """One step on the weighted squares; ``unseen`` (S - 1,) as in ``odometry``; ``tolerance`` of the linear solution's energy."""
    tied = closures(state, edges, noise)
    system = normal_equations(state, odometry(state, visits, noise, unseen), road(state, targets, noise), tied, edges)
    cross = np.einsum("nmi,nmj->nij", tied.here, tied.there)

    def couple(x: FloatArray) -> FloatArray:
        product = np.zeros_like(x)
        np.add.at(product, edges.source, np.einsum("nij,nj->ni", cross, x[edges.target]))
        np.add.at(product, edges.target, np.einsum("nij,ni->nj", cross, x[edges.source]))
        return product

    step, gyro_step, factor = solve_coupled(system, couple, tolerance, MOST_CG_STEPS)
    return moved(state, step, gyro_step), factor


def estimate_noise(
    state: State, visits: Visits, edges: Edges, targets: Targets, noise: Noise, unseen: FloatArray, factor: ChainFactor
) -> tuple[Noise, FloatArray]:
    """Sigmas from squared whitened residuals per degree of freedom left, by kind, and what the scale's steps leave open."""
    own, next_ = marginals(factor)
    steps, roads, tied = odometry(state, visits, noise, unseen), road(state, targets, noise), closures(state, edges, noise)
    joint = np.block([[own[:-1], next_], [np.swapaxes(next_, 1, 2), own[1:]]])
    both = np.concatenate([steps.here, steps.there], axis=2)
    steps_used = np.einsum("nmi,nij,nmj->nm", both, joint, both)
    roads_used = np.einsum("nmi,nij,nmj->m", roads.here, own, roads.here)
    plain_sq = np.sum(tied.residual**2, axis=1) / np.maximum(tied.weight[:, 0], 1e-12)
    updated = reestimated(
        noise,
        per_freedom(steps.residual, len(steps.residual), np.sum(steps_used, axis=0)),
        per_freedom(roads.residual, float(np.sum(targets.on_road)), roads_used),
        float(np.median(plain_sq)) if len(plain_sq) else None,
    )
    return updated, steps_used[:, 3] / steps.weight[:, 3] * scale_variance(state, visits, noise)


def on_line(line: RouteLine, arc_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (S, 2) and headings (S,) at arc lengths; beyond the line's ends it runs straight on."""
    heading = np.interp(arc_m, line.arc_m, np.unwrap(line.heading_rad))
    points = np.column_stack([np.interp(arc_m, line.arc_m, line.points_m[:, axis]) for axis in (0, 1)])
    beyond = arc_m - np.clip(arc_m, line.arc_m[0], line.arc_m[-1])
    return points + beyond[:, None] * np.column_stack([np.cos(heading), np.sin(heading)]), heading
