"""The rows of the table: who drives. All but the first tell what a part of it is worth."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.navigator import PoseSource
from hippodrome.core.types import FloatArray, HippodromeError, LocalizationEstimate, LocalizationStatus, Observation
from hippodrome.core.views.config import CameraGeometry
from hippodrome.eval.drive.foreign import Policy
from hippodrome.sim.loop.types import Truth
from hippodrome.sim.scenario import Scenario

TRUE_SIGMA_M: Final = 0.05  # what is stated of a pose that is true
DRIFT_SHARE: Final = 0.05  # of the way, what dead reckoning states as its error


@dataclass(frozen=True, slots=True)
class RowSpec:
    """One row."""

    key: str
    label: str
    pose: Literal["localizer", "truth", "dead reckoning"] = "localizer"
    mode: Literal["coupled", "paper", "kalman", "lanes"] | None = None  # of the localizer; None: the scenario's own
    read_road: bool = True
    search_network: bool = True
    policy: Policy | None = None  # of somebody else, in place of the navigator

    @property
    def stem(self) -> str:
        """The row's name in the names of files; no policy has that of a row of ours."""
        return self.key if self.policy is None else "policy-" + re.sub(r"[^A-Za-z0-9._-]", "-", self.key)

    def made_of(self) -> tuple[str, ...]:
        """What a policy is run by and made of; nothing for a row of ours."""
        return () if self.policy is None else (self.policy.source, self.policy.sha256())


ROWS: Final = (
    RowSpec("ours", "ours"),
    RowSpec("truth", "ours, pose from truth", pose="truth"),
    RowSpec("dead-reckoning", "ours, dead reckoning from the true start", pose="dead reckoning"),
    RowSpec("no-reading", "ours, without road reading", read_road=False),
    RowSpec("on-sight", "ours, searching on sight alone", search_network=False),
    RowSpec("paper", "ours, localizer mode paper", mode="paper"),
    RowSpec("kalman", "ours, localizer mode kalman", mode="kalman"),
)


def row_named(key: str) -> RowSpec:
    """The row that is called so. Raises HippodromeError if there is none."""
    found = next((row for row in ROWS if row.key == key), None)
    if found is None:
        raise HippodromeError(f"--rows {key}: there is no such row; choose from {', '.join(row.key for row in ROWS)}")
    return found


def policy_row(policy: Policy) -> RowSpec:
    """The row of a policy. Raises HippodromeError if a row of ours is called so."""
    taken = {name for row in ROWS for name in (row.key, row.label)}
    if policy.name in taken:
        raise HippodromeError(f"--policy {policy.name}: a row of ours is called so; name it otherwise, NAME={policy.source}")
    return RowSpec(policy.name, policy.name, policy=policy)


def navigator_config(scenario: Scenario, row: RowSpec) -> NavigatorConfig:
    """The navigator's configuration: the scenario's camera and localizer, and what the row leaves out."""
    camera = scenario.camera
    localizer = replace(scenario.localizer, road_reading=False)  # the navigator reads the road itself
    localizer = localizer if row.mode is None else replace(localizer, mode=row.mode)
    geometry = CameraGeometry(fov_deg=camera.fov_deg, height_m=camera.height_m, forward_m=camera.forward_m)
    return NavigatorConfig(
        localizer=localizer,
        camera=geometry,
        read_road=row.read_road,
        exact_poses=row.pose == "truth",
        search_network=row.search_network,
    )


class KnownPose(PoseSource):
    """A pose source of the bounds: the truth (the upper one), or dead reckoning from the true start (the lower one)."""

    def __init__(self, start: Truth, expected_metres_per_unit: float, follow_truth: bool) -> None:
        self.truth = start
        self._follow, self._scale = follow_truth, expected_metres_per_unit
        self._pose = np.array(start.pose_m)
        self._driven_m = 0.0
        self._units = self._metres = 0.0

    @property
    def metres_per_unit(self) -> float:
        """The true scale so far, or the one that is expected."""
        return self._metres / self._units if self._follow and self._units > 0.0 else self._scale

    def step(self, observation: Observation) -> LocalizationEstimate:
        """The pose at the time of the observation."""
        units, turned = observation.speed * observation.dt_s, observation.yaw_rate_radps * observation.dt_s
        if self._follow:
            now = np.array(self.truth.pose_m)
            self._units, self._metres = self._units + abs(units), self._metres + float(np.hypot(*(now - self._pose)[:2]))
            self._pose = now
        else:
            distance, chord = units * self._scale, self._pose[2] + 0.5 * turned
            self._pose = self._pose + np.array([distance * math.cos(chord), distance * math.sin(chord), turned])
            self._driven_m += abs(distance)
        sigma = TRUE_SIGMA_M if self._follow else min(0.3 + DRIFT_SHARE * self._driven_m, 1.0)
        covariance = np.diag([sigma**2, sigma**2, 0.01**2])
        return _estimate(observation.t_s, self._pose.copy(), covariance)


def _estimate(t_s: float, pose: FloatArray, covariance: FloatArray) -> LocalizationEstimate:
    none = np.zeros((0, 2, 2))
    heads = np.full(2, pose[2])
    return LocalizationEstimate(t_s, pose, covariance, True, 9.0, -1, heads, np.ones(2), none, none, LocalizationStatus.LOCALIZED)
