"""Driving on sight: what of the ground is road, kept around the vehicle as it moves, and the way along the near border of it.

A driver who does not know the place keeps to the border on the own side of the road: along the street it is the edge line, at a
junction it leads round the corner into the next street. So the vehicle keeps to its lane, never meets oncoming traffic, and comes
round the block. The border lies below the camera's view where the vehicle is beside it, hence a map of the ground around the
vehicle, built from the frames and moved with dead reckoning (an occupancy grid: Elfes, "Using occupancy grids for mobile robot
perception and navigation", Computer 22, 1989).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.navigation import sweep
from hippodrome.core.navigation.asphalt import followed, hidden, kinds_of
from hippodrome.core.navigation.border import (
    CELL_M,
    OTHER,
    REACH_M,
    ROAD,
    STEP_M,
    UNKNOWN,
    along_border,
    room_fields,
    seen_ground,
)
from hippodrome.core.navigation.rounding import bends_of, rounded
from hippodrome.core.navigation.sweep import drivable
from hippodrome.core.types import FloatArray, Frame, UInt8Array
from hippodrome.core.views.config import CameraGeometry

CELLS = 400  # along each side: 80 m, in which the vehicle is kept 20 m away from the rim
SHIFT_M = 20.0
FAR_M = 12.0  # a pixel farther away spans more than a metre
VIEW_SHARE = 0.9  # of the camera's view to either side, beyond which the ground may be seen, or not
SIGHTS, HIDING = 40, 3  # places on a line of sight; so many of them that are no road hide what lies beyond
PATCH_M = (5.5, 0.9)  # the asphalt right ahead: so far ahead of the rear axle and to either side

FITS_SHARE = 0.1  # of a path that may seem to be no road: its cells are as coarse as that
SHIFT_STEP_M = 0.5

NEAR_M = 0.5  # ahead of the rear axle, where the distance to the paint is measured
AROUND_M = 16.0  # on each side of the vehicle the way is looked for
BEGINS_M, BORDER_M = 1.0, (1.5, 2.3)  # who has not driven farther has the border of a lane of 3.2 m that far aside
STANDING_BENDS_1PM = tuple(0.08 * k for k in range(-4, 5))  # what a car that stands can turn its wheels to
STANDS_ON_M = (-1.5, 3.9, 1.3)  # what the car stands on at the start is road: from behind to ahead, and to either side
THICK_PX = 4  # beyond so many more pixels of no road, even that is not sure to be where it seems: hedges and walls stand up


@dataclass(frozen=True, slots=True, eq=False)
class GroundView:
    """Where the pixels of frames of one size meet the ground, in the vehicle's axes (rear axle, x forward, y left)."""

    rows: slice
    ahead_m: FloatArray  # (h, w)
    left_m: FloatArray  # (h, w)


def ground_view(camera: CameraGeometry, width_px: int, height_px: int) -> GroundView:
    """The ground that a level camera sees up to ``FAR_M``."""
    focal = camera.focal_px(width_px)
    first = math.ceil(0.5 * (height_px - 1) + focal * camera.height_m / FAR_M)
    below = np.arange(first, height_px) - 0.5 * (height_px - 1)
    depth = focal * camera.height_m / np.maximum(below, 1e-3)
    across = (np.arange(width_px) - 0.5 * (width_px - 1)) / focal
    ahead = np.repeat(depth[:, None], width_px, axis=1) + camera.forward_m
    return GroundView(slice(first, height_px), ahead, -depth[:, None] * across[None, :])


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """The way along the border from where the vehicle is: (n,) samples ``STEP_M`` apart, in the axes of the ground's map."""

    curvature_1pm: FloatArray
    heading_rad: FloatArray
    seen: FloatArray  # 1 where the border was found beside the sample, 0 where it was not
    free_m: float  # length of the way up to something that is no road
    seen_m: float  # length of the way up to ground that has not been seen yet


