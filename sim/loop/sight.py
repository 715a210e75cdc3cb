"""The camera of the ego in the loop: the scene, its renderer, the lamps of the signals, and when a frame is due."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import libsumo
import numpy as np

from hippodrome.core.types import FloatArray, Frame
from hippodrome.sim.loop.lamps import Heads, Lamps
from hippodrome.sim.loop.users import Users
from hippodrome.sim.record import close_renderer
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.scene.build import build_scene
from hippodrome.sim.scene.conditions import apply_camera
from hippodrome.sim.types import Town

if TYPE_CHECKING:
    from hippodrome.sim.render.flat import FlatPrimitive
    from hippodrome.sim.render.renderer import FrameRenderer


class Sight:
    """Draws frames of one scenario's town. The scene is built when the first frame is drawn."""

    def __init__(self, scenario: Scenario, town: Town, seen_m: FloatArray, heads: Heads, step_s: float) -> None:
        self._scenario, self._town, self._seen_m, self._heads = scenario, town, seen_m, heads
        self._rate = min(scenario.camera.rate_hz * step_s, 1.0)  # frames per step
        self._drawn: tuple[FrameRenderer, Lamps, FlatPrimitive | None] | None = None

    def is_due(self, step: int) -> bool:
        """Whether the camera takes a frame at the end of this step; it does at the reset, which is step 0."""
        return step == 0 or math.floor(step * self._rate + 1e-9) > math.floor((step - 1) * self._rate + 1e-9)

    def frame(self, pose_m: FloatArray, users: Users, rng: np.random.Generator) -> Frame:
        """The image from pose (3,) or, where roads climb, (5,), with the lamps as SUMO has them now."""
        if self._drawn is None:
            self._drawn = self._open()
        renderer, lamps, primitive = self._drawn
        states = {name: str(libsumo.trafficlight.getRedYellowGreenState(name)) for name in lamps.signals()}
        tile = lamps.tile(float(pose_m[0]), float(pose_m[1]), states)
        if tile is not None and primitive is not None:
            primitive.replace(tile)
        elif tile is not None and len(tile.faces):
            self._drawn = renderer, lamps, renderer.add_moving(tile)
        image = renderer.render(pose_m, users.poses_m, users.kinds, users.ids)
        return apply_camera(image, self._scenario.localization.conditions, rng)

    def close(self) -> None:
        """Frees the renderer; a second call does nothing."""
        if self._drawn is not None:
            self._drawn[0].close()
            self._drawn = None

    def _open(self) -> tuple[FrameRenderer, Lamps, FlatPrimitive | None]:
        from hippodrome.sim.render.renderer import FrameRenderer  # not before a frame is drawn: without frames no GL is needed

        close_renderer()  # of a recording that was drawn before: a process can have one
        scene = build_scene(self._town, self._scenario.seed, self._scenario.localization.conditions, self._seen_m)
        return FrameRenderer(scene, self._scenario.camera), Lamps(self._heads, scene.origin_m, scene.light), None
