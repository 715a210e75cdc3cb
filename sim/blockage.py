"""When the ego can neither enter the road nor go on: traffic is taken away around it, and what else holds it is said."""

from __future__ import annotations

import math
from typing import Final

import libsumo

from hippodrome.sim.sumo_run import EGO

CLEARED_M: Final = 60.0  # from here on, a vehicle at 50 km/h sees the ego in time to brake at 2 m/s^2
SIGNAL_AHEAD_M: Final = 15.0  # a car that waits for a signal stands this near to it


def clear_around(x_m: float, y_m: float) -> int:
    """Takes all vehicles but the ego within ``CLEARED_M`` of a point off the road, and returns how many that were."""
    count = 0
    for name in libsumo.vehicle.getIDList():
        x, y = libsumo.vehicle.getPosition(name)
        if name != EGO and math.hypot(x - x_m, y - y_m) <= CLEARED_M:
            libsumo.vehicle.remove(name)
            count += 1
    return count


def ego_is_waiting() -> bool:
    """Whether the ego has been sent on its way and waits for room; SUMO forgets it after a while, like any vehicle."""
    return EGO in libsumo.simulation.getPendingVehicles()


def send_ego_again() -> None:
    """Puts the ego once more on the route that it was sent on before."""
    libsumo.vehicle.add(EGO, f"route-{EGO}", typeID="ego", departLane="best", departPos="base")


def red_signal() -> str:
    """The traffic light that the ego waits at, as first of its lane; empty if none is red there."""
    for signal, _, distance_m, state in libsumo.vehicle.getNextTLS(EGO)[:1]:
        if distance_m < SIGNAL_AHEAD_M and state in "rRyY":
            return str(signal)
    return ""


def what_holds_ego() -> str:
    """Why the ego stands though no vehicle is near it, with the cure."""
    edge, lane = libsumo.vehicle.getRoadID(EGO), libsumo.vehicle.getLaneID(EGO)
    if signal := red_signal():
        return f"the traffic light {signal} at the end of edge {edge} shows it no green; give it a program with green for all"
    route, index = libsumo.vehicle.getRoute(EGO), libsumo.vehicle.getRouteIndex(EGO)
    onward = route[index + 1] if index + 1 < len(route) else ""
    leads_to = {link[0].rpartition("_")[0] for link in libsumo.lane.getLinks(lane)}
    if onward and onward not in leads_to and not lane.startswith(":"):
        return f"lane {lane} does not lead to edge {onward}, where the tour goes on, and no lane beside it does; add a connection"
    return f"nothing stands in its way on edge {edge}; look at the junction behind it in netedit, or set another seed"
