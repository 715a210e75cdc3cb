"""RC-HMM as the paper has it (mode ``paper``), Section III.B of Li et al. 2025: align, match, optimise.

Where the paper is silent: the map comes into the network frame by ``alignment.align``; the closures that the map itself
contradicts are left out, because Eq. (11) has no robust norm; matching and optimisation may alternate (``rounds``; the paper: 1).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from scipy.sparse import csr_array

from hippodrome.core import se2
from hippodrome.core.alignment import Alignment, AlignmentConfig, align, apply
from hippodrome.core.gauss_newton import gauss_newton
from hippodrome.core.matching.paper import MatchedPath, PaperMatchConfig, match
from hippodrome.core.road_geometry import road_geometry
from hippodrome.core.road_network import RoadNetwork
from hippodrome.core.topometric_cost import global_residual, local_residual, total_residual
from hippodrome.core.types import CognitiveMap, EdgeKind, Edges, FloatArray, Refinement, RoadMatch, StartPose


@dataclass(frozen=True, slots=True)
class PaperRefineConfig:
    """Mode ``paper``."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    alignment: AlignmentConfig = field(default_factory=AlignmentConfig)
    matching: PaperMatchConfig = field(default_factory=PaperMatchConfig)
    rounds: int = 4  # of match and optimise; each undoes some of the along-track error of the last projection
    local_weight: float = 1.0  # w_l of Eq. (12)
    global_weight: float = 0.16  # w_g of Eq. (12), 1/m^2: a vertex may lie 2.5 m from its matched position at the price of 1 sigma
    closure_gate_sigma: float = 4.0  # closures farther than this from the map's own poses are left out
    min_sigma: tuple[float, float, float] = (0.05, 0.05, 0.005)  # floor of the edges' sigma: map units, map units, rad
    max_iterations: int = 20


def refine_paper(cognitive_map: CognitiveMap, network: RoadNetwork, start: StartPose, config: PaperRefineConfig) -> Refinement:
    """The topometric map: vertices in the network frame, metres, each with its place on the roads or the reason why not."""
    geometry = road_geometry(network)
    alignment = align(cognitive_map.poses, start, geometry, config.alignment)
    edges = metric_edges(trusted_edges(cognitive_map, config), alignment.similarity.scale_m)
    poses = apply(alignment.similarity, cognitive_map.poses)
    matched = match(poses, geometry, config.matching)
    for _ in range(config.rounds - 1):
        matched = match(optimise(poses, edges, matched, config), geometry, config.matching)
    poses = optimise(poses, edges, matched, config)
    return _refinement(cognitive_map, network, poses, alignment, matched)


def trusted_edges(cognitive_map: CognitiveMap, config: PaperRefineConfig) -> Edges:
    """The edges less those closures that lie ``closure_gate_sigma`` from the poses of the map, sigmas floored, in map units."""
    edges, poses = cognitive_map.edges, cognitive_map.poses
    sigma = np.maximum(edges.sigma, config.min_sigma)
    residual, _ = local_residual(poses, edges.source, edges.target, edges.motion, sigma)
    distance = np.linalg.norm(residual.reshape(-1, 3), axis=1)
    kept = (edges.kind != EdgeKind.CLOSURE) | (distance <= config.closure_gate_sigma)
    return Edges(edges.source[kept], edges.target[kept], edges.motion[kept], sigma[kept], edges.kind[kept], edges.margin[kept])


def metric_edges(edges: Edges, scale_m: float) -> Edges:
    """p_ab of Eq. (11), Li et al. 2025, in metres: the motions and their sigmas times the alignment's scale."""
    metres = np.array([scale_m, scale_m, 1.0])
    return replace(edges, motion=edges.motion * metres, sigma=edges.sigma * metres)


def optimise(poses: FloatArray, edges: Edges, matched: MatchedPath, config: PaperRefineConfig) -> FloatArray:
    """Minimum of Eq. (12), Li et al. 2025, by Gauss-Newton. Unmatched vertices hang on their edges alone."""
    vertex = np.flatnonzero(matched.lane >= 0).astype(np.int32)

    def linearise(state: FloatArray) -> tuple[FloatArray, csr_array]:
        at = state.reshape(-1, 3)
        local = local_residual(at, edges.source, edges.target, edges.motion, edges.sigma)
        on_road = global_residual(at, vertex, matched.matched_m[vertex])
        return total_residual(local, on_road, config.local_weight, config.global_weight)

    damping = 1e-6  # holds what no match determines; against the weight of one matched vertex it moves nothing
    state = gauss_newton(linearise, poses.ravel(), max_iterations=config.max_iterations, tolerance=1e-4, damping=damping).state
    poses = state.reshape(-1, 3)
    return np.column_stack([poses[:, :2], se2.wrap(poses[:, 2])])


def _refinement(
    cognitive_map: CognitiveMap, network: RoadNetwork, poses: FloatArray, alignment: Alignment, matched: MatchedPath
) -> Refinement:
    road_match = RoadMatch(network.lane_ids, matched.lane, matched.position_m, matched.status)
    log_scale = np.full(len(poses), np.log(alignment.similarity.scale_m))
    refined = replace(cognitive_map, frame="network", poses=poses, log_scale=log_scale, covariance=None, road_match=road_match)
    estimates = {
        "scale_m_per_unit": alignment.similarity.scale_m,
        "alignment_cost": alignment.cost,
        "alignment_runner_up_cost": alignment.runner_up_cost,
        "sigma_z_m": matched.sigma_z_m,
        "beta_m": matched.beta_m,
        "matched_share": float(np.mean(matched.lane >= 0)),
    }
    return Refinement(refined, matched.breaks, estimates)
