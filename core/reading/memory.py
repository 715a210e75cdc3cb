"""The lane's borders where they have been driven past: they lie below and behind the camera now, where the rear axle is."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from hippodrome.core.reading.ground import Ground
from hippodrome.core.types import FloatArray

BEHIND_M: Final = 6.0  # of the rear axle, as far as borders are kept: the gap between two dashes
AHEAD_M: Final = 9.0  # nothing farther than this gets out of sight from one frame to the next
MOST: Final = 240  # ridges kept
DRIFT: Final = 0.04  # growth of the error per metre moved, as metres per pixel of a ridge: 1.2 cm
TOLD_M: Final = 6.0  # over which the belief in what a line was taken for fades
SAME_M: Final = 1.2  # by which a mouth seems to move at most from one frame to the next
PASSED_M: Final = 2.0  # behind a mouth, the ends of other lines are not yet those of the next lane
EMPTY: Final = np.zeros((0, 5))


class Memory:
    """Ridges of the two borders of the lane, and what kind of line each of them is."""

    def __init__(self) -> None:
        self.ridges: FloatArray = EMPTY  # (M, 5) as ``find_ridges`` gives them, of row -1
        self.trust: FloatArray = np.zeros(0)  # (M,)
        self.mouth_m = math.nan  # distance ahead of the rear axle of the mouth that was told last
        self.told_m = 0.0  # how far the vehicle has come while its way was told
        self.edges: dict[int, float] = {}  # side (1 left, -1 right) -> log odds that the border is the road's edge

    def forget(self) -> None:
        """As if nothing had been seen."""
        self.ridges, self.trust, self.edges = EMPTY, np.zeros(0), {}
        self.told_m, self.mouth_m = 0.0, math.nan

    def move(self, moved_m: float, turned_rad: float) -> None:
        """Into the axes of the vehicle after a step; one that is not known makes all forgotten."""
        if not (math.isfinite(moved_m) and math.isfinite(turned_rad)):
            self.forget()
            return
        self.told_m += abs(moved_m)
        self.mouth_m = self.mouth_m - moved_m if self.mouth_m - moved_m > -PASSED_M else math.nan
        fades = math.exp(-abs(moved_m) / TOLD_M)
        self.edges = {side: fades * odds for side, odds in self.edges.items()}
        cos, sin = math.cos(turned_rad), math.sin(turned_rad)
        x = self.ridges[:, 0] - moved_m * math.cos(0.5 * turned_rad)
        y = self.ridges[:, 1] - moved_m * math.sin(0.5 * turned_rad)
        moved = self.ridges.copy()
        moved[:, 0], moved[:, 1] = cos * x + sin * y, cos * y - sin * x
        moved[:, 2] += DRIFT * abs(moved_m)
        near = moved[:, 0] > -BEHIND_M
        self.ridges, self.trust = moved[near], self.trust[near]

    def out_of_sight(self, ground: Ground, forward_m: float) -> None:
        """Drop what the frame shows anew."""
        x, y = self.ridges[:, 0], self.ridges[:, 1]
        nearest = float(ground.x_m[0].mean())
        scale = (x - forward_m) / (nearest - forward_m)
        seen = (x > nearest) & (y < scale * ground.y_m[0, 0]) & (y > scale * ground.y_m[0, -1])
        self.ridges, self.trust = self.ridges[~seen], self.trust[~seen]

    def is_next(self, mouth_m: float) -> bool:
        """Whether a mouth is the one that was told before, or there is none such; it is remembered."""
        if mouth_m > self.mouth_m + SAME_M:
            return False
        self.mouth_m = mouth_m
        return True

    def keep(self, ridges: FloatArray, trust: FloatArray) -> None:
        """Remember the ridges (N, 5) of the lane's borders, those seen before among them."""
        near = np.flatnonzero(ridges[:, 0] < AHEAD_M)[:MOST]
        self.ridges, self.trust = ridges[near].copy(), trust[near].copy()
        self.ridges[:, 4] = -1.0
