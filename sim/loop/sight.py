"""The camera of the ego in the loop: the scene, its renderer, the lamps of the signals, and when a frame is due."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import libsumo
import numpy as np

from hippodrome.core.types import FloatArray, Frame
from hippodrome.sim.loop.lamps import Heads, Lamps
from hippodrome.sim.loop.users import Users
from hippodrome.sim.record import close_renderer
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.scene.blocks import is_drawn_whole
from hippodrome.sim.scene.build import build_scene
from hippodrome.sim.scene.conditions import apply_camera
from hippodrome.sim.types import Town

if TYPE_CHECKING:
    from hippodrome.sim.render.flat import FlatPrimitive
    from hippodrome.sim.render.renderer import FrameRenderer


COVERED_M: Final = 1500.0  # of a large town the roads this near to the ego are made, and what can be seen from them
LEFT_M: Final = 1100.0  # and made anew after so much way as the crow flies: what the ego sees is always there


class Sight:
    """Draws frames of one scenario's town. The scene is built when the first frame is drawn; of a large town, the part around."""

    def __init__(self, scenario: Scenario, town: Town, heads: Heads, step_s: float) -> None:
        self._scenario, self._town, self._heads = scenario, town, heads
        self._is_whole = is_drawn_whole(town)
        self._middle_m = np.zeros(2)
        self._rate = min(scenario.camera.rate_hz * step_s, 1.0)  # frames per step
        self._drawn: tuple[FrameRenderer, Lamps, FlatPrimitive | None] | None = None

    def is_due(self, step: int) -> bool:
        """Whether the camera takes a frame at the end of this step; it does at the reset, which is step 0."""
        return step == 0 or math.floor(step * self._rate + 1e-9) > math.floor((step - 1) * self._rate + 1e-9)

    def frame(self, pose_m: FloatArray, users: Users, rng: np.random.Generator) -> Frame:
        """The image from pose (3,) or, where roads climb, (5,), with the lamps as SUMO has them now."""
        if not self._is_whole and np.hypot(*(pose_m[:2] - self._middle_m)) > LEFT_M:
            self.close()
        if self._drawn is None:
            self._drawn = self._open(pose_m[:2])
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

    def _open(self, place_m: FloatArray) -> tuple[FrameRenderer, Lamps, FlatPrimitive | None]:
        from hippodrome.sim.render.renderer import FrameRenderer  # not before a frame is drawn: without frames no GL is needed

        close_renderer()  # of a recording that was drawn before: a process can have one
        self._middle_m = place_m.copy()
        roads_m = self._town.network.points_m
        near_m = roads_m[np.hypot(*(roads_m - place_m).T) < COVERED_M]
        conditions = self._scenario.localization.conditions
        scene = build_scene(self._town, self._scenario.seed, conditions, np.concatenate([place_m[None], near_m]))
        return FrameRenderer(scene, self._scenario.camera), Lamps(self._heads, scene.origin_m, scene.light), None
