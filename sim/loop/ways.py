"""Where lanes lead: the ways through the junction ahead, and which of them an indicator means."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from hippodrome.core.navigation.types import Indicator
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.se2 import wrap_compiled
from hippodrome.sim.lane_log import ways_out

MEANT_RAD: Final = {Indicator.LEFT: 0.5 * np.pi, Indicator.STRAIGHT: 0.0, Indicator.RIGHT: -0.5 * np.pi}
ROUTE_EDGES: Final = 4  # told to SUMO beyond the next junction: it looks some 100 m ahead


@dataclass(frozen=True, slots=True)
class Way:
    """A way from the end of a lane through the junction.

    Args:
        inside: the lanes in the junction, one after the other; empty where the network has none.
        target: the first lane beyond.
        turn_rad: by how much the direction changes, left positive.
    """

    inside: tuple[int, ...]
    target: int
    turn_rad: float


class Ways:
    """The ways out of each lane, found when they are first asked for."""

    def __init__(self, network: RoadNetwork) -> None:
        self.network = network
        self._ways: dict[int, tuple[Way, ...]] = {}

    def out_of(self, lane: int) -> tuple[Way, ...]:
        """All ways from the end of a lane; none at the end of the network."""
        if lane not in self._ways:
            chains = ways_out(self.network, lane)
            self._ways[lane] = tuple(Way(tuple(chain[:-1]), chain[-1], self._turn_rad(lane, chain[-1])) for chain in chains)
        return self._ways[lane]

    def meant(self, lane: int, indicator: Indicator) -> Way | None:
        """The way whose turn is nearest to what the indicator means, a right angle or none; None where no way leads on."""
        ways = self.out_of(lane)
        return min(ways, key=lambda way: abs(wrap_compiled(way.turn_rad - MEANT_RAD[indicator])), default=None)

    def edges_from(self, lane: int) -> list[int]:
        """Edges of the network from a lane's own on, as straight on as they go: a route that SUMO can believe in."""
        edges = [int(self.network.lane_edge[lane])]
        for _ in range(ROUTE_EDGES):
            way = self.meant(lane, Indicator.STRAIGHT)
            if way is None:
                break
            lane = way.target
            edges.append(int(self.network.lane_edge[lane]))
        return edges

    def _turn_rad(self, lane: int, target: int) -> float:
        before, after = self.network.lane_points_m(lane), self.network.lane_points_m(target)
        end, begin = before[-1] - before[-2], after[1] - after[0]
        return float(wrap_compiled(np.arctan2(begin[1], begin[0]) - np.arctan2(end[1], end[0])))
