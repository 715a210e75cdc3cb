"""SUMO road networks: read into ``core``'s plain arrays, and checked before anything drives on them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Final

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, HippodromeError, IntArray
from hippodrome.sim.georeference import REAL_MAP_SIGMA_M, is_georeferenced
from hippodrome.sim.net_file import SumoLane, SumoNet, is_left_hand, load_net

MIN_LANE_M: Final = 0.01  # SUMO writes coordinates in centimetres; a shorter lane is a point
MAX_CHAIN: Final = 6  # internal lanes in a row; netconvert makes up to three
HELD_PHASE_S: Final = 150.0  # no driver waits that long: such a traffic light is meant to be switched by hand


def read_network(net_file: Path | str) -> RoadNetwork:
    """The lanes of a SUMO network that passenger cars may use.

    Args:
        net_file: ``.net.xml`` or ``.net.xml.gz``, as SUMO, netconvert and netgenerate write it.

    Returns:
        Lane centrelines in metres, x east and y north of the network's own origin, and how they connect.

    Raises:
        HippodromeError: the file is unreadable, no SUMO network, or has no lane for cars; the message says which and the cure.
    """
    net_file = Path(net_file)
    return road_network(load_net(net_file), net_file)


def road_network(net: SumoNet, net_file: Path) -> RoadNetwork:
    """The passenger cars' part of a ``sumolib`` network; ``net_file`` is named in errors."""
    lanes = _car_lanes(net)
    if not any(not _is_internal(lane) for lane in lanes):
        raise HippodromeError(f"{net_file}: no lane is open to passenger cars; choose a network with roads for cars")
    index = {lane.getID(): i for i, lane in enumerate(lanes)}
    successors = [_successors(lane, index) for lane in lanes]
    shapes = _shapes(lanes, successors, net_file)
    edge_ids = tuple(dict.fromkeys(lane.getEdge().getID() for lane in lanes))
    edge_index = {edge: i for i, edge in enumerate(edge_ids)}
    right_is_lower = not is_left_hand(net_file)
    lower, upper = _side_lanes(lanes, index, -1), _side_lanes(lanes, index, 1)
    return RoadNetwork(
        lane_ids=tuple(index),
        edge_ids=edge_ids,
        lane_edge=np.array([edge_index[lane.getEdge().getID()] for lane in lanes], dtype=np.int32),
        is_internal=np.array([_is_internal(lane) for lane in lanes], dtype=np.bool_),
        width_m=np.array([lane.getWidth() for lane in lanes], dtype=np.float64),
        speed_limit_mps=np.array([lane.getSpeed() for lane in lanes], dtype=np.float64),
        points_m=np.concatenate(shapes),
        point_start=_starts(shapes),
        successor=np.array([s for after in successors for s in after], dtype=np.int32),
        successor_start=_starts(successors),
        left_lane=upper if right_is_lower else lower,
        right_lane=lower if right_is_lower else upper,
        survey_sigma_m=REAL_MAP_SIGMA_M if is_georeferenced(net_file) else 0.0,
    )


def drivable_edges(network: RoadNetwork) -> IntArray:
    """Edges, as sorted indices, of the longest strongly connected part: whoever starts there can always go on and come back."""
    source, target = edge_links(network)
    part = graph_parts(len(network.edge_ids), source, target, "strong")
    length = edge_lengths_m(network)
    weight = np.bincount(part, weights=length)
    loops = np.bincount(part[source[part[source] == part[target]]], minlength=len(weight)) > 0
    if not loops.any():
        return np.empty(0, dtype=np.int32)
    inside = (part == np.argmax(np.where(loops, weight, -1.0))) & (length > 0.0)
    return np.flatnonzero(inside).astype(np.int32)


def edge_links(network: RoadNetwork) -> tuple[IntArray, IntArray]:
    """Pairs (source, target) of non-internal edges that a car can drive one after the other, sorted, without repeats."""
    owner = np.repeat(np.arange(network.lane_count), np.diff(network.successor_start))
    hop = coo_array((np.ones(len(owner), dtype=bool), (owner, network.successor)), shape=(network.lane_count,) * 2).tocsr()
    inside = network.is_internal.astype(np.float64)
    frontier = hop[np.flatnonzero(~network.is_internal)]
    rows = np.flatnonzero(~network.is_internal)
    pairs: set[tuple[int, int]] = set()
    while frontier.nnz:
        r, c = frontier.nonzero()
        arrived = ~network.is_internal[c]
        pairs.update(zip(network.lane_edge[rows[r[arrived]]].tolist(), network.lane_edge[c[arrived]].tolist(), strict=True))
        frontier = (frontier * inside[None, :]).astype(bool) @ hop
    table = np.array(sorted(pairs), dtype=np.int32).reshape(-1, 2)
    return table[:, 0], table[:, 1]


def edge_lengths_m(network: RoadNetwork) -> FloatArray:
    """Length (E,) of each edge's longest lane; 0 for edges inside junctions, which count with no road."""
    length = np.zeros(len(network.edge_ids))
    road = ~network.is_internal
    np.maximum.at(length, network.lane_edge[road], network.lane_lengths_m()[road])
    return length


