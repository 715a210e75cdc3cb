"""What the route search runs on: the drive, the lane graph, the scales, as the compiled kernel takes them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from hippodrome.core.matching.search.config import OffNetworkCosts, RouteSearchConfig, SearchCosts
from hippodrome.core.matching.search.hypotheses import OffRows, Rows
from hippodrome.core.matching.search.track import (
    Track,
    driven,
    make_track,
    scale_range,
)
from hippodrome.core.roads.lane_graph import LaneGraph, bin_grid, build_lane_graph
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, Visits


class Seeds(NamedTuple):
    """Hypotheses that a search begins with."""

    rows: Rows
    off_rows: OffRows


@dataclass(frozen=True, slots=True, eq=False)
class SearchField:
    network: RoadNetwork
    track: Track
    log_scale: FloatArray  # (K,) centres of the scale bins, ln(metres per map unit)
    graph: LaneGraph
    costs: SearchCosts
    off_network: OffNetworkCosts
    bin_m: float


def search_field(visits: Visits, network: RoadNetwork, config: RouteSearchConfig) -> SearchField:
    """Fine bins over the whole network, and the drive in steps of about ``step_m``."""
    low, typical, high = scale_range(visits, network)
    log_scale = np.arange(np.log(low), np.log(high) + config.scale_bin, config.scale_bin)
    track = make_track(visits, min(config.step_m / typical, 0.25 * driven(visits)[-1]))
    graph = build_lane_graph(network, track.step * np.exp(log_scale[-1]) + 4.0 * config.bin_m, config.bin_m)
    return SearchField(network, track, log_scale, graph, config.costs, config.off_network, config.bin_m)


class KernelArguments(NamedTuple):
    """What both passes of the compiled search take, in its order."""

    heading_rad: FloatArray
    places: FloatArray  # (T, 3) x, y, 1/sigma^2 of what is known of the place at each heading
    step: float
    scales: FloatArray
    tables: tuple[Any, ...]
    costs: tuple[Any, ...]
    off: tuple[Any, ...]


def kernel_arguments(field: SearchField, heading_rad: FloatArray, places: FloatArray | None = None) -> KernelArguments:
    graph, costs, off = field.graph, field.costs, field.off_network
    tables = graph.reach_start, graph.reach_bin, graph.reach_m, graph.reach_changes, graph.heading_rad, graph.lane, graph.points_m
    on_road = (
        costs.heading_sigma_rad, costs.heading_limit_nats, costs.offset_gain, 0.5 * field.bin_m, costs.length_sigma_m,
        costs.scale_step_nats, costs.scale_jump_nats, costs.lane_change_nats,
    )  # fmt: skip
    cells = bin_grid(graph)
    grid = graph.points_m, cells.start, cells.bin, cells.origin_m[0], cells.origin_m[1], cells.cell_m, cells.columns, cells.rows
    off_road = off.return_nats, off.drift, off.turn_limit_rad, off.leave_nats, off.step_nats, off.spread_nats
    return KernelArguments(
        np.ascontiguousarray(heading_rad),
        np.zeros((len(heading_rad), 3)) if places is None else places,
        field.track.step,
        np.exp(field.log_scale),
        tables,
        on_road,
        (*grid, *off_road),
    )
