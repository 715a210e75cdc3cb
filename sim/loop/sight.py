"""The camera of the ego in the loop: the scene, its renderer, and when a frame is due."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hippodrome.core.types import FloatArray, Frame
from hippodrome.sim.loop.users import Users
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.scene.build import build_scene
from hippodrome.sim.scene.conditions import apply_camera
from hippodrome.sim.types import Town

if TYPE_CHECKING:
    from hippodrome.sim.render.renderer import FrameRenderer


class Sight:
    """Draws frames of one scenario's town. The scene is built when the first frame is drawn."""

    def __init__(self, scenario: Scenario, town: Town, seen_m: FloatArray, step_s: float) -> None:
        self._scenario, self._town, self._seen_m = scenario, town, seen_m
        self._rate = min(scenario.camera.rate_hz * step_s, 1.0)  # frames per step
        self._renderer: FrameRenderer | None = None

    def is_due(self, step: int) -> bool:
        """Whether the camera takes a frame at the end of this step; it does at the reset, which is step 0."""
        return step == 0 or math.floor(step * self._rate + 1e-9) > math.floor((step - 1) * self._rate + 1e-9)

    def frame(self, pose_m: FloatArray, users: Users, rng: np.random.Generator) -> Frame:
        """The image from pose (3,) or, where roads climb, (5,)."""
        if self._renderer is None:
            self._renderer = self._new_renderer()
        image = self._renderer.render(pose_m, users.poses_m, users.kinds, users.ids)
        return apply_camera(image, self._scenario.localization.conditions, rng)

    def close(self) -> None:
        """Frees the renderer; a second call does nothing."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _new_renderer(self) -> FrameRenderer:
        from hippodrome.sim.render.renderer import FrameRenderer  # not before a frame is drawn: without frames no GL is needed

        scene = build_scene(self._town, self._scenario.seed, self._scenario.localization.conditions, self._seen_m)
        return FrameRenderer(scene, self._scenario.camera)
