"""Streets that are closed, though network and map have them open: a van stands across each of their lanes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import libsumo
import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import HippodromeError, IntArray
from hippodrome.sim.network import edge_lengths_m, edge_links, graph_parts
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.tour import tour_graph, toured_area

BEHIND_MOUTH_M: Final = 25.0  # from the lane's beginning to the van's front: seen from the junction, clear of it
SHARE: Final = 0.6  # of the lane, where it is shorter
LEAST_M: Final = 40.0  # a road with room for the van and for who turns round before it; shorter ones are closed last
FOREVER_S: Final = 1e6
CLOSED_DRAW: Final = 41  # which of the seed's streams of random numbers draws them


def closed_edges(network: RoadNetwork, names: Sequence[str]) -> IntArray:
    """Edges by name, as indices. Raises HippodromeError where the network has no such road."""
    roads = {network.edge_ids[edge]: int(edge) for edge in np.unique(network.lane_edge[~network.is_internal])}
    for name in names:
        if name not in roads:
            raise HippodromeError(f"closed: the network has no road {name!r} for cars; roads are named as in SUMO's file")
    return np.array([roads[name] for name in names], dtype=np.int32)


def closed_roads(scenario: Scenario, network: RoadNetwork) -> tuple[str, ...]:
    """The names of the roads that a scenario's missions find closed: those that it names, or as many as it says.

    These are drawn by its seed among the roads that the mapping drive passes, so that the map has them open; of these it is
    one that cuts as few others off as can be. Raises HippodromeError where a name is wrong, or the town has not so many roads.
    """
    closed = scenario.localization.closed
    if not isinstance(closed, int):
        closed_edges(network, closed)
        return closed
    graph, tour = tour_graph(network), scenario.mapping.tour
    mapped = graph.edges[toured_area(graph, (1.0 - tour.revisit_share) * tour.planned_length_m())]
    order = np.random.default_rng([scenario.seed, CLOSED_DRAW]).permutation(mapped)
    is_short = edge_lengths_m(network)[order] < LEAST_M
    candidates = order[np.argsort(is_short, kind="stable")].tolist()
    if closed >= len(candidates):
        raise HippodromeError(
            f"{scenario.name}: localization.closed: {closed} roads: the mapping drive passes only {len(candidates)}; close fewer"
        )
    links, chosen = edge_links(network), list[int]()
    for _ in range(closed):
        chosen.append(_least_missed([edge for edge in candidates if edge not in chosen], chosen, graph.edges, links))
    return tuple(network.edge_ids[edge] for edge in chosen)


def _least_missed(candidates: Sequence[int], gone: Sequence[int], edges: IntArray, links: tuple[IntArray, IntArray]) -> int:
    """The first of the candidates without which the most of ``edges`` can still be reached from each other."""
    best, most = candidates[0], -1
    for edge in candidates:
        left = edges[~np.isin(edges, [*gone, edge])]
        inside = np.isin(links[0], left) & np.isin(links[1], left)
        source, target = (np.searchsorted(left, side[inside]).astype(np.int32) for side in links)
        connected = int(np.bincount(graph_parts(len(left), source, target, "strong")).max())
        if connected > most:
            best, most = edge, connected
        if connected == len(left):
            break
    return best


def bar(network: RoadNetwork, edges: IntArray) -> int:
    """Has a van stop for ever on each lane of some edges; how many vans."""
    lanes = np.flatnonzero(np.isin(network.lane_edge, edges) & ~network.is_internal)
    for lane in lanes.tolist():
        name, (edge, _, number) = f"closed-{network.lane_ids[lane]}", network.lane_ids[lane].rpartition("_")
        place = min(BEHIND_MOUTH_M, SHARE * libsumo.lane.getLength(network.lane_ids[lane]))
        libsumo.route.add(name, [edge])
        libsumo.vehicle.add(name, name, typeID="kind1", departLane=number, departPos=f"{place:.2f}", departSpeed="0")
        libsumo.vehicle.setStop(name, edge, place + 0.5, int(number), FOREVER_S)
    return len(lanes)
