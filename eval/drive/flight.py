"""One mission, step by step: the world moves, the navigator commands, and what really happens is written down for the scoring."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from time import process_time
from typing import Final, TypeAlias

import numpy as np

from hippodrome.core.navigation.types import Command, DrivingState
from hippodrome.core.types import FloatArray
from hippodrome.eval.drive.drivers import Cockpit, Driver
from hippodrome.eval.drive.foreign import Foreign
from hippodrome.eval.drive.missions import Mission
from hippodrome.eval.methods.protocol import MethodError
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
    failure: str = ""  # of a policy, where it did not go on to the end

    def column(self, name: str) -> FloatArray:
        """One column of the trace."""
        values: FloatArray = self.trace[:, TRACE.index(name)]
        return values


def limit_s(mission: Mission) -> float:
    """How long a mission may take."""
    return min(LONGEST_S, SEARCH_S + mission.shortest_m / SLOWEST_MPS)


Look: TypeAlias = Callable[[Sensed, Driver, Command], None]


def fly(world: World, mission: Mission, cockpit: Cockpit, look: Look | None = None) -> Flight:
    """Drive one mission. ``look`` is shown each step, for films. A policy that fails ends the mission, and is told of.

    Raises:
        HippodromeError: the world or the map cannot be used.
    """
    sensed = world.reset(mission.seed, LanePlace(mission.start_lane, mission.start_m))
    rows: list[tuple[float, ...]] = []
    events: list[Event] = []
    standing_s, cause, failure, arrived, began, their_s = 0.0, "", "", False, process_time(), 0.0
    driver: Driver | None = None
    try:
        with cockpit.driver(sensed.truth) as (driver, known):
            began = process_time()
            while not cause:
                if known is not None:
                    known.truth = sensed.truth
                command = driver.step(sensed.observation, sensed.radar)
                if look is not None:
                    look(sensed, driver, command)
                rows.append(_written(sensed, driver, command.state))
                events += sensed.events
                standing_s = standing_s + STEP_S if abs(sensed.truth.speed_mps) < STANDING_MPS else 0.0
                arrived = command.state is DrivingState.ARRIVED and abs(sensed.truth.speed_mps) < STANDING_MPS
                cause = _end(mission, sensed, command, standing_s)
                if not cause:
                    sensed = world.step(command.acceleration_mps2, command.steering_rad, command.indicator, command.reverse)
    except MethodError as error:
        failure = cause = f"the policy failed: {error}"
        rows = rows or [_written(sensed, driver, DrivingState.HALTED)]
    if isinstance(driver, Foreign):
        their_s = driver.cpu_s
    ours_s = process_time() - began
    return Flight(np.array(rows), tuple(events), sensed.truth.lane_id, arrived, cause.rstrip(", "), ours_s + their_s, failure)


def _end(mission: Mission, sensed: Sensed, command: Command, standing_s: float) -> str:
    """Why the mission ends here; empty where it goes on."""
    if command.state is DrivingState.ARRIVED and abs(sensed.truth.speed_mps) < STANDING_MPS:
        return "arrived"
    if sensed.truth.t_s > limit_s(mission):
        return f"time is up: {command.state.name.lower()}, {command.reason}"
    return f"stands: {command.state.name.lower()}, {command.reason}" if standing_s > STUCK_S else ""


def _written(sensed: Sensed, driver: Driver | None, state: DrivingState) -> tuple[float, ...]:
    """A row of the trace."""
    truth = sensed.truth
    estimate, track = (driver.estimate, driver.track) if driver is not None else (None, None)
    localized = estimate is not None and estimate.localized
    x, y, sigma = (track.pose[0], track.pose[1], track.sigma_m) if track is not None else (math.nan, math.nan, math.nan)
    return (
        truth.t_s, truth.x_m, truth.y_m, truth.heading_rad, truth.speed_mps, truth.acceleration_mps2, truth.yaw_rate_radps,
        truth.offset_m, truth.wheel_outside_m, float(truth.in_junction), truth.lane_position_m, sensed.radar.gap_m, float(state),
        float(localized), x, y, sigma, truth.driven_m,
    )  # fmt: skip
