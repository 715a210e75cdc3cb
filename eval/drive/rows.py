"""The rows of the table: who drives. All but the first tell what a part of it is worth."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.navigator import PoseSource
from hippodrome.core.types import FloatArray, HippodromeError, LocalizationEstimate, LocalizationStatus, Observation
from hippodrome.core.views.odometry import CameraGeometry
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


ROWS: Final = (
    RowSpec("ours", "ours"),
    RowSpec("truth", "ours, pose from truth", pose="truth"),
    RowSpec("dead-reckoning", "ours, dead reckoning from the true start", pose="dead reckoning"),
    RowSpec("no-reading", "ours, without road reading", read_road=False),
    RowSpec("on-sight", "ours, searching on sight alone", search_network=False),
    RowSpec("paper", "ours, localizer mode paper", mode="paper"),
    RowSpec("kalman", "ours, localizer mode kalman", mode="kalman"),
)
DEFAULT_ROWS: Final = ("ours", "truth")


def row_named(key: str) -> RowSpec:
    """The row that is called so. Raises HippodromeError if there is none."""
    found = next((row for row in ROWS if row.key == key), None)
    if found is None:
        raise HippodromeError(f"--rows {key}: there is no such row; choose from {', '.join(row.key for row in ROWS)}")
    return found


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
            self._units, self._metres = self._units + units, self._metres + float(np.hypot(*(now - self._pose)[:2]))
            self._pose = now
        else:
            distance, chord = units * self._scale, self._pose[2] + 0.5 * turned
            self._pose = self._pose + np.array([distance * math.cos(chord), distance * math.sin(chord), turned])
            self._driven_m += distance
        sigma = TRUE_SIGMA_M if self._follow else min(0.3 + DRIFT_SHARE * self._driven_m, 1.0)
        covariance = np.diag([sigma**2, sigma**2, 0.01**2])
        return _estimate(observation.t_s, self._pose.copy(), covariance)


def _estimate(t_s: float, pose: FloatArray, covariance: FloatArray) -> LocalizationEstimate:
    none = np.zeros((0, 2, 2))
    heads = np.full(2, pose[2])
    return LocalizationEstimate(t_s, pose, covariance, True, 9.0, -1, heads, np.ones(2), none, none, LocalizationStatus.LOCALIZED)
