"""What SUMO tells of the ego (a lane and a position on it at each step) as one unbroken chain of lane stretches."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, HippodromeError, IntArray
from hippodrome.sim.path import Piece, piece_starts

SIDE_STEP_COST_M: Final = 30.0  # following the lane is the likelier explanation than changing it
SEARCH_M: Final = 300.0  # far more than a car covers in one step, side steps included


@dataclass(frozen=True, slots=True, eq=False)
class LaneLog:
    """The front bumper at each of S steps."""

    lane: IntArray  # (S,) index into the network's lanes
    position_m: FloatArray  # (S,) arc length on the lane's centreline as drawn
    speed_mps: FloatArray  # (S,)


def lane_pieces(
    network: RoadNetwork, log: LaneLog, from_lane_start: bool = False, lengths_m: FloatArray | None = None
) -> tuple[list[Piece], FloatArray]:
    """The chain of stretches, lanes skipped between two steps included, and the distance (S,) driven along it at each step.

    The chain begins at the first position, or with ``from_lane_start`` at the start of that lane. ``lengths_m`` (L,) are the
    network's ``lane_lengths_m()``, where the caller has them: on a large network they take longer than the rest.
    """
    lengths = network.lane_lengths_m() if lengths_m is None else lengths_m
    groups = _groups(log)
    pieces: list[Piece] = []
    piece_of_group: list[int] = []
    lane, begin = int(log.lane[0]), 0.0 if from_lane_start else float(log.position_m[0])
    side_step, here = False, begin
    for first, end in groups:
        speed = float(log.speed_mps[first])
        for to_side, after in _way(network, lengths, lane, int(log.lane[first])) if first else ():
            leave = here if to_side else float(lengths[lane])
            pieces.append(Piece(lane, begin, max(leave, begin), side_step, speed))
            begin = leave * float(lengths[after] / lengths[lane]) if to_side else 0.0
            lane, side_step, here = after, to_side, begin
        piece_of_group.append(len(pieces))
        here = max(begin, float(log.position_m[end - 1]))
    pieces.append(Piece(lane, begin, here, side_step, float(log.speed_mps[-1])))
    return pieces, _distance(log, groups, pieces, piece_of_group)


def lanes_ahead(network: RoadNetwork, lane: int, edges: Sequence[int], reach_m: float) -> list[int]:
    """Lanes after ``lane`` that follow the route ``edges``, for about ``reach_m`` or as far as no lane change is needed."""
    ahead: list[int] = []
    reached = 0.0
    for k, edge in enumerate(edges):
        if reached >= reach_m:
            break
        ways = ways_to_edge(network, ahead[-1] if ahead else lane, edge)
        if not ways:
            break
        onward = [way for way in ways if k + 1 < len(edges) and ways_to_edge(network, way[-1], edges[k + 1])]
        chosen = (onward or ways)[0]
        ahead.extend(chosen)
        reached += sum(_length_m(network, each) for each in chosen)
    return ahead


def ways_to_edge(network: RoadNetwork, lane: int, edge: int) -> list[list[int]]:
    """Chains of lanes from the end of ``lane`` through the junction to the lanes of ``edge``."""
    return [way for way in ways_out(network, lane) if network.lane_edge[way[-1]] == edge]


def ways_out(network: RoadNetwork, lane: int) -> list[list[int]]:
    """Chains of lanes from the end of ``lane`` through the junction to the first lane beyond it."""
    done: list[list[int]] = []
    open_ways = [[int(after)] for after in network.successors(lane)]
    while open_ways:
        way = open_ways.pop(0)
        if not network.is_internal[way[-1]]:
            done.append(way)
        elif len(way) < 20:  # longer chains of internal lanes would be rings
            open_ways.extend([*way, int(after)] for after in network.successors(way[-1]))
    return done


def _groups(log: LaneLog) -> list[tuple[int, int]]:
    """Runs (first, end) of steps on one lane; a fall in position on it is a new round."""
    new = (np.diff(log.lane) != 0) | (np.diff(log.position_m) < -1.0)
    bounds = [0, *(np.flatnonzero(new) + 1).tolist(), len(log.lane)]
    return list(pairwise(bounds))


def _way(network: RoadNetwork, lengths_m: FloatArray, source: int, target: int) -> list[tuple[bool, int]]:
    """Shortest chain of moves (to the side or on, lane) from one lane to another, at least one move long.

    SUMO changes lanes inside junctions too, where ``network`` has no neighbours; that is tried where there is no other way.

    Raises:
        HippodromeError: Neither leads there.
    """
    if target in _beside_in_junction(network, source):
        return [(True, target)]
    way = _shortest_way(network, lengths_m, source, target, in_junctions=False)
    if way is None:
        way = _shortest_way(network, lengths_m, source, target, in_junctions=True)
    if way is None:
        names = network.lane_ids[source], network.lane_ids[target]
        raise HippodromeError(
            f"ego: SUMO moved it from lane {names[0]} to {names[1]}, which are not connected; check the network there"
        )
    return way


def _shortest_way(
    network: RoadNetwork, lengths_m: FloatArray, source: int, target: int, in_junctions: bool
) -> list[tuple[bool, int]] | None:
    """Dijkstra's search for the moves of ``_way``, with or without changes of lane inside junctions; None: there is no way."""
    queue: list[tuple[float, int, tuple[tuple[bool, int], ...]]] = [(0.0, source, ())]
    settled: set[int] = set()
    while queue:
        cost, lane, way = heapq.heappop(queue)
        if way and lane == target:
            return list(way)
        if lane in settled or cost > SEARCH_M:
            continue
        if way:
            settled.add(lane)
        through = float(lengths_m[lane]) if way else 0.0
        for after in network.successors(lane):
            heapq.heappush(queue, (cost + through, int(after), (*way, (False, int(after)))))
        sides = [int(side) for side in (network.left_lane[lane], network.right_lane[lane]) if side >= 0]
        for beside in [*sides, *(_beside_in_junction(network, lane) if in_junctions else ())]:
            heapq.heappush(queue, (cost + SIDE_STEP_COST_M, beside, (*way, (True, beside))))
    return None


