"""The conditions of the robustness matrix: each changes one thing of the localization drive, the mapping drive stays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final, TypeAlias

from hippodrome.core.localization.beliefs.config import VISUAL_NOISE
from hippodrome.core.types import HippodromeError
from hippodrome.core.views.config import CameraGeometry
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.self_motion import NoiseLevel, at_level
from hippodrome.sim.traffic_spec import TrafficSpec

Change: TypeAlias = Callable[[Scenario], Scenario]

SAME: Final = "same"  # the mapping drive's own light, weather and camera
SUN_AND_FOG: Final = "sun-opposite-fog-80m"


def _seen(**update: Any) -> Change:
    """The localization drive under the mapping drive's light, weather and camera response, but for what ``update`` changes."""

    def change(scenario: Scenario) -> Scenario:
        conditions = scenario.mapping.conditions.model_copy(update=update)
        drive = scenario.localization.model_copy(update={"conditions": conditions})
        return scenario.model_copy(update={"localization": drive})

    return change


def _sun_opposite(scenario: Scenario) -> Scenario:
    """The sun from the other side: what was lit lies in shadow."""
    azimuth_deg = scenario.mapping.conditions.sun_azimuth_deg
    return _seen(sun_azimuth_deg=azimuth_deg - 180.0 if azimuth_deg > 0.0 else azimuth_deg + 180.0)(scenario)


def _sun_opposite_in_fog(scenario: Scenario) -> Scenario:
    """The sun from the other side, behind fog with a visibility of 80 m."""
    conditions = _sun_opposite(scenario).localization.conditions
    return _seen(sun_azimuth_deg=conditions.sun_azimuth_deg, fog_visibility_m=80.0)(scenario)


def _traffic(vehicles: int) -> Change:
    """Another number of vehicles on the road."""

    def change(scenario: Scenario) -> Scenario:
        same = _seen()(scenario)
        drive = same.localization.model_copy(update={"traffic": TrafficSpec(vehicles=vehicles)})
        return same.model_copy(update={"localization": drive})

    return change


def _wander(sigma_m: float) -> Change:
    """A driver who wanders to the left and right in the lane, by this standard deviation."""

    def change(scenario: Scenario) -> Scenario:
        same = _seen()(scenario)
        ego = same.localization.ego.model_copy(update={"lateral_wander_m": sigma_m})
        return same.model_copy(update={"localization": same.localization.model_copy(update={"ego": ego})})

    return change


def _askew(offset_deg: float) -> Change:
    """A camera that looks to the left of where it looked on the mapping drive."""

    def change(scenario: Scenario) -> Scenario:
        yaw_deg = scenario.camera.yaw_offset_deg + offset_deg
        return _seen()(scenario).model_copy(update={"camera": scenario.camera.model_copy(update={"yaw_offset_deg": yaw_deg})})

    return change


def _self_motion(level: NoiseLevel) -> Change:
    """Self-motion with the errors of another noise level, in the scenario's unit."""
    return lambda scenario: _seen()(scenario).model_copy(update={"noise": at_level(level, scenario.noise)})


def _visual(scenario: Scenario) -> Scenario:
    """Self-motion from the frames alone: the localizer gets no odometry."""
    same, camera = _seen()(scenario), scenario.camera
    geometry = CameraGeometry(camera.fov_deg, camera.height_m, camera.forward_m)
    localizer = replace(same.localizer, self_motion="visual", camera=geometry, motion=VISUAL_NOISE)
    return same.model_copy(update={"localizer": localizer})


CONDITIONS: Final[dict[str, Change]] = {
    SAME: _seen(),
    "sun-opposite": _sun_opposite,
    "overcast": _seen(overcast=1.0),
    "dusk": _seen(dusk=0.8),
    "fog-80m": _seen(fog_visibility_m=80.0),
    SUN_AND_FOG: _sun_opposite_in_fog,
    "winter": _seen(season="winter"),
    "traffic-0": _traffic(0),
    "traffic-30": _traffic(30),
    "camera-noise": _seen(noise_sigma=8.0),
    "exposure": _seen(gain=0.6, gamma=1.2),
    "blur": _seen(motion_blur=0.03),
    "wander-0.5m": _wander(0.5),
    "yaw-5deg": _askew(5.0),
    "self-motion-clean": _self_motion("clean"),
    "self-motion-realistic": _self_motion("realistic"),
    "self-motion-harsh": _self_motion("harsh"),
    "self-motion-visual": _visual,
}

OURS_ALONE: Final = frozenset({"self-motion-visual"})  # changes a setting of our localizer, and nothing that others are given


def chosen(names: Sequence[str] | None) -> list[str]:
    """The named conditions in the order of ``CONDITIONS``, all of them if ``names`` is None. Raises HippodromeError."""
    unknown = [name for name in names or () if name not in CONDITIONS]
    if unknown:
        raise HippodromeError(f"no condition '{unknown[0]}': choose from {', '.join(CONDITIONS)}")
    return [name for name in CONDITIONS if names is None or name in names]
