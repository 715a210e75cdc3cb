"""Streets that are closed, though network and map have them open: a van stands across each of their lanes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import libsumo
import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import HippodromeError, IntArray

BEHIND_MOUTH_M: Final = 25.0  # from the lane's beginning to the van's front: seen from the junction, clear of it
SHARE: Final = 0.6  # of the lane, where it is shorter
FOREVER_S: Final = 1e6


def closed_edges(network: RoadNetwork, names: Sequence[str]) -> IntArray:
    """Edges by name, as indices. Raises HippodromeError where the network has no such road."""
    roads = {network.edge_ids[edge]: int(edge) for edge in np.unique(network.lane_edge[~network.is_internal])}
    for name in names:
        if name not in roads:
            raise HippodromeError(f"closed: the network has no road {name!r} for cars; roads are named as in SUMO's file")
    return np.array([roads[name] for name in names], dtype=np.int32)


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
