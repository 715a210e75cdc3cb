"""Refinement mode ``route``, RC-HMM beyond the paper: route search on raw motions, then refinement to decimetres.

Start and scale are unknown. The search finds the route from the raw motions alone. Then three kinds of factors hold every
keyframe: the line of the route (point to line, robust), raw odometry with a drifting scale and a gyro whose gain and bias are
estimated, and the loop closures that agree with both.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hippodrome.core.matching.confidence import match_breaks, match_status, reject_displaced, reject_doubtful, reject_uncertain
from hippodrome.core.matching.control import control_of
from hippodrome.core.matching.lane_choice import choose_lanes, near_lane_changes, on_parallel_lanes
from hippodrome.core.matching.route_line import RouteLine, route_line
from hippodrome.core.matching.search.problem import search_problem
from hippodrome.core.matching.search.route import Route, most_likely_drive
from hippodrome.core.refinement.borders import places_by_borders
from hippodrome.core.refinement.config import RouteRefineConfig
from hippodrome.core.refinement.edges import edges_where
from hippodrome.core.refinement.residuals import GYRO
from hippodrome.core.refinement.solver import RouteSolution, refine_along_route
from hippodrome.core.roads.network import RoadNetwork
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
    UInt8Array,
)


def refine_route(
    cognitive_map: CognitiveMap, network: RoadNetwork, config: RouteRefineConfig, start: StartPose | None = None
) -> Refinement:
    """The topometric map in mode ``route``, from an unknown start unless one is given."""
    line, solution, status = solve_route(cognitive_map, network, config, start)
    return _refinement(cognitive_map, network, line, solution, status)


def solve_route(
    cognitive_map: CognitiveMap, network: RoadNetwork, config: RouteRefineConfig, start: StartPose | None = None
) -> tuple[RouteLine, RouteSolution, UInt8Array]:
    """The route's line, the solution for S keyframes along it, and the MatchStatus (S,) of each.

    Headings alone do not tell parallel lanes apart. Where the route has such lanes, a first refinement leaves the keyframes free
    to lie on any of them; the lanes are then chosen from its metric poses, and a second one holds the keyframes on those.
    """
    visits, closures = cognitive_map.visits, keyframe_closures(cognitive_map)
    problem = search_problem(visits, network, config.search)
    route = most_likely_drive(problem, config.search, start)
    control = control_of(problem, config.search, route)
    status = match_status(route, control, config.confidence, closures, start is not None)[route.track.visit_samples()]
    vouched = (status != MatchStatus.OFF_NETWORK).astype(np.float64)
    log_scale = np.interp(route.track.visit_arc, route.track.arc, route.log_scale)
    line, arc = _line_and_places(route, network)
    free = on_parallel_lanes(line, network)
    solver = config.solver
    if solver.survey_sigma_m is None:
        solver = replace(solver, survey_sigma_m=network.survey_sigma_m)
    read = network if config.road_reading else None
    solution = refine_along_route(visits, closures, line, arc, log_scale, vouched, free, solver, read)
    if np.any(free):
        drawn = np.column_stack([solution.state.drawn_points_m, solution.state.poses[:, 2]])
        edges = None if read is None or visits.lane is None else visits.lane.edge_percent
        places = None if edges is None else places_by_borders(drawn, edges, network)[0]
        chosen = choose_lanes(drawn, vouched > 0.0, network, config.search, places)
        line, arc = _line_and_places(chosen, network)
        log_scale, free = solution.state.log_scale, near_lane_changes(line, network)
        solution = refine_along_route(visits, closures, line, arc, log_scale, vouched, free, solver, read)
    status = reject_displaced(status, route, solution.state.drawn_points_m, config.confidence)
    status = reject_doubtful(status, route, solution.state.drawn_points_m, config.confidence)
    status = reject_uncertain(status, solution.assumed_covariance[:, :2, :2], config.confidence)
    return line, solution, status


def _line_and_places(route: Route, network: RoadNetwork) -> tuple[RouteLine, FloatArray]:
    """The route's line, and the arc length of each keyframe on it (S,)."""
    line, state_arc = route_line(route, network)
    return line, np.interp(route.track.visit_arc, route.track.arc, state_arc)