class Ground:
    """The ground around the vehicle. Its axes are those of dead reckoning from where it began."""

    def __init__(self, camera: CameraGeometry) -> None:
        self._camera = camera
        self._view: GroundView | None = None
        self._cells: UInt8Array = np.zeros((CELLS, CELLS), dtype=np.uint8)
        self._origin_m = np.array([-0.5 * CELLS * CELL_M, -0.5 * CELLS * CELL_M])
        self._level = math.nan
        self._has_border = False
        self.pose = np.zeros(3)  # of the rear axle

    def move(self, distance_m: float, turned_rad: float) -> None:
        """Dead reckoning by a short arc."""
        chord = self.pose[2] + 0.5 * turned_rad
        step = np.array([distance_m * math.cos(chord), distance_m * math.sin(chord), turned_rad])
        self.pose = self.pose + step
        aside = (self.pose[:2] - self._origin_m) / (CELLS * CELL_M) - 0.5
        for axis in (0, 1):
            if abs(aside[axis]) * CELLS * CELL_M > SHIFT_M:
                self._shift(axis, int(math.copysign(SHIFT_M / CELL_M, aside[axis])))

    def _shift(self, axis: int, cells: int) -> None:
        rolled = np.roll(self._cells, -cells, axis=axis)
        new = [slice(None), slice(None)]
        new[axis] = slice(CELLS - cells, None) if cells > 0 else slice(0, -cells)
        rolled[tuple(new)] = UNKNOWN
        self._cells = rolled
        self._origin_m = self._origin_m.copy()
        self._origin_m[axis] += cells * CELL_M

    def see(self, frame: Frame, gap_m: float, on_road: bool = True) -> None:
        """Enter a frame; what lies beyond the next vehicle ahead, ``gap_m`` from the bumper, is hidden.

        Of a vehicle that is not ``on_road`` with all of it, what lies ahead may be no asphalt, and its level is not followed.
        """
        if self._view is None or self._view.ahead_m.shape[1] != frame.shape[1]:
            self._view = ground_view(self._camera, frame.shape[1], frame.shape[0])
            self._stand()
        view = self._view
        part = frame[view.rows].astype(np.float32)
        level = part.mean(axis=2) if part.ndim == 3 else part
        colour = (part.max(axis=2) - part.min(axis=2)) / np.maximum(level, 1.0) if part.ndim == 3 else np.zeros_like(level)
        patch = (view.ahead_m < PATCH_M[0]) & (np.abs(view.left_m) < PATCH_M[1])
        if on_road or math.isnan(self._level):
            self._level = followed(self._level, level, colour, patch)
        kind = kinds_of(level / max(self._level, 1.0), colour)
        behind = hidden(kind)
        kind[behind & (kind != OTHER)] = UNKNOWN
        kind[:-THICK_PX][behind[THICK_PX:]] = UNKNOWN
        reach = min(FAR_M + self._camera.forward_m, gap_m + 2.6)
        near = (view.ahead_m < reach) & (kind != UNKNOWN)
        _enter(self._cells, self._origin_m, self.pose, view.ahead_m[near], view.left_m[near], kind[near])

    def _stand(self) -> None:
        """Enter the ground below the car, which no frame has shown."""
        self._fill(-STANDS_ON_M[2], STANDS_ON_M[2], ROAD)

    def _begin_border(self, side: float) -> None:
        """Enter the border beside the car, which no frame has shown either: a search begins in the middle of a lane."""
        self._has_border = True
        if float(np.hypot(*self.pose[:2])) < BEGINS_M:
            near_m, far_m = side * BORDER_M[0], side * BORDER_M[1]
            self._fill(min(near_m, far_m), max(near_m, far_m), OTHER)

    def _fill(self, right_m: float, left_m: float, kind: int) -> None:
        """Say of a rectangle beside the car what it is."""
        x, y = (grid.ravel() for grid in np.meshgrid(np.arange(*STANDS_ON_M[:2], 0.1), np.arange(right_m, left_m, 0.1)))
        _enter(self._cells, self._origin_m, self.pose, x, y, np.full(len(x), kind, dtype=np.uint8))

    def way(
        self,
        bend_1pm: float,
        side: float,
        beside_m: float,
        straight_on: bool,
        length_m: float,
        need_m: float,
        stands: bool = False,
    ) -> Way:
        """The way that keeps about ``beside_m`` from the border on one side: +1 left, -1 right; it begins with a curvature.

        With ``straight_on`` it passes side streets on that side, and where the road ends it turns to the other side. ``need_m``
        is the room that the car must have on either side of its middle line. A car that ``stands`` may turn its wheels first.
        """
        if not self._has_border:
            self._begin_border(side)
        part, corner_m = self.around(AROUND_M)
        seen = seen_ground(part)
        field, room = room_fields(part)
        line = along_border(field, corner_m, self.pose, bend_1pm, side, beside_m, straight_on, int(length_m / STEP_M))
        plain = np.ascontiguousarray(line[:, :3])
        led = rounded(plain, bend_1pm, side, room, corner_m, CELL_M)
        bends = sorted(STANDING_BENDS_1PM, key=lambda one: abs(one - bend_1pm)) if stands else [bend_1pm]
        tried = [drivable(room, seen, corner_m, CELL_M, self.pose, one, led, need_m, side) for one in bends]
        rows = max(tried, key=len)
        free_m = sweep.STEP_M * len(rows) if len(rows) < sweep.STEPS else math.inf
        unseen = np.flatnonzero(rows[:, 3] > 0.0)
        seen_m = sweep.STEP_M * float(unseen[0]) if len(unseen) else math.inf
        fine = rows if len(rows) else np.array([[bend_1pm, self.pose[2], 0.0, 0.0]])
        fine = np.repeat(fine, int(sweep.STEP_M / STEP_M), axis=0)
        if led is not plain and not stands:  # a bend that keeps clear is driven as it is: the way found beside it begins late
            bent = bends_of(led, room, corner_m, CELL_M, need_m, len(fine))
            fine[: len(bent), :2] = bent
        return Way(fine[:, 0], fine[:, 1], line[:, 3], free_m, seen_m)

    def around(self, reach_m: float) -> tuple[UInt8Array, FloatArray]:
        """The cells within so many metres of the vehicle to each side, and the corner (2,) where they begin."""
        half = int(reach_m / CELL_M)
        middle = ((self.pose[:2] - self._origin_m) / CELL_M).astype(np.int64)
        low = np.clip(middle - half, 0, CELLS - 2 * half)
        part = np.ascontiguousarray(self._cells[low[0] : low[0] + 2 * half, low[1] : low[1] + 2 * half])
        return part, self._origin_m + CELL_M * low

    def border_m(self, side: float) -> float:
        """Distance from the vehicle's line of travel to the border on one side, just ahead of the rear axle; nan if unknown."""
        x, y = self.pose[0] + NEAR_M * math.cos(self.pose[2]), self.pose[1] + NEAR_M * math.sin(self.pose[2])
        found = float(_border_m(self._cells, self._origin_m, x, y, self.pose[2], side))
        return found if 0.0 <= found < REACH_M else math.nan

    def best_shift_m(self, points_m: FloatArray, most_m: float) -> tuple[float, float]:
        """By how much points (n, 2) in the vehicle's axes have to come nearer to lie on the road, and which share then does not.

        The least shift of at most ``most_m`` either way that is good enough counts; 0 if they lie on the road as they are.
        """
        share = self.off_road_share(points_m)
        if share <= FITS_SHARE:
            return 0.0, share
        best = (0.0, share)
        for k in range(1, int(most_m / SHIFT_STEP_M) + 1):
            for shift_m in (k * SHIFT_STEP_M, -k * SHIFT_STEP_M):
                share = self.off_road_share(points_m - np.array([shift_m, 0.0]))
                if share <= FITS_SHARE:
                    return shift_m, share
                if share < best[1] - 0.05:
                    best = shift_m, share
        return best

    def in_view(self, points_m: FloatArray) -> NDArray[np.bool_]:
        """Whether points (n, 2) in the vehicle's axes can be seen from here: nothing that is no road lies before them."""
        camera_m = np.array([self._camera.forward_m, 0.0])
        apart_m = points_m - camera_m
        shown = np.abs(apart_m[:, 1]) < VIEW_SHARE * math.tan(0.5 * math.radians(self._camera.fov_deg)) * apart_m[:, 0]
        sights = camera_m + np.linspace(0.0, 1.0, SIGHTS, endpoint=False)[:, None, None] * apart_m
        before = self.kinds_at(sights.reshape(-1, 2)).reshape(SIGHTS, -1)
        seen: NDArray[np.bool_] = shown & (np.sum(before == OTHER, axis=0) < HIDING)
        return seen

    def off_road_share(self, points_m: FloatArray) -> float:
        """Which share of points (n, 2) in the vehicle's axes is known to be no road, of those that are known."""
        kind = self.kinds_at(points_m)
        known = kind != UNKNOWN
        return float(np.mean(kind[known] == OTHER)) if known.any() else 0.0

    def kinds_at(self, points_m: FloatArray) -> UInt8Array:
        """What the ground is (n,) at points (n, 2) in the vehicle's axes: ``UNKNOWN``, ``ROAD``, ``OTHER`` or ``PAINT``."""
        cos, sin = math.cos(self.pose[2]), math.sin(self.pose[2])
        x = self.pose[0] + cos * points_m[:, 0] - sin * points_m[:, 1]
        y = self.pose[1] + sin * points_m[:, 0] + cos * points_m[:, 1]
        i = np.floor((x - self._origin_m[0]) / CELL_M).astype(np.int64)
        j = np.floor((y - self._origin_m[1]) / CELL_M).astype(np.int64)
        inside = (i >= 0) & (j >= 0) & (i < CELLS) & (j < CELLS)
        kind = np.full(len(points_m), UNKNOWN, dtype=np.uint8)
        kind[inside] = self._cells[i[inside], j[inside]]
        return kind


