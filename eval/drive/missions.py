"""Missions: where the vehicle wakes up, which it is not told, and where it is to go. Both are drawn by seed."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from hippodrome.core.navigation.config import PlanConfig
from hippodrome.core.navigation.routes import RoadTimes, time_left_s, times_to_goal
from hippodrome.core.roads.geometry import poses_on_segments, road_geometry
from hippodrome.core.roads.network import BoolArray, RoadNetwork
from hippodrome.core.types import HippodromeError
from hippodrome.sim.network import drivable_edges

SHORTEST_MISSION_M: Final = 150.0  # a shorter way is over before anything was found
SHARE_OF_TOWN: Final = 0.5  # of the longest way in town: in a small one the shortest mission is shorter
ROOM_M: Final = 12.0  # between a start or a goal and either end of its lane, so that the vehicle fits in
TRIES: Final = 200  # draws of a goal for one start


@dataclass(frozen=True, slots=True)
class Mission:
    """One mission.

    Args:
        number: from 0 on, within a scenario and seed.
        seed: of traffic, noise and start.
        start_lane, start_m: the rear axle's place at the start.
        goal_lane, goal_m: and the one to stop at.
        mapped: whether the map knows the goal's lane.
        shortest_m: the way from the start to the goal, where the streets are that the scenario leaves open.
    """

    number: int
    seed: int
    start_lane: str
    start_m: float
    goal_lane: str
    goal_m: float
    mapped: bool
    shortest_m: float

    def as_json(self) -> dict[str, Any]:
        """The mission as plain data."""
        return asdict(self)


def draw_missions(network: RoadNetwork, mapped: BoolArray, seed: int, count: int, closed: frozenset[int]) -> list[Mission]:
    """Draw ``count`` missions; the first of them are the same for every count.

    Args:
        network: the roads as they are.
        mapped: (L,) which lanes the map knows.
        seed: of the draw.
        count: how many.
        closed: edges that nobody gets through, on which no mission begins or ends.

    Raises:
        HippodromeError: the network has no two places that are far enough apart.
    """
    return [_mission(network, mapped, seed, number, closed) for number in range(count)]


def shortest_m(roads: RoadTimes, start: tuple[int, float], goal: tuple[int, float], closed: frozenset[int]) -> float:
    """The shortest way between two places on lanes; infinite without one. ``roads`` must count lengths, see ``by_length``."""
    times = times_to_goal(roads, goal[0], goal[1], closed, PlanConfig(change_s=1.0))
    return time_left_s(roads, times, *start)


def by_length(network: RoadNetwork) -> RoadTimes:
    """The network with lengths in place of times, for shortest ways."""
    lengths = network.lane_lengths_m()
    before: list[list[int]] = [[] for _ in range(network.lane_count)]
    for lane in range(network.lane_count):
        for after in network.successors(lane).tolist():
            before[after].append(lane)
    return RoadTimes(network, lengths, lengths.copy(), tuple(tuple(lanes) for lanes in before))


def _mission(network: RoadNetwork, mapped: BoolArray, seed: int, number: int, closed: frozenset[int]) -> Mission:
    rng = np.random.default_rng([seed, number, 77])
    roads, lengths = by_length(network), network.lane_lengths_m()
    inside = np.isin(network.lane_edge, drivable_edges(network)) & ~network.is_internal
    inside &= ~np.isin(network.lane_edge, np.array(sorted(closed), dtype=np.int32))
    lanes = np.flatnonzero(inside & (lengths > 2.0 * ROOM_M))
    if len(lanes) < 2:
        raise HippodromeError(
            "missions: the network has no two lanes that are long enough to start and to stop on; choose a larger one"
        )
    spare = lengths[lanes] - 2.0 * ROOM_M
    best: Mission | None = None
    for _ in range(TRIES):
        start, goal = (int(lane) for lane in rng.choice(lanes, 2, p=spare / spare.sum()))
        start_m, goal_m = (ROOM_M + float(rng.uniform(0.0, lengths[lane] - 2.0 * ROOM_M)) for lane in (start, goal))
        way_m = shortest_m(roads, (start, start_m), (goal, goal_m), closed)
        if not np.isfinite(way_m):
            continue
        found = Mission(number, int(rng.integers(2**31 - 1)), network.lane_ids[start], round(start_m, 3),
                        network.lane_ids[goal], round(goal_m, 3), bool(mapped[goal]), round(way_m, 3))  # fmt: skip
        if way_m >= SHORTEST_MISSION_M:
            return found
        if best is None or way_m > best.shortest_m:
            best = found
    if best is None:
        raise HippodromeError("missions: no way leads from one lane of the network to another; check it in netedit")
    return best


def pose_of(network: RoadNetwork, lane_id: str, position_m: float) -> tuple[float, float, float]:
    """The pose in the middle of a lane at an arc length."""
    lane = network.lane_ids.index(lane_id)
    x, y, heading = poses_on_segments(road_geometry(network), np.array([lane]), np.array([position_m]))[0]
    return float(x), float(y), float(heading)
