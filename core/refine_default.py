"""RC-HMM beyond the paper (mode ``default``): route search on raw motions, then refinement to decimetres.

Start and scale are unknown. The vertices hang on the line of the matched route (point to line, robust), on raw odometry with
a drifting scale and a gyro whose gain and bias are estimated, and on the loop closures that agree with it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from hippodrome.core.chain_solver import ChainFactor, marginals, solve_coupled
from hippodrome.core.matching.route_line import RouteLine, route_line
from hippodrome.core.matching.route_search import RouteSearchConfig, search_route
from hippodrome.core.noise_estimation import Noise, per_freedom, reestimated
from hippodrome.core.refinement_residuals import (
    State,
    Targets,
    closures,
    moved,
    normal_equations,
    odometry,
    road,
)
from hippodrome.core.road_network import RoadNetwork
from hippodrome.core.types import (
    CognitiveMap,
    EdgeKind,
    Edges,
    FloatArray,
    IntArray,
    MatchStatus,
    Refinement,
    RoadMatch,
    StartPose,
    Visits,
)


@dataclass(frozen=True, slots=True)
class DefaultRefineConfig:
    """Mode ``default``."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    search: RouteSearchConfig = field(default_factory=RouteSearchConfig)
    along_sigma_m: tuple[float, ...] = (3.0, 6.0, 12.0, np.inf, np.inf, np.inf, np.inf, np.inf)  # per outer round: let go slowly
    inner_iterations: int = 3
    reprojection_m: float = 4.0  # arc length that a vertex may slide in one round


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    state: State
    arc_m: FloatArray  # (S,) on the route line
    noise: Noise
    covariance: FloatArray  # (S, 4, 4)


def refine_default(
    cognitive_map: CognitiveMap, network: RoadNetwork, config: DefaultRefineConfig, start: StartPose | None = None
) -> Refinement:
    """The topometric map, from an unknown start unless one is given."""
    visits = cognitive_map.visits
    route = search_route(visits, network, config.search, start)
    line, state_arc = route_line(route, network)
    arc = np.interp(route.track.visit_arc, route.track.arc, state_arc)
    log_scale = np.interp(route.track.visit_arc, route.track.arc, route.log_scale)
    solution = optimise(visits, closure_edges(cognitive_map), line, arc, log_scale, config)
    return _refinement(cognitive_map, network, line, solution)


def closure_edges(cognitive_map: CognitiveMap) -> Edges:
    """The closures, with the first visit of each vertex in place of the vertex."""
    edges = cognitive_map.edges
    kept = edges.kind == EdgeKind.CLOSURE
    first = first_visits(cognitive_map)
    return Edges(
        first[edges.source[kept]],
        first[edges.target[kept]],
        edges.motion[kept],
        edges.sigma[kept],
        edges.kind[kept],
        edges.margin[kept],
    )


def first_visits(cognitive_map: CognitiveMap) -> IntArray:
    """Index (V,) of the visit that made each vertex."""
    order = np.arange(len(cognitive_map.visits.vertex), dtype=np.int32)
    first = np.zeros(len(cognitive_map.poses), dtype=np.int32)
    first[cognitive_map.visits.vertex[::-1]] = order[::-1]
    return first


def optimise(
    visits: Visits, edges: Edges, line: RouteLine, arc_m: FloatArray, log_scale: FloatArray, config: DefaultRefineConfig
) -> Solution:
    """Gauss-Newton rounds: project onto the line, solve, estimate the noise anew."""
    points, heading = _on_line(line, arc_m)
    state = State(np.column_stack([points, heading]), log_scale, np.zeros(2))
    noise = Noise()
    for along_sigma_m in config.along_sigma_m:
        arc_m = reproject(line, state.poses[:, :2], arc_m, config.reprojection_m)
        points, heading = _on_line(line, arc_m)
        targets = Targets(points, heading, np.ones(len(points)), along_sigma_m)
        for _ in range(config.inner_iterations):
            state, factor = gauss_newton_step(state, visits, edges, targets, noise)
        noise = estimate_noise(state, visits, edges, targets, noise, factor)
    covariance, _ = marginals(factor)
    return Solution(state, arc_m, noise, covariance)


def gauss_newton_step(state: State, visits: Visits, edges: Edges, targets: Targets, noise: Noise) -> tuple[State, ChainFactor]:
    tied = closures(state, edges, noise)
    system = normal_equations(
        state, odometry(state, visits, noise), road(state, targets, noise), tied, edges.source, edges.target
    )
    cross = np.einsum("nmi,nmj->nij", tied.here, tied.there)

    def couple(x: FloatArray) -> FloatArray:
        product = np.zeros_like(x)
        np.add.at(product, edges.source, np.einsum("nij,nj->ni", cross, x[edges.target]))
        np.add.at(product, edges.target, np.einsum("nij,ni->nj", cross, x[edges.source]))
        return product

    step, gyro_step, factor = solve_coupled(system, couple, 1e-4, 100)
    return moved(state, step, gyro_step), factor