def _beside_in_junction(network: RoadNetwork, lane: int) -> list[int]:
    """The lanes beside a lane inside a junction, on the same edge, by the numbers at the ends of their names."""
    if not network.is_internal[lane]:
        return []
    edge, number = network.lane_edge[lane], _number_on_edge(network, lane)
    near = (other for other in (lane - 1, lane + 1) if 0 <= other < network.lane_count and network.lane_edge[other] == edge)
    return [other for other in near if abs(_number_on_edge(network, other) - number) == 1]


def _number_on_edge(network: RoadNetwork, lane: int) -> int:
    digits = network.lane_ids[lane].rpartition("_")[2]
    return int(digits) if digits.isdecimal() else -1


def _distance(log: LaneLog, groups: list[tuple[int, int]], pieces: list[Piece], piece_of_group: list[int]) -> FloatArray:
    starts = piece_starts(pieces)
    distance = np.empty(len(log.lane))
    for (first, end), k in zip(groups, piece_of_group, strict=True):
        distance[first:end] = starts[k] + np.clip(log.position_m[first:end] - pieces[k].begin_m, 0.0, pieces[k].length_m)
    farthest: FloatArray = np.maximum.accumulate(distance)
    return farthest


def _length_m(network: RoadNetwork, lane: int) -> float:
    return float(np.linalg.norm(np.diff(network.lane_points_m(lane), axis=0), axis=1).sum())


def driven_edges(network: RoadNetwork, pieces: Sequence[Piece]) -> list[int]:
    """Edges outside junctions in the order driven; a lane change does not count as a new visit."""
    entered = (piece for i, piece in enumerate(pieces) if i == 0 or not piece.side_step)
    return [int(network.lane_edge[piece.lane]) for piece in entered if not network.is_internal[piece.lane]]