def keyframe_closures(cognitive_map: CognitiveMap) -> Edges:
    """The map's loop closures as edges between keyframes, whose poses are the unknowns of the solver.

    In place of each vertex stands the keyframe that made it.
    """
    closures = edges_where(cognitive_map.edges, cognitive_map.edges.kind == EdgeKind.CLOSURE)
    first = first_keyframes(cognitive_map)
    return replace(closures, source=first[closures.source], target=first[closures.target])


def first_keyframes(cognitive_map: CognitiveMap) -> IntArray:
    """Index (V,) of the keyframe that made each vertex. Our mapper makes one vertex per keyframe; a stored map may share them."""
    order = np.arange(len(cognitive_map.visits.vertex), dtype=np.int32)
    first = np.zeros(len(cognitive_map.poses), dtype=np.int32)
    first[cognitive_map.visits.vertex[::-1]] = order[::-1]  # written backwards: of several keyframes the first one remains
    return first


def _refinement(
    cognitive_map: CognitiveMap, network: RoadNetwork, line: RouteLine, solution: RouteSolution, keyframe_status: UInt8Array
) -> Refinement:
    """The answer of the mode: the solution for S keyframes as a map of V vertices, with breaks and estimates."""
    first = first_keyframes(cognitive_map)
    status = keyframe_status[first]
    refined = replace(
        cognitive_map,
        frame="network",
        poses=solution.state.poses[first],
        log_scale=solution.state.log_scale[first],
        covariance=_covariance(solution.covariance[first][:, :3, :3], network, status),
        road_match=_road_match(network, line, solution.arc_m[first], status),
    )
    error_m = solution.state.map_error_m
    return Refinement(refined, match_breaks(status), _estimates(solution), None if error_m is None else error_m[first])


def _road_match(network: RoadNetwork, line: RouteLine, arc_m: FloatArray, status: UInt8Array) -> RoadMatch:
    """Lane and arc length on it at arc lengths (V,) of the route's line; unmatched where ``status`` (V,) says so."""
    sample = np.clip(np.searchsorted(line.arc_m, arc_m), 0, len(line.arc_m) - 1)
    matched = (status == MatchStatus.MATCHED) & (line.lane[sample] >= 0)
    lane = np.where(matched, line.lane[sample], -1).astype(np.int32)
    position = np.clip(line.position_m[sample] + arc_m - line.arc_m[sample], 0.0, network.lane_lengths_m()[lane])
    return RoadMatch(network.lane_ids, lane, np.where(matched, position, np.nan), status)


def _covariance(covariance: FloatArray, network: RoadNetwork, status: UInt8Array) -> FloatArray:
    """The covariance (V, 3, 3) of the poses, enlarged where the route is ambiguous, as the vertex may then be anywhere.

    The variance of the positions of all lanes in the network is added there.
    """
    anywhere = np.diag([*np.var(network.points_m, axis=0), 0.0])
    added: FloatArray = covariance + (status == MatchStatus.AMBIGUOUS)[:, None, None] * anywhere
    return added


def _estimates(solution: RouteSolution) -> dict[str, float]:
    """What the refinement has estimated besides the poses, for reports: name, with its unit, to value."""
    noise, shown_m = solution.noise, solution.shown_survey_sigma_m
    of_map = {} if shown_m is None else {"survey_sigma_m": shown_m}
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
        **of_map,
    }
    if noise.closure_along_factor is None:
        return estimates
    read = {"slip_m": float(solution.state.gyro[GYRO]), "closure_along_sigma_factor": noise.closure_along_factor}
    return {**estimates, **read}
