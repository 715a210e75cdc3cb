"""Two well-known map matchers on our road network: conversion of the network, and the lane that each gives every point.

Neither knows what a lane is, so every lane, those inside junctions too, is a directed road of its own to them.
"""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, IntArray

SEARCH_SIGMAS = 5.0  # either looks for roads up to so many standard deviations of the trace's noise from a point


def leuven(network: RoadNetwork, trace_m: FloatArray, sigma_m: float) -> IntArray:
    """Lanes by leuvenmapmatching's ``DistanceMatcher``.

    Args:
        network: The road network.
        trace_m: Points (N, 2) to match.
        sigma_m: Standard deviation of their noise.

    Returns:
        Lane (N,) of each point, -1 where the matcher gives none.
    """
    from leuvenmapmatching.matcher.distance import DistanceMatcher

    matcher = DistanceMatcher(
        leuven_map(network),
        obs_noise=sigma_m,
        max_dist_init=SEARCH_SIGMAS * sigma_m,
        max_dist=SEARCH_SIGMAS * sigma_m,
        non_emitting_states=True,
        max_lattice_width=20,
    )
    matcher.match([(float(y), float(x)) for x, y in trace_m])
    owner = np.repeat(np.arange(network.lane_count), np.diff(network.point_start))
    lanes = np.full(len(trace_m), -1, dtype=np.int32)
    for matching in matcher.lattice_best or []:
        if matching.obs_ne == 0:
            lanes[matching.obs] = owner[matching.edge_m.l2]
    return lanes


def leuven_map(network: RoadNetwork) -> Any:
    """The road network as leuvenmapmatching's graph.

    Nodes are the points of the centrelines. Edges lead from each point to the next one of its lane, from the last point of a lane
    to the first of each successor, and, for lane changes, from each point to the next one of each lane beside.
    """
    from leuvenmapmatching.map.inmem import InMemMap

    graph: dict[int, tuple[tuple[float, float], list[int]]] = {
        i: ((float(y), float(x)), [i + 1]) for i, (x, y) in enumerate(network.points_m)
    }
    for lane in range(network.lane_count):
        first, last = int(network.point_start[lane]), int(network.point_start[lane + 1]) - 1
        onward = graph[last][1]
        onward[:] = [int(network.point_start[other]) for other in network.successors(lane)]
        for beside in (int(network.left_lane[lane]), int(network.right_lane[lane])):
            if beside >= 0:
                start, count = int(network.point_start[beside]), int(np.diff(network.point_start)[beside])
                for i in range(first, last):
                    graph[i][1].append(start + min(int((i - first + 1) / (last - first) * (count - 1)) + 1, count - 1))
    return InMemMap("town", use_latlon=False, use_rtree=True, index_edges=True, graph=graph)


def mappymatch(network: RoadNetwork, trace_m: FloatArray, sigma_m: float) -> IntArray:
    """Lanes by mappymatch's ``LCSSMatcher``. Arguments and result are those of ``leuven``."""
    from geopandas import GeoDataFrame, points_from_xy
    from mappymatch.constructs.trace import Trace
    from mappymatch.maps.nx.nx_map import NxMap
    from mappymatch.matchers.lcss.lcss import LCSSMatcher
    from mappymatch.utils.crs import XY_CRS

    matcher = LCSSMatcher(NxMap(mappymatch_graph(network)), distance_epsilon=SEARCH_SIGMAS * sigma_m)
    matched = matcher.match_trace(Trace(GeoDataFrame(geometry=points_from_xy(*trace_m.T), crs=XY_CRS)))
    lanes = [-1 if match.road is None else int(match.road.road_id.key) for match in matched.matches]
    return np.array(lanes, dtype=np.int32)


def mappymatch_graph(network: RoadNetwork) -> Any:
    """The road network as mappymatch's graph: an edge per lane with its centreline, a node per place where lanes meet.

    It has no lane changes.
    """
    import networkx as nx
    from mappymatch.utils.crs import XY_CRS
    from shapely.geometry import LineString

    node = _places(network)
    lengths = network.lane_lengths_m()
    graph = nx.MultiDiGraph(
        crs=XY_CRS, distance_weight="kilometers", time_weight="minutes", geometry_key="geometry", network_type="drive"
    )
    for lane in range(network.lane_count):
        km = float(lengths[lane]) / 1e3
        minutes = float(lengths[lane] / network.speed_limit_mps[lane]) / 60.0
        line = LineString(network.lane_points_m(lane))
        graph.add_edge(int(node[lane, 0]), int(node[lane, 1]), key=lane, geometry=line, kilometers=km, minutes=minutes)
    return graph


def _places(network: RoadNetwork) -> IntArray:
    """Numbers (L, 2) of the places at which each lane begins and ends: a lane ends at the place where its successors begin."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = network.lane_count
    ends = count + np.repeat(np.arange(count), np.diff(network.successor_start))
    joined = coo_array((np.ones(len(ends)), (ends, network.successor)), shape=(2 * count, 2 * count))
    _, place = connected_components(joined, directed=False)
    places: IntArray = place.reshape(2, count).T
    return places


def quiet() -> None:
    """Let both matchers log errors only."""
    logging.getLogger("be.kuleuven.cs.dtai.mapmatching").setLevel(logging.ERROR)
    logging.getLogger("mappymatch").setLevel(logging.ERROR)
