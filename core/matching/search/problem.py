"""The input of the route search: the drive, the lane graph and the scales, and all of them in the form for compiled functions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hippodrome.core.matching.search.config import OffNetworkCosts, RouteSearchConfig, SearchCosts
from hippodrome.core.matching.search.hypotheses import Hypotheses, Places
from hippodrome.core.matching.search.model import Drive, GraphTables, OffNetworkModel, SearchModel, StepCosts
from hippodrome.core.matching.search.track import (
    Track,
    driven_arc,
    known_scale_range,
    make_track,
    scale_range,
)
from hippodrome.core.roads.lane_graph import bin_grid
from hippodrome.core.roads.lanes_ahead import SearchGraph, build_search_graph
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, Visits


class InitialHypotheses(NamedTuple):
    """Hypotheses that a search begins with, and the places of the hypotheses off the network."""

    hypotheses: Hypotheses
    places: Places


@dataclass(frozen=True, slots=True, eq=False)
class SearchProblem:
    """A drive to be matched, and the discretised states that it may pass through: bins of lanes times scales."""

    network: RoadNetwork
    track: Track
    log_scale: FloatArray  # (K,) centres of the scale bins, ln(metres per map unit), ascending
    graph: SearchGraph
    costs: SearchCosts
    off_network: OffNetworkCosts
    bin_m: float


def search_problem(visits: Visits, network: RoadNetwork, config: RouteSearchConfig) -> SearchProblem:
    """Discretise drive and network: steps of about ``step_m``, bins of lanes, and the scales that the drive's speeds allow.

    A short drive is cut into four steps at least. The lane graph looks as far ahead as one step at the largest scale, and some
    bins farther for the remainder and the tolerance of a step.
    """
    known = config.metres_per_unit
    low, typical, high = scale_range(visits, network) if known is None else known_scale_range(known)
    log_scale = np.arange(np.log(low), np.log(high) + config.scale_bin, config.scale_bin)
    track = make_track(visits, min(config.step_m / typical, 0.25 * driven_arc(visits)[-1]))
    graph = build_search_graph(network, track.step * np.exp(log_scale[-1]) + 4.0 * config.bin_m, config.bin_m)
    return SearchProblem(network, track, log_scale, graph, config.costs, config.off_network, config.bin_m)


def compiled_drive(problem: SearchProblem, heading_rad: FloatArray, place_prior: FloatArray | None = None) -> Drive:
    """The drive in the form for the compiled search.

    Args:
        problem: has the length of a step.
        heading_rad: (T,) headings by odometry: those of the problem's track, or a part of them, perhaps in reverse order.
        place_prior: (T, 3) x, y and 1/sigma^2 of the place at each sample, as far as it is known; None: nothing is known.
    """
    nothing_known = np.zeros((len(heading_rad), 3))
    return Drive(np.ascontiguousarray(heading_rad), nothing_known if place_prior is None else place_prior, problem.track.step)


def compiled_model(problem: SearchProblem) -> SearchModel:
    """Lane graph, scales and costs as named tuples, which is the form that compiled functions can take."""
    graph, costs, off = problem.graph, problem.costs, problem.off_network
    return SearchModel(
        scales=np.exp(problem.log_scale),
        graph=GraphTables(
            ahead=graph.ahead,
            heading_rad=graph.heading_rad,
            lane=graph.lane,
            position_m=graph.position_m,
            points_m=graph.points_m,
        ),
        costs=StepCosts(
            heading_sigma_rad=costs.heading_sigma_rad,
            heading_limit_nats=costs.heading_limit_nats,
            offset_gain=costs.offset_gain,
            half_bin_m=0.5 * problem.bin_m,
            length_sigma_m=costs.length_sigma_m,
            scale_step_nats=costs.scale_step_nats,
            scale_jump_nats=costs.scale_jump_nats,
            lane_change_nats=costs.lane_change_nats,
        ),
        off_network=OffNetworkModel(
            grid=bin_grid(graph),
            return_nats=off.return_nats,
            drift=off.drift,
            turn_limit_rad=off.turn_limit_rad,
            leave_nats=off.leave_nats,
            step_nats=off.step_nats,
            spread_nats=off.spread_nats,
        ),
    )