def estimate_noise(state: State, visits: Visits, edges: Edges, targets: Targets, noise: Noise, factor: ChainFactor) -> Noise:
    """Squared whitened residuals per degree of freedom left, by kind."""
    own, next_ = marginals(factor)
    steps, roads, tied = odometry(state, visits, noise), road(state, targets, noise), closures(state, edges, noise)
    joint = np.block([[own[:-1], next_], [np.swapaxes(next_, 1, 2), own[1:]]])
    both = np.concatenate([steps.here, steps.there], axis=2)
    steps_used = np.einsum("nmi,nij,nmj->m", both, joint, both)
    roads_used = np.einsum("nmi,nij,nmj->m", roads.here, own, roads.here)
    plain_sq = np.sum(tied.residual**2, axis=1) / np.maximum(tied.weight[:, 0], 1e-12)
    return reestimated(
        noise,
        per_freedom(steps.residual, steps.weight, steps_used),
        per_freedom(roads.residual, roads.weight, roads_used),
        float(np.median(plain_sq)) if len(plain_sq) else None,
    )


def reproject(line: RouteLine, points_m: FloatArray, arc_m: FloatArray, reach_m: float) -> FloatArray:
    """Arc length (S,) of the nearest place on the line within ``reach_m`` of the present one."""
    spacing = (line.arc_m[-1] - line.arc_m[0]) / max(len(line.arc_m) - 1, 1)
    window = np.arange(-int(np.ceil(reach_m / spacing)), int(np.ceil(reach_m / spacing)) + 1)
    middle = np.searchsorted(line.arc_m, arc_m)
    index = np.clip(middle[:, None] + window, 0, len(line.arc_m) - 1)
    gap = points_m[:, None] - line.points_m[index]
    best = index[np.arange(len(index)), np.argmin(np.sum(gap**2, axis=2), axis=1)]
    cos, sin = np.cos(line.heading_rad[best]), np.sin(line.heading_rad[best])
    off = points_m - line.points_m[best]
    ahead = np.clip(cos * off[:, 0] + sin * off[:, 1], -spacing, spacing)
    return line.arc_m[best] + ahead


def _on_line(line: RouteLine, arc_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (S, 2) and headings (S,) at arc lengths; beyond the line's ends it runs straight on."""
    heading = np.interp(arc_m, line.arc_m, np.unwrap(line.heading_rad))
    points = np.column_stack([np.interp(arc_m, line.arc_m, line.points_m[:, axis]) for axis in (0, 1)])
    beyond = arc_m - np.clip(arc_m, line.arc_m[0], line.arc_m[-1])
    return points + beyond[:, None] * np.column_stack([np.cos(heading), np.sin(heading)]), heading


def _refinement(cognitive_map: CognitiveMap, network: RoadNetwork, line: RouteLine, solution: Solution) -> Refinement:
    first = first_visits(cognitive_map)
    sample = np.clip(np.searchsorted(line.arc_m, solution.arc_m[first]), 0, len(line.arc_m) - 1)
    lane = line.lane[sample]
    position = np.clip(line.position_m[sample] + solution.arc_m[first] - line.arc_m[sample], 0.0, network.lane_lengths_m()[lane])
    match = RoadMatch(network.lane_ids, lane.astype(np.int32), position, np.full(len(first), MatchStatus.MATCHED, dtype=np.uint8))
    refined = replace(
        cognitive_map,
        frame="network",
        poses=solution.state.poses[first],
        log_scale=solution.state.log_scale[first],
        covariance=solution.covariance[first][:, :3, :3],
        road_match=match,
    )
    noise = solution.noise
    estimates = {
        "odometry_along_m_per_root_m": noise.along,
        "odometry_across_m_per_root_m": noise.across,
        "odometry_heading_rad_per_root_m": noise.heading,
        "log_scale_per_root_m": noise.log_scale,
        "lateral_sigma_m": noise.lateral_m,
        "lane_heading_sigma_rad": noise.lane_heading_rad,
        "closure_sigma_factor": noise.closure_factor,
        "gyro_gain_error": float(solution.state.gyro[0]),
        "gyro_bias_radps": float(solution.state.gyro[1]),
    }
    return Refinement(refined, (), estimates)