@njit(cache=True)
def _enter(
    cells: UInt8Array, origin: FloatArray, pose: FloatArray, ahead: FloatArray, left: FloatArray, kind: UInt8Array
) -> None:
    """Write pixels into the cells; of one frame, paint counts before all else, and what is no road before road."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    n = len(kind)
    index = np.empty((n, 2), dtype=np.int64)
    for k in range(n):
        x, y = pose[0] + cos * ahead[k] - sin * left[k], pose[1] + sin * ahead[k] + cos * left[k]
        i, j = math.floor((x - origin[0]) / CELL_M), math.floor((y - origin[1]) / CELL_M)
        index[k, 0], index[k, 1] = (i, j) if 0 <= i < CELLS and 0 <= j < CELLS else (-1, -1)
        if index[k, 0] >= 0:
            cells[i, j] = UNKNOWN
    for k in range(n):
        i, j = index[k]
        if i >= 0 and kind[k] > cells[i, j]:
            cells[i, j] = kind[k]


@njit(cache=True)
def _kind_at(cells: UInt8Array, origin: FloatArray, x: float, y: float) -> int:
    i, j = math.floor((x - origin[0]) / CELL_M), math.floor((y - origin[1]) / CELL_M)
    if i < 0 or j < 0 or i >= CELLS or j >= CELLS:
        return UNKNOWN
    return int(cells[i, j])


@njit(cache=True)
def _border_m(cells: UInt8Array, origin: FloatArray, x: float, y: float, heading: float, side: float) -> float:
    """Distance from a point to the border on one side; nan if none is known, -1 if the point itself is no road."""
    if _kind_at(cells, origin, x, y) >= OTHER:
        return -1.0
    unknown = 0
    for k in range(1, int(REACH_M / 0.1) + 1):
        far = 0.1 * k
        kind = _kind_at(cells, origin, x - side * far * math.sin(heading), y + side * far * math.cos(heading))
        if kind >= OTHER:
            return far if unknown < 10 else np.nan
        if kind == UNKNOWN:
            unknown += 1
    return REACH_M if unknown < 10 else np.nan
