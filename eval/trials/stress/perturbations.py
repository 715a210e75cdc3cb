"""What may be wrong with a map or a road network, done to them on purpose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, EdgeKind
from hippodrome.sim.recording import Recording


def with_false_closures(cognitive_map: CognitiveMap, share: float, rng: np.random.Generator) -> CognitiveMap:
    """The map with false loop closures added between random vertices.

    There are ``share`` times as many of them as the map has closures of its own, and they are as confident: motion, sigma and
    margin are those of closures of the map drawn at random.
    """
    edges = cognitive_map.edges
    own = np.flatnonzero(edges.kind == EdgeKind.CLOSURE)
    count = round(share * len(own))
    if count == 0:
        return cognitive_map
    like = rng.choice(own, count)
    ends = np.sort(np.stack([rng.choice(len(cognitive_map.t_s), 2, replace=False) for _ in range(count)]), axis=1)
    changed = {"source": ends[:, 1].astype(np.int32), "target": ends[:, 0].astype(np.int32)}
    names = ("source", "target", "motion", "sigma", "kind", "margin")
    added = {name: np.concatenate([getattr(edges, name), changed.get(name, getattr(edges, name)[like])]) for name in names}
    return replace(cognitive_map, edges=replace(edges, **added))


def without_roads(network: RoadNetwork, edges: Sequence[int]) -> RoadNetwork:
    """The network without these edges, and without the junction lanes that lead to them only."""
    gone = np.isin(network.lane_edge, edges)
    for _ in range(3):  # junction lanes come in chains of up to three pieces
        leads = np.array([any(not gone[s] for s in network.successors(lane)) for lane in range(network.lane_count)])
        gone |= network.is_internal & ~leads
    kept = np.flatnonzero(~gone)
    number = np.full(network.lane_count + 1, -1, dtype=np.int32)
    number[kept] = np.arange(len(kept))
    points = [network.lane_points_m(int(lane)) for lane in kept]
    followers = [[number[s] for s in network.successors(int(lane)) if number[s] >= 0] for lane in kept]
    return replace(
        network,
        lane_ids=tuple(network.lane_ids[lane] for lane in kept),
        lane_edge=network.lane_edge[kept],
        is_internal=network.is_internal[kept],
        width_m=network.width_m[kept],
        speed_limit_mps=network.speed_limit_mps[kept],
        points_m=np.concatenate(points),
        point_start=np.cumsum([0, *(len(part) for part in points)]).astype(np.int32),
        successor=np.array([lane for part in followers for lane in part], dtype=np.int32),
        successor_start=np.cumsum([0, *(len(part) for part in followers)]).astype(np.int32),
        left_lane=number[network.left_lane[kept]],
        right_lane=number[network.right_lane[kept]],
    )


def driven_streets(recording: Recording, network: RoadNetwork, count: int, rng: np.random.Generator) -> list[int]:
    """Edges of ``count`` streets that were driven, drawn at random, with the edges of their opposite directions.

    An edge is the opposite direction of another if it begins near where the other ends, and ends near where it begins.
    """
    driven = np.unique(network.lane_edge[recording.samples.lane[~network.is_internal[recording.samples.lane]]])
    if count == 0:
        return []
    chosen = rng.choice(driven, min(count, len(driven)), replace=False)
    ends = {int(edge): _ends(network, int(edge)) for edge in np.unique(network.lane_edge[~network.is_internal])}
    reach_m = 3.0 * float(network.width_m.max())  # the opposite carriageway begins and ends beside this one
    opposite = [
        edge
        for one in chosen
        for edge, (first, last) in ends.items()
        if max(np.hypot(*(first - ends[int(one)][1])), np.hypot(*(last - ends[int(one)][0]))) < reach_m
    ]
    return [*(int(edge) for edge in chosen), *opposite]


def _ends(network: RoadNetwork, edge: int) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    points = network.lane_points_m(int(np.flatnonzero(network.lane_edge == edge)[0]))
    return points[0], points[-1]
