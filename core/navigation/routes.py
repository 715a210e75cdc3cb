"""The global plan: the quickest way over the lanes, by Dijkstra's algorithm from the goal backwards.

One search answers for all starts, so that a missed turn costs a look into a table. Time is expected time: what the map does not
know is driven by dead reckoning, on which the fix fades, and therefore counts for more.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush

import numpy as np

from hippodrome.core.navigation.config import PlanConfig
from hippodrome.core.roads.geometry import entry_position_m, project, road_geometry
from hippodrome.core.roads.network import BoolArray, RoadNetwork
from hippodrome.core.roads.paths import CHANGE_S, MIN_CHANGE_M, Piece
from hippodrome.core.se2 import wrap
from hippodrome.core.types import CognitiveMap, FloatArray

U_TURN_RAD = math.radians(150.0)  # a way through a junction that turns more leads back
MOST_PIECES = 5_000  # of a route: a bound for networks whose lanes have no length
SAME_WAY_RAD = math.radians(50.0)  # a vertex belongs to a lane of about its heading
BESIDE_M = 2.5  # and within this of its centre line
SHORTEST_M = 0.05  # a shorter stretch of a lane is left out of the path


@dataclass(frozen=True, slots=True, eq=False)
class RoadTimes:
    """What the search needs to know of the L lanes of a network."""

    network: RoadNetwork
    length_m: FloatArray  # (L,)
    time_s: FloatArray  # (L,) expected, from the lane's beginning to its end
    before: tuple[tuple[int, ...], ...]  # the lanes that lead to each lane


@dataclass(frozen=True, slots=True, eq=False)
class TimesToGoal:
    """Expected time to the goal from the beginning of each of L lanes, and from its end; infinite where no way leads to it."""

    goal_lane: int
    goal_m: float  # arc length of the goal on its lane
    from_begin_s: FloatArray  # (L,)
    from_end_s: FloatArray  # (L,)


def mapped_lanes(network: RoadNetwork, cognitive_map: CognitiveMap, within_m: float) -> BoolArray:
    """Which lanes (L,) have views all along them: no stretch of twice ``within_m`` is without a vertex of the map."""
    geometry, lengths = road_geometry(network), network.lane_lengths_m()
    near = project(geometry, cognitive_map.poses[:, :2], BESIDE_M)
    off_rad = np.abs(wrap(near.heading_rad - cognitive_map.poses[near.point, 2]))
    rows = np.flatnonzero(off_rad < SAME_WAY_RAD)
    mapped = np.zeros(network.lane_count, dtype=np.bool_)
    order = rows[np.lexsort((near.position_m[rows], near.lane[rows]))]
    for lane in np.unique(near.lane[order]):
        seen_m = near.position_m[order[near.lane[order] == lane]]
        gaps_m = np.diff(np.concatenate([[-within_m], seen_m, [lengths[lane] + within_m]]))
        mapped[lane] = bool(np.max(gaps_m) <= 2.0 * within_m)
    return mapped


def road_times(network: RoadNetwork, mapped: BoolArray, config: PlanConfig) -> RoadTimes:
    """Expected times on the lanes; ``mapped`` (L,) says which the map knows."""
    length_m, inside = network.lane_lengths_m(), network.is_internal
    open_mps = config.speed_share * network.speed_limit_mps
    time_s = length_m / np.where(inside, np.minimum(open_mps, config.turn_mps), open_mps)
    time_s = np.where(mapped | inside, time_s, config.unmapped_factor * time_s)
    time_s = time_s + np.where(inside, config.junction_s, 0.0)
    turns_back = inside & (np.abs(_turn_rad(network)) > U_TURN_RAD)
    before: list[list[int]] = [[] for _ in range(network.lane_count)]
    for lane in range(network.lane_count):
        for after in network.successors(lane).tolist():
            before[after].append(lane)
    return RoadTimes(network, length_m, time_s + config.u_turn_s * turns_back, tuple(tuple(lanes) for lanes in before))


def times_to_goal(
    roads: RoadTimes,
    goal_lane: int,
    goal_m: float,
    closed: Collection[int],
    config: PlanConfig,
    opposite: Sequence[int] | None = None,
) -> TimesToGoal:
    """Search back from the goal. ``closed`` are edges (indices into ``edge_ids``) on which nobody gets through.

    With the lane of the opposite direction beside each lane, -1 if there is none, turning round in the street is a way, too.
    """
    network = roads.network
    shut = np.isin(network.lane_edge, np.array(sorted(closed), dtype=np.int32))
    from_begin = np.full(network.lane_count, np.inf)
    share = goal_m / max(float(roads.length_m[goal_lane]), SHORTEST_M)
    from_begin[goal_lane] = roads.time_s[goal_lane] * share
    heap = [(float(from_begin[goal_lane]), goal_lane)]
    if opposite is not None and opposite[goal_lane] >= 0:
        from_begin[opposite[goal_lane]] = config.turn_round_s + float(from_begin[goal_lane])
        heappush(heap, (float(from_begin[opposite[goal_lane]]), opposite[goal_lane]))
    while heap:
        time_s, lane = heappop(heap)
        if time_s > from_begin[lane]:
            continue
        steps = [(other, float(roads.time_s[other])) for other in roads.before[lane] if not shut[other]]
        if roads.length_m[lane] >= config.change_room_m:
            steps += [(other, config.change_s) for other in network.adjacent_lanes(lane) if not shut[other]]
        if opposite is not None:  # from the beginning of a lane onto the end of the opposite one, which leads to this one
            steps += [(opposite[other], config.turn_round_s) for other in roads.before[lane] if opposite[other] >= 0]
        for other, cost_s in steps:
            if other != goal_lane and time_s + cost_s < from_begin[other]:
                from_begin[other] = time_s + cost_s
                heappush(heap, (time_s + cost_s, other))
    from_end = np.array([min((from_begin[i] for i in network.successors(k).tolist()), default=np.inf)
                         for k in range(network.lane_count)])  # fmt: skip
    return TimesToGoal(goal_lane, goal_m, from_begin, from_end)


def place_to_turn(
    roads: RoadTimes, times: TimesToGoal, lane: int, position_m: float, opposite: Sequence[int], config: PlanConfig
) -> tuple[int, float] | None:
    """Where the quickest way of those with a turn in the street has its first one; None where none leads to the goal."""
    for _ in range(MOST_PIECES):
        length_m, go_on_s = float(roads.length_m[lane]), float(times.from_end_s[lane])
        rest_s = float(roads.time_s[lane]) * max(length_m - position_m, 0.0) / max(length_m, SHORTEST_M)
        if (other := opposite[lane]) >= 0:
            there_m = max(float(roads.length_m[other]) - position_m, 0.0)
            turned_s = config.turn_round_s + time_left_s(roads, times, other, there_m)
            if math.isfinite(turned_s) and turned_s <= rest_s + go_on_s:
                return lane, position_m
        after = roads.network.successors(lane)
        if not math.isfinite(go_on_s) or not len(after):
            return None
        lane, position_m = int(after[np.argmin(times.from_begin_s[after])]), 0.0
    return None


def time_left_s(roads: RoadTimes, times: TimesToGoal, lane: int, position_m: float) -> float:
    """Expected time to the goal from a place on a lane, without a change of lane first."""
    length_m = max(float(roads.length_m[lane]), SHORTEST_M)
    if lane == times.goal_lane and position_m <= times.goal_m:
        return float(roads.time_s[lane]) * (times.goal_m - position_m) / length_m
    return float(roads.time_s[lane]) * max(length_m - position_m, 0.0) / length_m + float(times.from_end_s[lane])


def route(
    roads: RoadTimes, times: TimesToGoal, lane: int, position_m: float, speed_mps: float, config: PlanConfig
) -> list[Piece] | None:
    """The stretches of lanes from a place to the goal and a little beyond it; None where no way leads to it.

    The first stretch begins a little behind the place. Lane changes are made as early as they can be.
    """
    begin_m, here_m = max(0.0, position_m - config.backward_m), position_m
    pieces: list[Piece] = []
    side_step, network = False, roads.network
    while len(pieces) < MOST_PIECES:
        beside = _better_lane(roads, times, lane, here_m, config)
        if beside is not None:
            half_m = 0.5 * max(MIN_CHANGE_M, CHANGE_S * min(speed_mps, float(network.speed_limit_mps[lane]))) + 1.0
            leave_m = min(here_m + half_m, float(roads.length_m[lane]) - 1.0)
            pieces.append(Piece(lane, begin_m, leave_m, side_step, speed_mps))
            entered_m = float(entry_position_m(leave_m, float(roads.length_m[lane]), float(roads.length_m[beside])))
            lane, begin_m, here_m, side_step = beside, entered_m, entered_m + half_m, True
            continue
        if not math.isfinite(time_left_s(roads, times, lane, here_m)):
            return None
        if lane == times.goal_lane and here_m <= times.goal_m:
            return pieces + _to_goal_and_beyond(roads, times, lane, begin_m, side_step, speed_mps, config)
        if float(roads.length_m[lane]) - begin_m > SHORTEST_M:
            pieces.append(Piece(lane, begin_m, float(roads.length_m[lane]), side_step, speed_mps))
            side_step = False
        after = network.successors(lane)
        lane = int(after[np.argmin(times.from_begin_s[after])])
        begin_m = here_m = 0.0
    return None


def _better_lane(roads: RoadTimes, times: TimesToGoal, lane: int, here_m: float, config: PlanConfig) -> int | None:
    """The adjacent lane to change to now, or None: own lane is best, or there is no room."""
    network, length_m = roads.network, float(roads.length_m[lane])
    best_s, best = time_left_s(roads, times, lane, here_m), None
    for sides in (network.left_lane, network.right_lane):
        first, other, changes = int(sides[lane]), int(sides[lane]), 1
        while other >= 0:
            there_m = float(entry_position_m(here_m, length_m, float(roads.length_m[other])))
            end_m = times.goal_m if other == times.goal_lane and there_m <= times.goal_m else float(roads.length_m[other])
            cost_s = changes * config.change_s + time_left_s(roads, times, other, there_m)
            if end_m - there_m >= changes * config.change_room_m and cost_s < best_s:
                best_s, best = cost_s, first
            other, changes = int(sides[other]), changes + 1
    return best


def _to_goal_and_beyond(
    roads: RoadTimes, times: TimesToGoal, lane: int, begin_m: float, side_step: bool, speed_mps: float, config: PlanConfig
) -> list[Piece]:
    """The last stretch, drawn on beyond the goal so that the path is smooth there."""
    wanted_m = times.goal_m + config.beyond_goal_m
    pieces = [Piece(lane, begin_m, min(float(roads.length_m[lane]), wanted_m), side_step, speed_mps)]
    wanted_m -= float(roads.length_m[lane])
    while wanted_m > SHORTEST_M and len(after := roads.network.successors(lane)) > 0:
        lane = int(after[0])
        pieces.append(Piece(lane, 0.0, min(float(roads.length_m[lane]), wanted_m), False, speed_mps))
        wanted_m -= float(roads.length_m[lane])
    return [piece for piece in pieces if piece.length_m > SHORTEST_M]


def _turn_rad(network: RoadNetwork) -> FloatArray:
    """By how much each lane (L,) turns from its first segment to its last one, left positive."""
    first, last = network.point_start[:-1], network.point_start[1:] - 1
    begin, end = network.points_m[first + 1] - network.points_m[first], network.points_m[last] - network.points_m[last - 1]
    turn: FloatArray = wrap(np.arctan2(end[:, 1], end[:, 0]) - np.arctan2(begin[:, 1], begin[:, 0]))
    return turn
