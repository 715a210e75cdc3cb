"""Which of several parallel lanes was driven: decided once the drive is metric, from its lateral motion and the turns it took.

Headings alone cannot tell parallel lanes apart, so that the route search chooses among them arbitrarily. The first refinement
leaves the vehicle free to lie on any of them; odometry then carries the lateral position over from where turns decide the lane.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hippodrome.core.matching.route_line import RouteLine
from hippodrome.core.matching.search.config import RouteSearchConfig
from hippodrome.core.matching.search.problem import SearchProblem
from hippodrome.core.matching.search.route import Route, best_route
from hippodrome.core.matching.search.starts import starts_near_pose
from hippodrome.core.matching.search.track import Track
from hippodrome.core.roads.lanes_ahead import build_search_graph
from hippodrome.core.roads.network import BoolArray, RoadNetwork
from hippodrome.core.types import FloatArray, StartPose

PLACE_SIGMA_M = 2.5  # sigma of the poses of the first refinement where lanes are parallel: most of a lane's width
UNKNOWN_LANE_SIGMA_M = 4.0  # lateral sigma of more than a lane: the lane that the search happened to choose has no weight
LANE_CHANGE_M = 15.0  # a lane change takes about this long either side of its middle
_SCALE_STEP_NATS = 0.5  # cost of a change of scale by one bin: cheap, since the scale stands for lengths that differ along lanes


def on_parallel_lanes(line: RouteLine, network: RoadNetwork) -> BoolArray:
    """Mask (P,) of the samples of the line that lie on a lane with an adjacent lane, so that either may have been driven."""
    return (line.lane >= 0) & network.has_adjacent_lane()[np.maximum(line.lane, 0)]


def near_lane_changes(line: RouteLine, network: RoadNetwork) -> BoolArray:
    """Which samples (P,) of the line lie within ``LANE_CHANGE_M`` of a lane change, where either lane may be the driven one."""
    before, after = line.lane[:-1], line.lane[1:]
    changes_m = line.arc_m[:-1][network.are_adjacent(before, after) & (before != after)]
    if len(changes_m) == 0:
        return np.zeros(len(line.arc_m), dtype=bool)
    next_ = np.clip(np.searchsorted(changes_m, line.arc_m), 0, len(changes_m) - 1)
    nearest = np.minimum(np.abs(changes_m[next_] - line.arc_m), np.abs(changes_m[np.maximum(next_ - 1, 0)] - line.arc_m))
    near: BoolArray = nearest < LANE_CHANGE_M
    return near


def unknown_lane_sigma_m(line: RouteLine, arc_m: FloatArray, lane_unknown: BoolArray) -> FloatArray:
    """Lateral sigma (S,) in metres that is added where it is uncertain which of several parallel lanes was driven.

    Args:
        line: the route's line of P samples.
        arc_m: (S,) arc lengths on the line for which the sigma is wanted.
        lane_unknown: (P,) samples whose lane may be the wrong one of several.

    Returns:
        ``UNKNOWN_LANE_SIGMA_M`` where the lane of the next sample of the line is uncertain, else 0.
    """
    sample = np.clip(np.searchsorted(line.arc_m, arc_m), 0, len(line.arc_m) - 1)
    sigma: FloatArray = np.where(lane_unknown[sample], UNKNOWN_LANE_SIGMA_M, 0.0)
    return sigma


def choose_lanes(
    poses: FloatArray, matched: BoolArray, network: RoadNetwork, config: RouteSearchConfig, places: FloatArray | None = None
) -> Route:
    """Search the route once more, along metric poses, whose lateral positions decide between parallel lanes.

    Args:
        poses: (S, 3) in the network frame; the search begins near the first.
        matched: (S,) whether a pose also constrains the place of the route; the others contribute their motion only.
        network: the roads.
        config: states, bounds and costs of the search.
        places: (S, 2) where something else than their lateral motion tells the lanes; None: the places of the poses.
    """
    places = poses[:, :2] if places is None else places
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))])
    samples = np.arange(0.0, arc[-1] + 0.5 * config.step_m, config.step_m)
    track = Track(samples, np.interp(samples, arc, np.unwrap(poses[:, 2])), arc, config.step_m)
    log_scale = config.scale_bin * np.arange(-1.0, 2.0)  # lengths along lanes differ a little from those of the poses
    reach_m = config.step_m * float(np.exp(log_scale[-1])) + 4.0 * config.bin_m
    graph = build_search_graph(network, reach_m, config.bin_m)
    costs = replace(config.costs, scale_step_nats=_SCALE_STEP_NATS)
    problem = SearchProblem(network, track, log_scale, graph, costs, config.off_network, config.bin_m)
    between_matched = np.interp(samples, arc, matched.astype(np.float64)) >= 1.0
    at_samples = [np.interp(samples, arc, places[:, axis]) for axis in (0, 1)]
    place_prior = np.column_stack([*at_samples, between_matched / PLACE_SIGMA_M**2])
    start = StartPose(*(float(value) for value in poses[0]))
    return best_route(problem, starts_near_pose(problem, start, config), config, place_prior)
