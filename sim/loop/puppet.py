"""The ego as SUMO knows it: moved by us, with a route and an indicator that others can see, and never lost."""

from __future__ import annotations

import math
from typing import Final

import libsumo

from hippodrome.core.navigation.types import Indicator
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.sim.loop.ways import Way, Ways
from hippodrome.sim.sumo_run import EGO

KEEP_ROUTE: Final = 2  # SUMO's word for: wherever it is, also off its route and off the road
SIGNALS: Final = {Indicator.RIGHT: 1, Indicator.STRAIGHT: 0, Indicator.LEFT: 2}  # SUMO's bits of the blinkers
BACKS: Final = 128  # SUMO's bit of the reversing lamps


class Puppet:
    """Moves SUMO's ego to where the bicycle is, before each of SUMO's steps."""

    def __init__(self, network: RoadNetwork, ways: Ways) -> None:
        self._network, self._ways = network, ways
        self._route: tuple[str, ...] = ()  # what SUMO was told; empty where it did not take it
        self._last_route: tuple[str, ...] = ()
        self._routes = 0
        self.put_back = 0  # how often SUMO had taken the ego off the road
        self.misplaced = 0  # steps after which SUMO had the ego on another lane than told: others may not have seen it

    def place(
        self,
        front_m: tuple[float, float, float],
        speed_mps: float,
        lane: int,
        before: int,
        indicator: Indicator,
        reverse: bool = False,
    ) -> Way | None:
        """Puts the ego where it is.

        Args:
            front_m: of the front bumper.
            speed_mps: what others believe; one that backs stands for them, as SUMO's vehicles never do.
            lane: that the front bumper is on, -1 off the road.
            before: the last lane outside of junctions that it was on.
            indicator: what it means to do ahead.
            reverse: whether the reversing lamps are lit.

        Returns:
            The way through the junction ahead that lane and indicator mean; None off the road, and where none leads on.
        """
        way, route = self._plan(lane, before, indicator)
        if EGO not in libsumo.vehicle.getIDList():
            self._insert(route)
        elif route and route != self._route:
            self._reroute(route)
        x, y, heading = front_m
        edge, _, number = self._network.lane_ids[lane].rpartition("_") if lane >= 0 else ("", "", "-1")
        angle = 90.0 - math.degrees(heading)
        libsumo.vehicle.moveToXY(EGO, edge, int(number), x, y, angle, KEEP_ROUTE)
        libsumo.vehicle.setSpeed(EGO, max(speed_mps, 0.0))
        libsumo.vehicle.setSignals(EGO, SIGNALS[indicator] + (BACKS if reverse else 0))
        return way

    def check(self, lane: int) -> None:
        """After SUMO's step: is the ego on the lane that it was put on."""
        self.misplaced += lane >= 0 and libsumo.vehicle.getLaneID(EGO) != self._network.lane_ids[lane]

    def _plan(self, lane: int, before: int, indicator: Indicator) -> tuple[Way | None, tuple[str, ...]]:
        """The way ahead, and the edges that SUMO is told."""
        network = self._network
        if lane < 0:
            return None, ()
        if network.is_internal[lane]:
            onward = self._ways.out_of(lane)
            if before < 0 or not onward:
                return None, ()
            edges = [int(network.lane_edge[before]), *self._ways.edges_from(onward[0].target)]
            return None, tuple(network.edge_ids[edge] for edge in edges)
        way = self._ways.meant(lane, indicator)
        edges = [int(network.lane_edge[lane]), *(self._ways.edges_from(way.target) if way else ())]
        return way, tuple(network.edge_ids[edge] for edge in edges)

    def _insert(self, route: tuple[str, ...]) -> None:
        """Sends the ego on its way; it is on the road as soon as it has been moved there."""
        self._routes += 1
        self._route = self._last_route = route or self._last_route
        libsumo.route.add(f"ego-{self._routes}", list(self._route))
        if EGO in libsumo.simulation.getPendingVehicles():
            libsumo.vehicle.remove(EGO)
        libsumo.vehicle.add(EGO, f"ego-{self._routes}", typeID="ego", departLane="best", departPos="base")
        self.put_back += self._routes > 1

    def _reroute(self, route: tuple[str, ...]) -> None:
        """Tells SUMO where the ego goes. Where the ego is not on that route in SUMO's eyes, it is told at a later step."""
        try:
            libsumo.vehicle.setRoute(EGO, list(route))
            self._route = self._last_route = route
        except libsumo.TraCIException:
            self._route = ()
