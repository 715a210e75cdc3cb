"""The plan under way: the course to the goal, the place on it, and when a new one is due."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.course import Course, Gate, make_course, next_gate, offset_and_turn, place_on
from hippodrome.core.navigation.placing import LanePlace, lane_of, opposite_lane, opposite_lanes, place_beside
from hippodrome.core.navigation.routes import (
    RoadTimes,
    TimesToGoal,
    mapped_lanes,
    place_to_turn,
    road_times,
    route,
    time_left_s,
    times_to_goal,
)
from hippodrome.core.navigation.types import Goal
from hippodrome.core.roads.geometry import RoadGeometry, poses_on_segments, road_geometry
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.roads.paths import STEP_M, Piece
from hippodrome.core.types import CognitiveMap, FloatArray, HippodromeError

OFF_COURSE_M, OFF_COURSE_RAD = 2.5, 1.0  # who is so far off the path has missed it, and plans anew
GOAL_REACH_M = 4.0  # a goal this far from every lane of its direction is on none


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A course, and how far along it the vehicle is."""

    course: Course
    u_m: float
    turns: bool = False  # it ends where the vehicle is to turn round, as no other way leads to the goal

    @property
    def to_goal_m(self) -> float:
        return self.course.goal_u_m - self.u_m

    def gate(self) -> Gate | None:
        """The junction ahead, or that the vehicle is in."""
        return next_gate(self.course, self.u_m)


