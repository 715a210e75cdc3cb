"""Tours: which edges the ego drives, one after the other, so that it covers the roads in both directions and comes back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.se2 import wrap
from hippodrome.core.types import FloatArray, HippodromeError, IntArray
from hippodrome.sim.network import drivable_edges, edge_lengths_m, edge_links, junction_lengths_m

U_TURN_RAD: Final = np.deg2rad(150.0)  # a sharper change of direction is a U-turn
U_TURN_COST_M: Final = 300.0  # a detour this long is preferred to a U-turn
JUNCTION_M: Final = 10.0  # cost of one crossing; it also keeps very short edges from being free
START_ROOM_M: Final = 20.0  # a drive starts on an edge with room for the car and its first metres
OUTSIDE_COST: Final = 5.0  # leaving the toured area must save four fifths of the way
TASTE: Final = 0.3  # standard deviation of the log-normal liking of each edge, which makes tours of different seeds differ


@dataclass(frozen=True, slots=True, eq=False)
class TourGraph:
    """The drivable edges of a network, numbered 0..K-1, and what it takes to drive from one to the next."""

    edges: IntArray  # (K,) index into the network's edge_ids
    length_m: FloatArray  # (K,)
    junction_m: FloatArray  # (K,) mean way through the junction behind each edge
    middle_m: FloatArray  # (K, 2) halfway between each edge's ends
    cost_m: csr_array  # (K, K) of driving the second edge after the first: its length, the junction, a fine for U-turns


def tour_graph(network: RoadNetwork) -> TourGraph:
    """The part of a network in which every edge can be reached from every other."""
    edges = drivable_edges(network)
    if len(edges) == 0:
        raise HippodromeError("road network: no closed loop for passenger cars, so no tour can return; add a way round")
    number = np.full(len(network.edge_ids), -1, dtype=np.int32)
    number[edges] = np.arange(len(edges))
    source, target = (number[side] for side in edge_links(network))
    inside = (source >= 0) & (target >= 0)
    source, target = source[inside], target[inside]
    length = edge_lengths_m(network)[edges]
    start, end = _edge_headings_rad(network, edges)
    turns_back = np.abs(wrap(start[target] - end[source])) > U_TURN_RAD
    cost = length[target] + JUNCTION_M + U_TURN_COST_M * turns_back
    costs = csr_array((cost, (source, target)), shape=(len(edges),) * 2)
    return TourGraph(edges, length, junction_lengths_m(network)[edges], _middles_m(network, edges), costs)


def plan_tour(
    graph: TourGraph,
    area: IntArray,
    length_m: float,
    rng: np.random.Generator,
    visits: IntArray | None = None,
    start: int | None = None,
) -> IntArray:
    """Edge numbers in ``graph`` to drive one after the other within ``area``, at least ``length_m`` long.

    The cheapest way to the nearest of the least visited edges, again and again: a greedy answer to the rural postman's problem.
    ``visits`` (K,) of a drive under way and the edge ``start`` that it continues with give the rest of a tour.
    """
    liking = OUTSIDE_COST * rng.lognormal(0.0, TASTE, len(graph.edges))
    liking[area] /= OUTSIDE_COST
    here = _roomy_edge(graph, area, rng) if start is None else start
    cost = _liked(graph.cost_m, liking)
    count = np.zeros(len(graph.edges), dtype=np.int32) if visits is None else visits.copy()
    driven_m = graph.length_m + graph.junction_m
    tour, driven = [here], float(driven_m[here])
    count[here] += 1
    while driven < length_m:
        for edge in _way_to_least_visited(cost, tour[-1], count, area):
            tour.append(edge)
            count[edge] += 1
            driven += float(driven_m[edge])
    return np.array(tour, dtype=np.int32)


def toured_area(graph: TourGraph, length_m: float) -> IntArray:
    """The edges with the shortest round trips from the middle of the network, as many as make ``length_m``, junctions included.

    It depends on the network only, so that two drives of different seeds meet. Every edge on the round trip to a member has no
    longer a round trip itself, so the area is strongly connected.
    """
    middle = middle_edge(graph)
    round_trip = dijkstra(graph.cost_m, indices=middle) + dijkstra(graph.cost_m.T.tocsr(), indices=middle)
    round_trip[middle] = 0.0
    order = np.argsort(round_trip, kind="stable")
    enough = int(np.searchsorted(np.cumsum((graph.length_m + graph.junction_m)[order]), length_m))
    reach = round_trip[order[min(max(enough, 1), len(order) - 1)]]  # one edge alone is no round trip
    return np.flatnonzero(round_trip <= reach + 1e-6).astype(np.int32)


def coverage_and_revisits(driven: Sequence[int] | IntArray, graph: TourGraph) -> tuple[float, float]:
    """Shares of the drivable length that were driven, and of the driven length that had been driven before, same direction."""
    order = np.asarray(driven, dtype=np.int64)
    unique = np.unique(order)
    total, once = float(graph.length_m[order].sum()), float(graph.length_m[unique].sum())
    return once / float(graph.length_m.sum()), 1.0 - once / total if total > 0.0 else 0.0


def _way_to_least_visited(cost: csr_array, here: int, count: IntArray, area: IntArray) -> list[int]:
    """Edges after ``here`` on the cheapest way to the cheapest edge among the least visited ones of ``area``."""
    distance, before = dijkstra(cost, indices=here, return_predecessors=True)
    others = area[area != here] if len(area) > 1 else area
    wanted = others[count[others] == count[others].min()]
    target = int(wanted[np.argmin(distance[wanted])])
    if target == here:
        return [here]  # an area of one edge is a loop by itself
    way = [target]
    while before[way[-1]] != here:
        way.append(int(before[way[-1]]))
    return way[::-1]


def middle_edge(graph: TourGraph) -> int:
    """The edge nearest to the centre of gravity of the drivable roads."""
    centre = np.average(graph.middle_m, axis=0, weights=graph.length_m)
    return int(np.argmin(np.linalg.norm(graph.middle_m - centre, axis=1)))


def _roomy_edge(graph: TourGraph, area: IntArray, rng: np.random.Generator) -> int:
    """A random edge of the area that is long enough to start on, if there is one."""
    roomy = area[graph.length_m[area] >= START_ROOM_M]
    return int(rng.choice(roomy if len(roomy) else area))


def _liked(cost: csr_array, liking: FloatArray) -> csr_array:
    """Costs scaled by the liking of the edge driven to."""
    return csr_array((cost.data * liking[cost.indices], cost.indices, cost.indptr), shape=cost.shape)


def _edge_headings_rad(network: RoadNetwork, edges: IntArray) -> tuple[FloatArray, FloatArray]:
    """Directions in which each edge's first lane begins and ends."""
    first_lane = np.unique(network.lane_edge, return_index=True)[1]
    begin = network.point_start[first_lane[edges]]
    end = network.point_start[first_lane[edges] + 1]
    steps = network.points_m[begin + 1] - network.points_m[begin], network.points_m[end - 1] - network.points_m[end - 2]
    first, last = (np.arctan2(step[:, 1], step[:, 0]) for step in steps)
    return first, last


def _middles_m(network: RoadNetwork, edges: IntArray) -> FloatArray:
    first_lane = np.unique(network.lane_edge, return_index=True)[1][edges]
    return 0.5 * (network.points_m[network.point_start[first_lane]] + network.points_m[network.point_start[first_lane + 1] - 1])
