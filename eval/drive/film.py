"""The film of a mission: the camera beside the town from above, with plan, belief and vehicle.

Below them stand what the driver says, and the localizer's networks.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any, Final

import cv2
import numpy as np
from PIL import Image

from hippodrome._files import replacing
from hippodrome._folders import temporary_folder
from hippodrome.core.navigation.types import Command
from hippodrome.core.types import FloatArray, Frame, HippodromeError, LocalizationEstimate
from hippodrome.eval.drive.brain import PAPER, grid_sheet, head_ring
from hippodrome.eval.drive.drivers import Driver
from hippodrome.eval.drive.missions import Mission, pose_of
from hippodrome.sim.loop.types import Sensed, Truth
from hippodrome.sim.loop.world import World

KINDS: Final = ("webp", "mp4")
EVERY_STEPS: Final = 4  # steps of the loop between two pictures
SHOWN_MS: Final = 100  # of a picture: four times as fast as the drive
MOST: Final = 1500  # pictures; ten minutes of driving
SIZE: Final = (320, 240)  # of each half, in pixels
VIEW_M: Final = 120.0  # across the view from above
ROAD, PLAN, BELIEF, EGO, OTHER, GOAL = (
    (205, 205, 205), (40, 110, 200), (230, 120, 40), (200, 30, 30), (90, 90, 90), (30, 140, 60)
)  # fmt: skip
SIGMAS: Final = 2.0  # of the belief's ellipse
STRIP_PX, TILE_PX, GAP_PX = 128, 108, 8  # the strip below, and the pictures of the networks in it
MOST_SHEETS: Final = 3  # modules of grid cells that are shown
FONT, INK = cv2.FONT_HERSHEY_SIMPLEX, (20, 20, 20)
LINE_LETTERS: Final = 32  # of the strip's words
QUALITY: Final = 60


class Film:
    """Collects pictures while a mission is driven; ``look`` is called at each step."""

    def __init__(self, world: World, mission: Mission) -> None:
        self._network = world.network
        self._lanes = [world.network.lane_points_m(k) for k in range(world.network.lane_count)]
        self._goal_m = np.array(pose_of(world.network, mission.goal_lane, mission.goal_m)[:2])
        self._pictures: list[Frame] = []
        self._camera: Frame = np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8)
        self._steps = 0

    def look(self, sensed: Sensed, driver: Driver, command: Command) -> None:
        """Take a step in; every few of them make a picture."""
        if sensed.observation.frame is not None:
            shown = cv2.resize(_coloured(sensed.observation.frame), SIZE, interpolation=cv2.INTER_NEAREST)
            self._camera = np.asarray(shown, dtype=np.uint8)
        if self._steps % EVERY_STEPS == 0 and len(self._pictures) < MOST:
            above = np.hstack([self._camera, self._from_above(sensed, driver)])
            self._pictures.append(np.vstack([above, _strip(driver.estimate, command, sensed.truth)]))
        self._steps += 1

    def write(self, file: Path) -> None:
        """Write the film: an animated WebP, or by the name of the file an MP4. Raises HippodromeError if it cannot be encoded."""
        with replacing(file) as temporary:
            if file.suffix == ".mp4":
                _write_mp4(temporary, self._pictures)
                return
            with temporary.open("wb") as stream:
                first, *others = (Image.fromarray(picture) for picture in self._pictures)
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
        return picture


def _strip(estimate: LocalizationEstimate | None, command: Command, truth: Truth) -> Frame:
    """What the driver says, the ring of head-direction cells, and the sheets of grid cells, as far as there are any."""
    strip = np.full((STRIP_PX, 2 * SIZE[0], 3), PAPER, dtype=np.uint8)
    words = [
        f"{truth.t_s:.0f} s   {3.6 * truth.speed_mps:.0f} km/h",
        command.state.name.lower(),
        *wrap(command.reason, LINE_LETTERS),
    ]
    for line, text in enumerate(words[:5]):
        place = GAP_PX, 20 + 20 * line
        cv2.putText(strip, text, place, FONT, 0.45 if line < 2 else 0.38, INK, 1, cv2.LINE_AA)
    right = strip.shape[1]
    for name, tile in reversed(_networks(estimate)):
        right -= TILE_PX + GAP_PX
        strip[GAP_PX // 2 : GAP_PX // 2 + TILE_PX, right : right + TILE_PX] = tile
        cv2.putText(strip, name, (right, STRIP_PX - 4), FONT, 0.34, INK, 1, cv2.LINE_AA)
    return strip


def _networks(estimate: LocalizationEstimate | None) -> list[tuple[str, Frame]]:
    """Names and pictures of the localizer's networks; none where there is no localizer, or its pose is given."""
    if estimate is None or not len(estimate.grid_phase_rad):
        return []
    heading = float(estimate.pose[2]) if estimate.localized else None
    tiles = [("heading", head_ring(estimate.head_direction_rad, estimate.head_reliability, heading, TILE_PX))]
    modules = zip(estimate.grid_phase_rad, estimate.grid_reliability, strict=True)
    sheets = [(f"grid module {k + 1}", grid_sheet(*one, TILE_PX)) for k, one in enumerate(modules)]
    return [*tiles, *sheets[:MOST_SHEETS]]


def _write_mp4(file: Path, pictures: Sequence[Frame]) -> None:
    """Write the film. OpenCV does not tell of a full disk, and goes by the name: its file lies in a temporary folder, is counted,
    and copied. Raises HippodromeError where it is not whole."""
    height, width = pictures[0].shape[:2]
    with temporary_folder() as folder:
        made = folder / "film.mp4"
        writer = cv2.VideoWriter(str(made), cv2.VideoWriter.fourcc(*"mp4v"), 1000.0 / SHOWN_MS, (width, height))
        try:
            if not writer.isOpened():
                raise HippodromeError(f"{file}: this OpenCV writes no MP4; use --film webp")
            for picture in pictures:
                writer.write(np.ascontiguousarray(picture[:, :, ::-1]))
        finally:
            writer.release()
        if (count := _pictures_in(made)) != len(pictures):
            raise HippodromeError(
                f"{folder}: {count} of {len(pictures)} pictures of an MP4 were written; free some space there, or set TMPDIR"
            )
        shutil.copyfile(made, file)


def _pictures_in(film: Path) -> int:
    """How many pictures a film says that it has; 0 for one that cannot be read."""
    reader = cv2.VideoCapture(str(film))
    try:
        return int(reader.get(cv2.CAP_PROP_FRAME_COUNT)) if reader.isOpened() else 0
    finally:
        reader.release()


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
