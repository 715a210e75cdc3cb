"""The town from above around the ego, north up, as a picture for people."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import cv2
import numpy as np
import shapely

from hippodrome.core.types import FloatArray, Frame, IntArray
from hippodrome.sim.loop.car import WIDTH_M
from hippodrome.sim.loop.contact import EGO_SIZE_M, corners_m, ego_box
from hippodrome.sim.types import Town

REACH_M: Final = 60.0  # from the ego to the picture's edge: the next junction of most streets
PICTURE_PX: Final = 480
SHIFT: Final = 4  # cv2 draws with fractions of a sixteenth of a pixel
LAND, ASPHALT, EDGE = (112, 130, 92), (104, 104, 108), (222, 222, 216)
EGO_RGB, OTHER_RGB, GLASS_RGB = (230, 92, 30), (70, 110, 190), (35, 40, 48)
LAMP_RGB: Final[Mapping[str, tuple[int, int, int]]] = {
    "r": (225, 30, 30), "R": (225, 30, 30), "u": (235, 120, 30), "y": (245, 200, 40), "Y": (245, 200, 40),
    "g": (40, 190, 80), "G": (40, 190, 80),
}  # fmt: skip


class TopView:
    """Draws what is within reach. Frames of other makers may be drawn over it: ``pixels`` says where a place is."""

    def __init__(self, town: Town, size_px: int = PICTURE_PX, reach_m: float = REACH_M) -> None:
        self.size_px, self.reach_m = size_px, reach_m
        network = town.network
        lanes = [shapely.LineString(network.lane_points_m(lane)) for lane in range(network.lane_count)]
        strips = shapely.buffer(np.array(lanes, dtype=object), 0.5 * network.width_m, cap_style="flat")
        outlines = [shapely.Polygon(o) for o in (*town.junction_polygons_m, *town.turning_places_m)]
        self._areas = np.concatenate([strips, shapely.make_valid(np.array(outlines, dtype=object))])
        self._tree = shapely.STRtree(self._areas)
        self._roads = len(strips)
        self._internal = network.is_internal

    def draw(
        self,
        pose_m: tuple[float, float, float],
        poses_m: FloatArray,
        sizes_m: FloatArray,
        lamps: Mapping[tuple[float, float, float], str] | None = None,
    ) -> Frame:
        """A picture (size, size, 3) around the ego.

        Args:
            pose_m: of the ego's rear axle.
            poses_m: of the other vehicles' middles (k, 3 or more).
            sizes_m: their lengths and widths (k, 2 or more).
            lamps: SUMO's letters of signals by x, y and width of the stop line that they guard.
        """
        image = np.full((self.size_px, self.size_px, 3), LAND, dtype=np.uint8)
        x, y, _ = pose_m
        seen = self._tree.query(shapely.box(x - self.reach_m, y - self.reach_m, x + self.reach_m, y + self.reach_m))
        for area in np.sort(seen):
            for part in shapely.get_parts(self._areas[area]):
                if part.geom_type == "Polygon":
                    outline = [self.pixels(pose_m, shapely.get_coordinates(part.exterior))]
                    cv2.fillPoly(image, outline, ASPHALT, cv2.LINE_AA, SHIFT)
                    if area < self._roads and not self._internal[area]:
                        cv2.polylines(image, outline, True, EDGE, 1, cv2.LINE_AA, SHIFT)
        for (lamp_x, lamp_y, width), letter in (lamps or {}).items():
            at = self.pixels(pose_m, np.array([[lamp_x, lamp_y]]))[0].tolist()
            radius = max(int(0.35 * width * self._px_per_m() * (1 << SHIFT)), 1 << SHIFT)
            cv2.circle(image, at, radius, LAMP_RGB.get(letter, EDGE), -1, cv2.LINE_AA, SHIFT)
        for outline in corners_m(poses_m[:, :3], sizes_m):
            self._car(image, pose_m, outline, OTHER_RGB)
        self._car(image, pose_m, corners_m(ego_box(pose_m), EGO_SIZE_M)[0], EGO_RGB)
        return image

    def pixels(self, pose_m: tuple[float, float, float], points_m: FloatArray) -> IntArray:
        """Where places (n, 2) lie in the picture around a pose, in sixteenths of a pixel, as cv2 wants them with ``SHIFT``."""
        local = (points_m - [pose_m[0], pose_m[1]]) * [1.0, -1.0] * self._px_per_m() + 0.5 * self.size_px
        return np.clip(np.rint(local * (1 << SHIFT)), -(1 << 24), 1 << 24).astype(np.int32)

    def _px_per_m(self) -> float:
        return self.size_px / (2.0 * self.reach_m)

    def _car(self, image: Frame, pose_m: tuple[float, float, float], outline_m: FloatArray, rgb: tuple[int, int, int]) -> None:
        """A box with a windscreen, so that one sees where it heads."""
        cv2.fillPoly(image, [self.pixels(pose_m, outline_m)], rgb, cv2.LINE_AA, SHIFT)
        front_left, front_right, rear_right, rear_left = outline_m
        length = max(math.dist(front_left, rear_left), 0.1)
        near, far = min(0.9 / length, 0.4), min((0.9 + 0.5 * WIDTH_M) / length, 0.6)
        glass = [
            front_left + near * (rear_left - front_left), front_right + near * (rear_right - front_right),
            front_right + far * (rear_right - front_right), front_left + far * (rear_left - front_left),
        ]  # fmt: skip
        cv2.fillPoly(image, [self.pixels(pose_m, np.array(glass))], GLASS_RGB, cv2.LINE_AA, SHIFT)


def beside(left: Frame, right: Frame) -> Frame:
    """Two pictures side by side, the left one enlarged by whole pixels to about the right one's height."""
    scale = max(right.shape[0] // left.shape[0], 1)
    large = left.repeat(scale, axis=0).repeat(scale, axis=1)
    height = max(large.shape[0], right.shape[0])
    parts = [np.pad(one, ((0, height - one.shape[0]), (0, 0), (0, 0))) for one in (large, right)]
    return np.concatenate(parts, axis=1)
