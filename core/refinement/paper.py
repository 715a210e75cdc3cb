"""Refinement mode ``paper``, RC-HMM as published (Section III.B of Li et al. 2025): align, match, optimise.

Where the paper is silent:

- the map comes into the network's frame by ``alignment.align``;
- closures that the map itself contradicts are left out, because Eq. (11) has no robust norm;
- matching and optimisation alternate (``rounds``; the paper has one);
- a map whose J of Eq. (12) stays high is bent on to the roads from its beginning (``bend_onto_roads``), once with its closures
  and once without; the answer of the least J wins.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array

from hippodrome.core import se2
from hippodrome.core.matching.hmm.match import MatchedPath, match
from hippodrome.core.refinement.alignment import Alignment, align, apply
from hippodrome.core.refinement.config import PaperRefineConfig
from hippodrome.core.refinement.edges import edges_where
from hippodrome.core.roads.geometry import RoadGeometry, road_geometry
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.solvers.gauss_newton import gauss_newton
from hippodrome.core.solvers.pose_costs import global_residual, local_residual, total_residual
from hippodrome.core.types import CognitiveMap, EdgeKind, Edges, FloatArray, Refinement, RoadMatch, StartPose

DAMPING = 1e-6  # holds what no match determines; against the weight of one matched vertex it moves nothing


def refine_paper(cognitive_map: CognitiveMap, network: RoadNetwork, start: StartPose, config: PaperRefineConfig) -> Refinement:
    """The topometric map in mode ``paper``: poses in the network's frame, and each vertex's place on the roads or why it has
    none.

    Args:
        cognitive_map: a semi-metric map.
        network: the roads.
        start: pose of the first vertex in the network's frame.
        config: constants of the mode.
    """
    geometry = road_geometry(network)
    answer = _rigid_answer(cognitive_map, geometry, start, config)
    for source in (cognitive_map, without_closures(cognitive_map)):
        if answer.cost_per_vertex > config.bent_cost:
            answer = min(answer, _grown_answer(source, geometry, start, config), key=lambda item: item.cost_per_vertex)
    return _refinement(cognitive_map, network, answer)


@dataclass(frozen=True, slots=True, eq=False)
class _Answer:
    """A map laid on the roads, as one piece or bent on to them."""

    poses: FloatArray  # (V, 3) network frame
    alignment: Alignment
    matched: MatchedPath
    cost_per_vertex: float  # J of Eq. (12) over V
    grown: bool  # bent on to the roads from its beginning, not laid on them as one piece


def _rigid_answer(cognitive_map: CognitiveMap, geometry: RoadGeometry, start: StartPose, config: PaperRefineConfig) -> _Answer:
    """The map laid on the roads as one piece by a similarity, then matched and optimised."""
    alignment = align(cognitive_map.poses, start, geometry, config.alignment)
    edges = metric_edges(trusted_edges(cognitive_map, config), alignment.similarity.scale_m)
    return _matched_and_optimised(apply(alignment.similarity, cognitive_map.poses), alignment, edges, geometry, config, False)


def _grown_answer(cognitive_map: CognitiveMap, geometry: RoadGeometry, start: StartPose, config: PaperRefineConfig) -> _Answer:
    """The map aligned by a prefix alone and bent on to the roads from its beginning, then matched and optimised."""
    prefix = cognitive_map.poses[: config.growth_prefix]
    alignment = align(prefix, start, geometry, config.alignment)
    edges = metric_edges(trusted_edges(cognitive_map, config), alignment.similarity.scale_m)
    poses = bend_onto_roads(apply(alignment.similarity, cognitive_map.poses), edges, geometry, config)
    return _matched_and_optimised(poses, alignment, edges, geometry, config, True)


def _matched_and_optimised(
    poses: FloatArray, alignment: Alignment, edges: Edges, geometry: RoadGeometry, config: PaperRefineConfig, grown: bool
) -> _Answer:
    """Match aligned poses (V, 3) to the roads and optimise them, ``rounds`` times in turn.

    In the cost of the answer an unmatched vertex counts as one that was matched at the search radius, so that an answer cannot
    become cheap by leaving the roads.
    """
    matched = match(poses, geometry, config.matching)
    poses, cost = minimise_topometric_cost(poses, edges, matched, config)
    for _ in range(config.rounds - 1):
        matched = match(poses, geometry, config.matching)
        poses, cost = minimise_topometric_cost(poses, edges, matched, config)
    unmatched = float(np.sum(matched.lane < 0)) * config.global_weight * config.matching.radius_m**2
    return _Answer(poses, alignment, matched, (cost + unmatched) / len(poses), grown)


def bend_onto_roads(poses: FloatArray, edges: Edges, geometry: RoadGeometry, config: PaperRefineConfig) -> FloatArray:
    """Bend an aligned map on to the roads, window by window from its beginning, where no single similarity fits the whole map.

    The last vertices laid on the roads so far are a window, which is matched to the roads and optimised. The vertices after it
    then follow rigidly, rescaled by how much the window was stretched, and the window moves on. So heading and scale may drift
    far over the whole map, as long as they drift slowly.

    Args:
        poses: poses of the aligned map, (V, 3) in the network's frame.
        edges: edges of the map, in metres at the alignment's scale.
        geometry: the roads.
        config: length and steps of the window.

    Returns:
        The bent poses, (V, 3).
    """
    scale = 1.0  # metres of the window per metre of ``edges``
    for end in range(config.growth_step, len(poses) + config.growth_step, config.growth_step):
        end = min(end, len(poses))
        begin = max(0, end - config.growth_window)
        inner, window = metric_edges(_edges_within(edges, begin, end), scale), poses[begin:end]
        for _ in range(config.growth_rounds):
            window, _ = minimise_topometric_cost(window, inner, match(window, geometry, config.matching), config)
        stretch = _stretch(window, inner)
        scale *= stretch
        rest = se2.between(poses[end - 1], poses[end:]) * [stretch, stretch, 1.0]
        poses = np.concatenate([poses[:begin], window, se2.compose(window[-1], rest)])
    return poses


def _stretch(poses: FloatArray, edges: Edges) -> float:
    """Factor by which the optimised poses (V, 3) have stretched the measured odometry; 1 where nothing was driven.

    It is the summed length of the odometry edges between the poses, over the summed length as measured. ``bend_onto_roads``
    rescales what follows the window by it.
    """
    odometry = edges_where(edges, edges.kind == EdgeKind.ODOMETRY)
    optimised_m = np.linalg.norm(poses[odometry.target, :2] - poses[odometry.source, :2], axis=1).sum()
    measured_m = np.linalg.norm(odometry.motion[:, :2], axis=1).sum()
    return float(optimised_m / measured_m) if measured_m > 0.0 else 1.0


def _edges_within(edges: Edges, begin: int, end: int) -> Edges:
    """The edges among the vertices begin:end, renumbered so that ``begin`` is vertex 0."""
    low, high = np.minimum(edges.source, edges.target), np.maximum(edges.source, edges.target)
    kept = (low >= begin) & (high < end)
    inner = edges_where(edges, kept)
    return replace(inner, source=inner.source - np.int32(begin), target=inner.target - np.int32(begin))


def without_closures(cognitive_map: CognitiveMap) -> CognitiveMap:
    """The map with dead-reckoned poses and without its closures.

    It is tried for maps that false closures have ruined: where these agree with one another, no test of single closures finds
    them.
    """
    edges, visits = cognitive_map.edges, cognitive_map.visits
    kept = edges.kind == EdgeKind.ODOMETRY
    poses = cognitive_map.poses.copy()
    poses[visits.vertex] = se2.integrate(cognitive_map.poses[visits.vertex[0]], visits.motion)
    return replace(cognitive_map, poses=poses, edges=edges_where(edges, kept))


def trusted_edges(cognitive_map: CognitiveMap, config: PaperRefineConfig) -> Edges:
    """The map's edges in map units, sigmas not below ``min_sigma``, without closures that its own poses contradict.

    Contradicted is a closure whose residual of Eq. (11) at the map's poses exceeds ``closure_gate_sigma``.
    """
    edges, poses = cognitive_map.edges, cognitive_map.poses
    sigma = np.maximum(edges.sigma, config.min_sigma)
    residual, _ = local_residual(poses, edges.source, edges.target, edges.motion, sigma)
    distance = np.linalg.norm(residual.reshape(-1, 3), axis=1)
    kept = (edges.kind != EdgeKind.CLOSURE) | (distance <= config.closure_gate_sigma)
    return edges_where(replace(edges, sigma=sigma), kept)


def metric_edges(edges: Edges, scale_m: float) -> Edges:
    """The edges with p_ab of Eq. (11), Li et al. 2025, and its sigmas in metres: times ``scale_m`` metres per unit."""
    metres = np.array([scale_m, scale_m, 1.0])
    return replace(edges, motion=edges.motion * metres, sigma=edges.sigma * metres)


def minimise_topometric_cost(
    poses: FloatArray, edges: Edges, matched: MatchedPath, config: PaperRefineConfig
) -> tuple[FloatArray, float]:
    """Poses (V, 3) at the minimum of J, Eq. (12), Li et al. 2025, by Gauss-Newton, and J there.

    Vertices that are not matched are held by their edges alone.
    """
    vertex = np.flatnonzero(matched.lane >= 0).astype(np.int32)

    def linearise(state: FloatArray) -> tuple[FloatArray, csr_array]:
        """Residual of Eq. (12) and its Jacobian at the flattened poses (3 V,)."""
        poses_now = state.reshape(-1, 3)
        local = local_residual(poses_now, edges.source, edges.target, edges.motion, edges.sigma)
        global_ = global_residual(poses_now, vertex, matched.matched_m[vertex])
        return total_residual(local, global_, config.local_weight, config.global_weight)

    found = gauss_newton(linearise, poses.ravel(), max_iterations=config.max_iterations, tolerance=1e-4, damping=DAMPING)
    poses = found.state.reshape(-1, 3)
    return np.column_stack([poses[:, :2], se2.wrap(poses[:, 2])]), 2.0 * found.cost


def _refinement(cognitive_map: CognitiveMap, network: RoadNetwork, answer: _Answer) -> Refinement:
    """The answer as a topometric map, with its breaks and what was estimated; the paper has no covariance."""
    matched, alignment = answer.matched, answer.alignment
    road_match = RoadMatch(network.lane_ids, matched.lane, matched.position_m, matched.status)
    log_scale = np.full(len(answer.poses), np.log(alignment.similarity.scale_m))
    refined = replace(
        cognitive_map, frame="network", poses=answer.poses, log_scale=log_scale, covariance=None, road_match=road_match
    )
    estimates = {
        "scale_m_per_unit": alignment.similarity.scale_m,
        "alignment_cost": alignment.cost,
        "alignment_runner_up_cost": alignment.runner_up_cost,
        "grown": float(answer.grown),
        "cost_per_vertex": answer.cost_per_vertex,
        "sigma_z_m": matched.sigma_z_m,
        "beta_m": matched.beta_m,
        "matched_share": float(np.mean(matched.lane >= 0)),
    }
    return Refinement(refined, matched.breaks, estimates)