def junction_lengths_m(network: RoadNetwork) -> FloatArray:
    """Mean length (E,) of the ways through the junction behind each edge."""
    owner = np.repeat(np.arange(network.lane_count), np.diff(network.successor_start))
    choices = np.maximum(np.bincount(owner, minlength=network.lane_count), 1)
    through = np.zeros(network.lane_count)
    for _ in range(MAX_CHAIN):
        inside = np.where(network.is_internal, network.lane_lengths_m() + through, 0.0)
        through = np.bincount(owner, weights=inside[network.successor], minlength=network.lane_count) / choices
    lanes = np.bincount(network.lane_edge, minlength=len(network.edge_ids))
    mean: FloatArray = np.bincount(network.lane_edge, weights=through, minlength=len(lanes)) / np.maximum(lanes, 1)
    return mean


def junction_gaps(network: RoadNetwork, net_file: Path) -> tuple[str, ...]:
    """A note if the network has roads that follow one another but no lanes inside of its junctions, else nothing."""
    if network.is_internal.any() or len(network.successor) == 0:
        return ()
    name = net_file.name
    return (
        f"{name} has no lanes inside junctions, so drives jump over them and maps are refused; write it again with "
        f"netconvert --no-internal-links=false -s {name} -o NEW.net.xml",
    )


def graph_parts(count: int, source: IntArray, target: IntArray, connection: str) -> IntArray:
    graph = coo_array((np.ones(len(source)), (source, target)), shape=(count, count))
    _, part = connected_components(graph, connection=connection)
    labels: IntArray = part
    return labels


def _car_lanes(net: SumoNet) -> list[SumoLane]:
    edges = [edge for edge in net.getEdges() if edge.getFunction() in ("", "connector", "internal")]
    return [lane for edge in edges for lane in edge.getLanes() if lane.allows("passenger")]


def _is_internal(lane: SumoLane) -> bool:
    return bool(lane.getEdge().getFunction() == "internal")


def _successors(lane: SumoLane, index: dict[str, int]) -> list[int]:
    """Next lane of each connection: its first internal lane, whose own connection tells the next piece of the chain.

    From a lane for both directions nobody turns round onto the same lane, though netconvert writes such connections: SUMO's
    vehicle would wait for itself.
    """
    same = lane.getEdge().getBidi()
    links = (link for link in lane.getOutgoing() if link.allows("passenger") and (same is None or link.getTo() is not same))
    after = (link.getViaLaneID() or link.getToLane().getID() for link in links)
    return sorted({index[lane_id] for lane_id in after if lane_id in index})


def _side_lanes(lanes: list[SumoLane], index: dict[str, int], step: int) -> IntArray:
    """Lane ``step`` places further on the same edge, -1 where none; lanes inside junctions have no neighbours to change to."""
    side = np.full(len(lanes), -1, dtype=np.int32)
    for i, lane in enumerate(lanes):
        if not _is_internal(lane):
            side[i] = index.get(f"{lane.getEdge().getID()}_{lane.getIndex() + step}", -1)
    return side


def _shapes(lanes: list[SumoLane], successors: list[list[int]], net_file: Path) -> list[FloatArray]:
    points = [_without_repeats(lane.getShape()) for lane in lanes]
    for lane, shape in zip(lanes, points, strict=True):
        if not shape or not all(math.isfinite(x) and math.isfinite(y) for x, y in shape):
            raise HippodromeError(f"{net_file}: lane {lane.getID()} has no valid shape; write the network again with netconvert")
    shapes = [np.array(shape, dtype=np.float64) for shape in points]
    before = {s: i for i, after in enumerate(successors) for s in after}
    return [
        shape if len(shape) > 1 else _stretched(shape, _heading_near(shapes, successors[i], before.get(i)))
        for i, shape in enumerate(shapes)
    ]


def _without_repeats(points_m: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """The polyline without points closer than ``MIN_LANE_M`` to their predecessor, which have no heading."""
    kept: list[tuple[float, float]] = []
    for x, y in points_m:
        if not kept or math.hypot(x - kept[-1][0], y - kept[-1][1]) >= MIN_LANE_M:
            kept.append((x, y))
    return kept


def _heading_near(shapes: list[FloatArray], after: list[int], before: int | None) -> float:
    """Driving direction at a lane that is a point: that of the lane before, else of the lane after, else east."""
    if before is not None and len(shapes[before]) > 1:
        step = shapes[before][-1] - shapes[before][-2]
    else:
        step = next((shapes[s][1] - shapes[s][0] for s in after if len(shapes[s]) > 1), np.array([1.0, 0.0]))
    return math.atan2(step[1], step[0])


def _stretched(point_m: FloatArray, heading_rad: float) -> FloatArray:
    return np.concatenate([point_m, point_m + MIN_LANE_M * np.array([math.cos(heading_rad), math.sin(heading_rad)])])


def _starts(groups: Iterable[FloatArray | list[int]]) -> IntArray:
    return np.concatenate([[0], np.cumsum([len(group) for group in groups])]).astype(np.int32)
