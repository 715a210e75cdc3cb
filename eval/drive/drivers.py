"""Who may drive a mission: the navigator, or a stranger's policy in a process of its own."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from hippodrome.core.navigation.navigator import Navigator
from hippodrome.core.navigation.pilot import Plan
from hippodrome.core.navigation.track import Track
from hippodrome.core.navigation.types import Command, Goal, Radar
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, LocalizationEstimate, Observation
from hippodrome.eval.drive.foreign import Foreign
from hippodrome.eval.drive.rows import KnownPose, RowSpec, navigator_config
from hippodrome.proto.codec import load_map
from hippodrome.sim.loop.types import Truth
from hippodrome.sim.scenario import Scenario


class Driver(Protocol):
    """What drives. Only what is sensed reaches it."""

    def step(self, observation: Observation, radar: Radar = ..., /) -> Command:
        """What to do over the next step."""

    @property
    def estimate(self) -> LocalizationEstimate | None:
        """The localizer's last answer, if there is one to be seen."""

    @property
    def track(self) -> Track | None:
        """The pose that is steered by, if it is known and can be seen."""

    @property
    def plan(self) -> Plan | None:
        """The plan under way, if there is one to be seen."""


@dataclass(frozen=True, slots=True, eq=False)
class Cockpit:
    """A mission's surroundings, from which its driver is made.

    Args:
        scenario: of the mission.
        row: who drives.
        map_file: of the topometric map.
        roads: as surveyed.
        goal: to stop at.
        number: of the mission, for policies that draw numbers.
        concealed: folders with the truth, which a policy is not to see.
    """

    scenario: Scenario
    row: RowSpec
    map_file: Path
    roads: RoadNetwork
    goal: Goal
    number: int = 0
    concealed: tuple[Path, ...] = ()

    @contextmanager
    def driver(self, start: Truth) -> Iterator[tuple[Driver, KnownPose | None]]:
        """Who drives, and the pose source of the bounds, which is told the truth at each step.

        Raises HippodromeError where the map cannot be used, or the policy cannot be started.
        """
        if self.row.policy is not None:
            camera, rate_hz = self.scenario.camera, 10.0
            with ExitStack() as stack:
                foreign = Foreign(self.row.policy, self.scenario.missions.answer_limit_s, self.concealed)
                stack.callback(foreign.close)
                foreign.begin(self.map_file, self.roads, self.goal, camera, rate_hz, self.number)
                yield foreign, None
            return
        cognitive_map = load_map(self.map_file)[0]
        navigator, known = self._navigator(cognitive_map, start)
        navigator.set_goal(self.goal)
        yield navigator, known

    def _navigator(self, cognitive_map: CognitiveMap, start: Truth) -> tuple[Navigator, KnownPose | None]:
        """The navigator of a row, and its pose source where that is no localizer."""
        config = navigator_config(self.scenario, self.row)
        if self.row.pose == "localizer":
            return Navigator(cognitive_map, self.roads, config), None
        scale = 1.0 if cognitive_map.log_scale is None else math.exp(float(np.median(cognitive_map.log_scale)))
        known = KnownPose(start, scale, self.row.pose == "truth")
        return Navigator(cognitive_map, self.roads, config, known), known
