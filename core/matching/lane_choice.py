"""Which of several parallel lanes was driven: decided once the drive is metric, from its lateral motion and the turns it took.

Headings alone cannot tell parallel lanes apart, so that the route search chooses among them at will. The first refinement leaves
the vehicle free to lie on any of them; odometry then carries the lateral position over from where the lanes decide it (turns).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hippodrome.core.matching.route_line import BoolArray, RouteLine
from hippodrome.core.matching.search.config import RouteSearchConfig
from hippodrome.core.matching.search.problem import SearchField
from hippodrome.core.matching.search.route import Route, best_route
from hippodrome.core.matching.search.starts import prior_starts
from hippodrome.core.matching.search.track import Track
from hippodrome.core.roads.lane_graph import build_lane_graph
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, StartPose

PLACE_SIGMA_M = 2.5  # of the first refinement where lanes are parallel: most of a lane
FREE_M = 4.0  # lateral sigma of more than a lane: the lane that the search happened to choose has no weight
CHANGE_M = 15.0  # a lane change takes about this long either side of its middle


def beside_others(line: RouteLine, network: RoadNetwork) -> BoolArray:
    """Which samples (P,) of the line lie on a lane with a parallel one."""
    on_lane = np.maximum(line.lane, 0)
    return (line.lane >= 0) & ((network.left_lane[on_lane] >= 0) | (network.right_lane[on_lane] >= 0))


def freedom_m(line: RouteLine, arc_m: FloatArray, free: BoolArray) -> FloatArray:
    """Lateral sigma (S,) to add at places on the line: ``FREE_M`` where the nearest sample is free."""
    sample = np.clip(np.searchsorted(line.arc_m, arc_m), 0, len(line.arc_m) - 1)
    freedom: FloatArray = np.where(free[sample], FREE_M, 0.0)
    return freedom


def changing(line: RouteLine, network: RoadNetwork) -> BoolArray:
    """Which samples (P,) lie within ``CHANGE_M`` of a lane change."""
    before, after = line.lane[:-1], line.lane[1:]
    known = (before >= 0) & (after >= 0)
    beside = (network.left_lane[before] == after) | (network.right_lane[before] == after)
    changes_m = line.arc_m[:-1][known & beside & (before != after)]
    if len(changes_m) == 0:
        return np.zeros(len(line.arc_m), dtype=bool)
    next_ = np.clip(np.searchsorted(changes_m, line.arc_m), 0, len(changes_m) - 1)
    nearest = np.minimum(np.abs(changes_m[next_] - line.arc_m), np.abs(changes_m[np.maximum(next_ - 1, 0)] - line.arc_m))
    near: BoolArray = nearest < CHANGE_M
    return near


def choose_lanes(poses: FloatArray, matched: BoolArray, network: RoadNetwork, config: RouteSearchConfig) -> Route:
    """The route searched anew along metric poses (S, 3), each of which also says where it is if ``matched`` (S,)."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))])
    samples = np.arange(0.0, arc[-1] + 0.5 * config.step_m, config.step_m)
    track = Track(samples, np.interp(samples, arc, np.unwrap(poses[:, 2])), arc, config.step_m)
    log_scale = config.scale_bin * np.arange(-1.0, 2.0)  # lengths along lanes differ a little from those of the poses
    reach_m = config.step_m * float(np.exp(log_scale[-1])) + 4.0 * config.bin_m
    graph = build_lane_graph(network, reach_m, config.bin_m)
    costs = replace(config.costs, scale_step_nats=0.5)
    field = SearchField(network, track, log_scale, graph, costs, config.off_network, config.bin_m)
    weight = np.interp(samples, arc, matched.astype(np.float64)) >= 1.0
    places = [np.interp(samples, arc, poses[:, axis]) for axis in (0, 1)]
    start = StartPose(*(float(value) for value in poses[0]))
    return best_route(field, prior_starts(field, start, config), config, np.column_stack([*places, weight / PLACE_SIGMA_M**2]))
