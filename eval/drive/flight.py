"""One mission, step by step: the world moves, the navigator commands, and what really happens is written down for the scoring."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from time import process_time
from typing import Final

import numpy as np

from hippodrome.core.navigation.navigator import Navigator
from hippodrome.core.navigation.types import DrivingState, Goal
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, FloatArray
from hippodrome.eval.drive.missions import Mission, pose_of
from hippodrome.eval.drive.rows import KnownPose, RowSpec, navigator_config
from hippodrome.sim.loop.types import Event, LanePlace, Sensed
from hippodrome.sim.loop.world import STEP_S, World

LONGEST_S: Final = 900.0  # of a mission, whatever it is
SLOWEST_MPS: Final = 2.0  # a mission may take as long as its way at this speed ..
SEARCH_S: Final = 150.0  # .. and so long to find out where it begins
STUCK_S: Final = 120.0  # who stands so long, longer than any light is red, does not get on
STANDING_MPS: Final = 0.05
# Columns of the trace, one row per step.
TRACE: Final = (
    "t_s", "x_m", "y_m", "heading_rad", "speed_mps", "acceleration_mps2", "yaw_rate_radps", "offset_m", "wheel_outside_m",
    "in_junction", "lane_m", "gap_m", "state", "localized", "estimate_x_m", "estimate_y_m", "sigma_m", "driven_m",
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """What happened on a mission."""

    trace: FloatArray  # (n, len(TRACE))
    events: tuple[Event, ...]
    end_lane: str  # the lane that the rear axle stood on at the end, empty off the road
    arrived: bool  # by the navigator's own declaration
    cause: str  # why it ended, and for a mission that failed the navigator's last words
    cpu_s: float

    def column(self, name: str) -> FloatArray:
        """One column of the trace."""
        values: FloatArray = self.trace[:, TRACE.index(name)]
        return values


def limit_s(mission: Mission) -> float:
    """How long a mission may take."""
    return min(LONGEST_S, SEARCH_S + mission.shortest_m / SLOWEST_MPS)


def fly(
    world: World,
    mission: Mission,
    row: RowSpec,
    cognitive_map: CognitiveMap,
    surveyed: RoadNetwork,
    look: Callable[[Sensed, Navigator], None] | None = None,
) -> Flight:
    """Drive one mission. ``look`` is shown each step, for films.

    Raises:
        HippodromeError: the world or the map cannot be used.
    """
    sensed = world.reset(mission.seed, LanePlace(mission.start_lane, mission.start_m))
    navigator, known = _navigator(world, row, cognitive_map, surveyed, sensed)
    navigator.set_goal(Goal(*pose_of(surveyed, mission.goal_lane, mission.goal_m)))
    rows: list[tuple[float, ...]] = []
    events: list[Event] = []
    standing_s, began, cause, arrived = 0.0, process_time(), "", False
    while not cause:
        if known is not None:
            known.truth = sensed.truth
        command = navigator.step(sensed.observation, sensed.radar)
        if look is not None:
            look(sensed, navigator)
        rows.append(_written(sensed, navigator, command.state))
        events += sensed.events
        standing_s = standing_s + STEP_S if abs(sensed.truth.speed_mps) < STANDING_MPS else 0.0
        arrived = command.state is DrivingState.ARRIVED and abs(sensed.truth.speed_mps) < STANDING_MPS
        if arrived:
            cause = "arrived"
        elif sensed.truth.t_s > limit_s(mission):
            cause = f"time is up: {command.state.name.lower()}, {command.reason}"
        elif standing_s > STUCK_S:
            cause = f"stands: {command.state.name.lower()}, {command.reason}"
        else:
            sensed = world.step(command.acceleration_mps2, command.steering_rad, command.indicator, command.reverse)
    return Flight(np.array(rows), tuple(events), sensed.truth.lane_id, arrived, cause.rstrip(", "), process_time() - began)


def _navigator(
    world: World, row: RowSpec, cognitive_map: CognitiveMap, surveyed: RoadNetwork, first: Sensed
) -> tuple[Navigator, KnownPose | None]:
    """The navigator of a row, and its pose source where that is no localizer."""
    config = navigator_config(world.scenario, row)
    if row.pose == "localizer":
        return Navigator(cognitive_map, surveyed, config), None
    scale = 1.0 if cognitive_map.log_scale is None else math.exp(float(np.median(cognitive_map.log_scale)))
    known = KnownPose(first.truth, scale, row.pose == "truth")
    return Navigator(cognitive_map, surveyed, config, known), known


def _written(sensed: Sensed, navigator: Navigator, state: DrivingState) -> tuple[float, ...]:
    """A row of the trace."""
    truth, estimate, track = sensed.truth, navigator.estimate, navigator.track
    localized = estimate is not None and estimate.localized
    x, y, sigma = (track.pose[0], track.pose[1], track.sigma_m) if track is not None else (math.nan, math.nan, math.nan)
    return (
        truth.t_s, truth.x_m, truth.y_m, truth.heading_rad, truth.speed_mps, truth.acceleration_mps2, truth.yaw_rate_radps,
        truth.offset_m, truth.wheel_outside_m, float(truth.in_junction), truth.lane_position_m, sensed.radar.gap_m, float(state),
        float(localized), x, y, sigma, truth.driven_m,
    )  # fmt: skip
