"""The film of a mission: the camera beside the town from above, with the plan, the belief and the vehicle."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from PIL import Image

from hippodrome._files import replacing
from hippodrome.core.types import FloatArray, Frame
from hippodrome.eval.drive.drivers import Driver
from hippodrome.eval.drive.missions import Mission, pose_of
from hippodrome.sim.loop.types import Sensed
from hippodrome.sim.loop.world import World

EVERY_STEPS: Final = 4  # steps of the loop between two pictures
SHOWN_MS: Final = 100  # of a picture: four times as fast as the drive
MOST: Final = 1500  # pictures; ten minutes of driving
SIZE: Final = (320, 240)  # of each half, in pixels
VIEW_M: Final = 120.0  # across the view from above
ROAD, PLAN, BELIEF, EGO, OTHER, GOAL = (
    (205, 205, 205), (40, 110, 200), (230, 120, 40), (200, 30, 30), (90, 90, 90), (30, 140, 60)
)  # fmt: skip
SIGMAS: Final = 2.0  # of the belief's ellipse
QUALITY: Final = 60


class Film:
    """Collects pictures while a mission is driven; ``look`` is called at each step."""

    def __init__(self, world: World, mission: Mission) -> None:
        self._network = world.network
        self._lanes = [world.network.lane_points_m(k) for k in range(world.network.lane_count)]
        self._goal_m = np.array(pose_of(world.network, mission.goal_lane, mission.goal_m)[:2])
        self._pictures: list[Image.Image] = []
        self._camera: Frame = np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8)
        self._steps = 0

    def look(self, sensed: Sensed, driver: Driver) -> None:
        """Take a step in; every few of them make a picture."""
        if sensed.observation.frame is not None:
            shown = cv2.resize(_coloured(sensed.observation.frame), SIZE, interpolation=cv2.INTER_NEAREST)
            self._camera = np.asarray(shown, dtype=np.uint8)
        if self._steps % EVERY_STEPS == 0 and len(self._pictures) < MOST:
            self._pictures.append(Image.fromarray(np.hstack([self._camera, self._from_above(sensed, driver)])))
        self._steps += 1

    def write(self, file: Path) -> None:
        """Write the film as an animated WebP."""
        with replacing(file) as temporary, temporary.open("wb") as stream:
            first, *others = self._pictures
            first.save(stream, "WEBP", save_all=True, append_images=others, duration=SHOWN_MS, loop=0, quality=QUALITY)

    def _from_above(self, sensed: Sensed, driver: Driver) -> Frame:
        truth = sensed.truth
        middle = np.array([truth.x_m, truth.y_m])
        picture = np.full((SIZE[1], SIZE[0], 3), 245, dtype=np.uint8)
        scale = SIZE[0] / VIEW_M

        def drawn(points_m: FloatArray) -> Any:
            shifted = (np.atleast_2d(points_m)[:, :2] - middle) * np.array([scale, -scale]) + 0.5 * np.array(SIZE)
            return np.rint(np.clip(shifted, -2000, 2000)).astype(np.int32).reshape(-1, 1, 2)

        for lane in self._lanes:
            cv2.polylines(picture, [drawn(lane)], False, ROAD, 6, cv2.LINE_AA)
        if driver.plan is not None:
            cv2.polylines(picture, [drawn(driver.plan.course.path.points_m)], False, PLAN, 2, cv2.LINE_AA)
        goal = drawn(self._goal_m)[0, 0]
        cv2.circle(picture, (int(goal[0]), int(goal[1])), 5, GOAL, -1, cv2.LINE_AA)
        for pose in sensed.traffic:
            _box(picture, drawn, np.asarray(pose[:3], dtype=np.float64), OTHER, (-2.2, 2.2))
        _box(picture, drawn, np.array(truth.pose_m), EGO, (-0.9, 3.6))
        if driver.track is not None:
            cv2.polylines(picture, [drawn(_ellipse_m(driver.track.pose, driver.track.covariance))], True, BELIEF, 2, cv2.LINE_AA)
        state = f"{truth.t_s:5.1f} s  {3.6 * truth.speed_mps:3.0f} km/h"
        cv2.putText(picture, state, (6, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (20, 20, 20), 1, cv2.LINE_AA)
        return picture


def _coloured(frame: Frame) -> Frame:
    return frame if frame.ndim == 3 else np.repeat(frame[:, :, None], 3, axis=2)


def _ellipse_m(pose: FloatArray, covariance: FloatArray) -> FloatArray:
    """Points (24, 2) of the ellipse of ``SIGMAS`` standard deviations about a pose."""
    values, vectors = np.linalg.eigh(covariance[:2, :2])
    angle = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
    axes = SIGMAS * np.sqrt(np.maximum(values, 0.01))
    ring: FloatArray = pose[:2] + (vectors @ (axes[:, None] * np.stack([np.cos(angle), np.sin(angle)]))).T
    return ring


def _box(picture: Frame, drawn: Any, pose: FloatArray, colour: tuple[int, int, int], reach_m: tuple[float, float]) -> None:
    """A vehicle: from ``reach_m[0]`` to ``reach_m[1]`` along its heading, 1.8 m wide."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    corners = np.array([(x, y) for x, y in ((reach_m[0], 0.9), (reach_m[1], 0.9), (reach_m[1], -0.9), (reach_m[0], -0.9))])
    around = pose[:2] + np.stack([cos * corners[:, 0] - sin * corners[:, 1], sin * corners[:, 0] + cos * corners[:, 1]], axis=1)
    cv2.fillPoly(picture, [drawn(around)], colour, cv2.LINE_AA)