class RoutePlanner:
    """Plans on one network and one map, towards one goal at a time; closed roads are remembered."""

    def __init__(self, cognitive_map: CognitiveMap, network: RoadNetwork, config: NavigatorConfig) -> None:
        self._config = config
        self.roads: RoadGeometry = road_geometry(network)
        self._network = network
        self._times: RoadTimes = road_times(
            network, mapped_lanes(network, cognitive_map, config.plan.mapped_within_m), config.plan
        )
        self._goal: LanePlace | None = None
        self._to_goal: TimesToGoal | None = None
        self._opposite: tuple[int, ...] = ()  # found when it is first asked for
        self.closed: frozenset[int] = frozenset()

    def set_goal(self, goal: Goal) -> None:
        """Plan to a goal from now on. Raises HippodromeError if it lies on no lane of its direction."""
        pose = np.array([goal.x_m, goal.y_m, goal.heading_rad])
        place = lane_of(self.roads, pose)
        if place is None or abs(place.offset_m) > GOAL_REACH_M:
            raise HippodromeError(
                f"goal x={goal.x_m:.1f} m, y={goal.y_m:.1f} m, heading {goal.heading_rad:.2f} rad: no lane of this direction "
                f"lies within {GOAL_REACH_M:g} m; give the place and the direction of a lane"
            )
        self._goal, self.closed = place, frozenset()
        self._search()

    def close(self, edge: int) -> None:
        """A road on which nobody gets through: plans avoid it from now on."""
        self.closed = self.closed | {edge}
        self._search()

    def close_own(self, pose: FloatArray) -> bool:
        """Close the road that a pose is on; whether it is on one outside of junctions."""
        place = lane_of(self.roads, pose, inside=False)
        if place is not None:
            self.close(int(self._network.lane_edge[place.lane]))
        return place is not None

    def open_all(self) -> None:
        """Forget which roads are closed."""
        self.closed = frozenset()
        self._search()

    def _search(self) -> None:
        assert self._goal is not None
        goal = self._goal
        self._to_goal = times_to_goal(self._times, goal.lane, goal.position_m, self.closed, self._config.plan)

    def plan(self, pose: FloatArray, speed_mps: float, beyond_goal: bool = False) -> Plan | None:
        """The plan from a pose; None if the pose is on no lane, or no way leads to the goal.

        ``beyond_goal`` plans a way round that comes back to a goal at which the vehicle is already.
        """
        place = lane_of(self.roads, pose)
        if place is None or self._to_goal is None or self._goal is None:
            return None
        here_m = place.position_m
        if beyond_goal and place.lane == self._goal.lane:
            here_m = max(here_m, self._goal.position_m + 0.1)
        pieces = route(self._times, self._to_goal, place.lane, here_m, speed_mps, self._config.plan)
        return self._plan_on(pieces, self._goal, place, pose) if pieces else self._plan_to_turn(place, pose, speed_mps)

    def _plan_to_turn(self, place: LanePlace, pose: FloatArray, speed_mps: float) -> Plan | None:
        """The plan to where the vehicle turns round in the street, where no way leads to the goal without."""
        assert self._goal is not None
        config, goal = self._config.plan, self._goal
        self._opposite = self._opposite or opposite_lanes(self.roads)
        times = times_to_goal(self._times, goal.lane, goal.position_m, self.closed, config, self._opposite)
        found = place_to_turn(self._times, times, place.lane, place.position_m, self._opposite, config)
        if found is None:
            return None
        lane, length_m = found[0], float(self.roads.lane_length_m[found[0]])
        braking_m = speed_mps**2 / (2.0 * config.turn_stop_mps2) + self._config.drive.goal_tolerance_m
        wanted_m = place.position_m + braking_m if lane == place.lane else config.turn_room_m
        stop_m = max(min(wanted_m, length_m - 0.5), 0.5 * length_m if lane != place.lane else min(place.position_m, length_m))
        stop = place_beside(self.roads, pose, lane, stop_m)
        there = times_to_goal(self._times, lane, stop_m, frozenset(), config)
        pieces = route(self._times, there, place.lane, place.position_m, speed_mps, config)
        plan = self._plan_on(pieces, stop, place, pose) if pieces else None
        return None if plan is None else replace(plan, turns=True)

    def opposite(self, pose: FloatArray) -> FloatArray | None:
        """The pose (3,) on the lane of the opposite direction beside a pose, if a way leads from there to the goal."""
        place = opposite_lane(self.roads, pose)
        if place is None or self._to_goal is None:
            return None
        if not math.isfinite(time_left_s(self._times, self._to_goal, place.lane, place.position_m)):
            return None
        there: FloatArray = poses_on_segments(self.roads, np.array([place.lane]), np.array([place.position_m]))[0]
        return there

    def _plan_on(self, pieces: list[Piece], goal: LanePlace, place: LanePlace, pose: FloatArray) -> Plan:
        """The plan over the stretches of lanes of a route."""
        course = make_course(self._network, pieces, goal.lane, goal.position_m, self._config.drive, self._config.vehicle)
        u_m = place.position_m - pieces[0].begin_m if pieces[0].lane == place.lane else 0.0
        return Plan(course, place_on(course, pose, min(max(u_m, 0.0), course.last_u_m)))

    def lane_place(self, plan: Plan | None, pose: FloatArray) -> LanePlace | None:
        """The lane that the vehicle is taken to be on: the plan's, as long as the vehicle is near its path."""
        if plan is None:
            return lane_of(self.roads, pose)
        k = min(int(plan.u_m / STEP_M), len(plan.course.lane) - 1)
        position_m = float(plan.course.position_m[k]) + plan.u_m - STEP_M * k
        return place_beside(self.roads, pose, int(plan.course.lane[k]), position_m)


def advanced(plan: Plan, pose: FloatArray) -> Plan:
    """The plan with the vehicle's present place on it."""
    return replace(plan, u_m=place_on(plan.course, pose, plan.u_m))


def is_missed(plan: Plan, pose: FloatArray) -> bool:
    """Whether the vehicle has come off its course."""
    offset_m, turn_rad = offset_and_turn(plan.course, pose, plan.u_m)
    return abs(offset_m) > OFF_COURSE_M or abs(turn_rad) > OFF_COURSE_RAD or not math.isfinite(offset_m)
