"""What is odd about a SUMO network but can be lived with, in notes of one line each."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Final

import numpy as np
from scipy.spatial import KDTree

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import HippodromeError, IntArray
from hippodrome.sim.net_file import SumoNet
from hippodrome.sim.network import (
    HELD_PHASE_S,
    MIN_LANE_M,
    drivable_edges,
    edge_lengths_m,
    edge_links,
    graph_parts,
    junction_gaps,
)

LEAP: Final = 10.0  # a lane drawn so many times as long as it is counted cannot be driven as drawn
LONG_M: Final = 20.0  # shorter lanes may be counted as anything: netconvert has its least length
COINCIDENT_M: Final = 1.0  # nodes closer than this are one crossing to a driver


def check_network(net: SumoNet, network: RoadNetwork, net_file: Path) -> tuple[str, ...]:
    """What is odd about a network but can be lived with, one line each. A network without any loop to drive is an error."""
    drivable = drivable_edges(network)
    if len(drivable) == 0:
        raise HippodromeError(f"{net_file}: no closed loop for passenger cars, so no tour can return; add a way round or U-turns")
    if (fault := _counted_shorter(net, network)) is not None:
        raise HippodromeError(f"{net_file}: {fault}; leave its length out, or write the network again with netconvert")
    gaps = junction_gaps(network, net_file)
    notes = (_disconnected(network, drivable), _zero_length(network), _coincident(net), _held_signals(net), _shared_lanes(net))
    return (*gaps, *(note for kind in notes for note in kind))


def _counted_shorter(net: SumoNet, network: RoadNetwork) -> str | None:
    """A lane on which vehicles would leap, as its attribute ``length`` is a small part of what is drawn; None: there is none."""
    drawn_m = network.lane_lengths_m()
    for lane in np.flatnonzero((drawn_m > LONG_M) & ~network.is_internal).tolist():
        counted_m = float(net.getLane(network.lane_ids[lane]).getLength())
        if drawn_m[lane] > LEAP * counted_m:
            return f"lane {network.lane_ids[lane]!r} is drawn {drawn_m[lane]:.0f} m long and said to be {counted_m:g} m"
    return None


def _disconnected(network: RoadNetwork, drivable: IntArray) -> Iterable[str]:
    length = edge_lengths_m(network)
    roads = np.flatnonzero(length > 0.0)
    rest = np.setdiff1d(roads, drivable)
    if len(rest) == 0:
        return
    share = length[rest].sum() / length.sum()
    source, target = edge_links(network)
    parts = len(np.unique(graph_parts(len(network.edge_ids), source, target, "weak")[roads]))
    example = network.edge_ids[rest[np.argmax(length[rest])]]
    yield (
        f"{len(rest)} of {len(roads)} edges ({share:.0%} of the length, for instance {example}) cannot be left or reached again "
        f"and are not toured; {parts} disconnected part(s)"
    )


def _zero_length(network: RoadNetwork) -> Iterable[str]:
    points = np.flatnonzero(network.lane_lengths_m() <= 1.5 * MIN_LANE_M)
    if len(points):
        yield f"{len(points)} zero-length lane(s), for instance {network.lane_ids[points[0]]}, stretched to {MIN_LANE_M} m"


def _coincident(net: SumoNet) -> Iterable[str]:
    nodes = [node for node in net.getNodes() if node.getIncoming() or node.getOutgoing()]
    pairs = KDTree(np.array([node.getCoord()[:2] for node in nodes])).query_pairs(COINCIDENT_M)
    for a, b in sorted(pairs):
        one, other = nodes[a], nodes[b]
        joined = {edge.getToNode() for edge in one.getOutgoing()} | {edge.getFromNode() for edge in one.getIncoming()}
        if other not in joined:
            x_m, y_m = one.getCoord()[:2]
            yield f"nodes {one.getID()} and {other.getID()} coincide at ({x_m:.1f}, {y_m:.1f}) m but are not connected"


def _held_signals(net: SumoNet) -> Iterable[str]:
    programs = ((signal, program) for signal in net.getTrafficLights() for program in signal.getPrograms().values())
    held = {signal.getID() for signal, program in programs if any(p.duration > HELD_PHASE_S for p in program.getPhases())}
    if held:
        yield f"{len(held)} traffic light(s), for instance {min(held)}, wait for a hand to switch them and are given a cycle"


def _shared_lanes(net: SumoNet) -> Iterable[str]:
    """Streets whose two directions are one lane; SUMO's vehicles that meet there block one another for good."""
    pairs = {tuple(sorted((edge.getID(), edge.getBidi().getID()))) for edge in net.getEdges(withInternal=False) if edge.getBidi()}
    if pairs:
        one, other = min(pairs)
        yield (
            f"{len(pairs)} street(s) have one lane for both directions, for instance {one} and {other} share one lane: "
            f"of all vehicles only the ego drives there, because those that met could not go on"
        )
