"""Backing and turning round: for how long a manoeuvre lasts, and how others let it be finished."""

from __future__ import annotations

import math
from typing import Final

import libsumo
import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.sim.loop.car import WIDTH_M
from hippodrome.sim.loop.contact import EGO_SIZE_M, corners_m, ego_box
from hippodrome.sim.loop.radar import outline_m
from hippodrome.sim.loop.users import Users

OVER_M: Final = 10.0  # driven forwards since the reverse gear was in: then the manoeuvre is over
ROLLS_MPS: Final = 0.05  # a gear is in once the car rolls no more
WATCHED_M: Final = 40.0  # others farther away from the ego see it in time, or need not care
KEPT_M: Final = 2.0  # they stop so far from its body
BRAKING_MPS2: Final = 3.0  # and brake so hard for it
BAND_M: Final = 0.5 * WIDTH_M + 0.3  # half of what a vehicle sweeps


class Manoeuvre:
    """From the moment at which the reverse gear is in, until ``OVER_M`` have been driven forwards since."""

    def __init__(self) -> None:
        self._forwards_m = math.inf
        self.backed_m = 0.0  # backwards, in this manoeuvre

    @property
    def is_under_way(self) -> bool:
        return self._forwards_m < OVER_M

    def go_on(self, travelled_m: float, speed_mps: float, reverse: bool) -> None:
        """Notes a step of so many metres, backwards negative, with a gear in hand."""
        if reverse and speed_mps < ROLLS_MPS:
            self._forwards_m, self.backed_m = 0.0, self.backed_m + max(-travelled_m, 0.0)
            return
        self._forwards_m += max(travelled_m, 0.0)
        if not self.is_under_way:
            self.backed_m = 0.0


class Courtesy:
    """Who comes to a car that turns round stops for it, though SUMO has it on one lane alone."""

    def __init__(self) -> None:
        self._held: set[str] = set()

    def look(self, pose_m: tuple[float, float, float], users: Users, under_way: bool) -> None:
        """Holds the speed of those that would run into the ego's body, and lets go of those that would not any more."""
        if not under_way and not self._held:
            return
        held = set()
        if under_way and len(users.names):
            body = outline_m(corners_m(ego_box(pose_m), EGO_SIZE_M))[0]
            for row, name in enumerate(users.names):
                gap_m = _gap_m(body, users.poses_m[row], float(users.sizes_m[row, 0]))
                most = math.sqrt(2.0 * BRAKING_MPS2 * max(gap_m - KEPT_M, 0.0))
                if gap_m < WATCHED_M and most < users.speed_mps[row] + BRAKING_MPS2:
                    held.add(name)
                    libsumo.vehicle.setSpeed(name, min(float(users.speed_mps[row]) + 0.2, most))
        for name in sorted((self._held - held) & set(users.names)):
            libsumo.vehicle.setSpeed(name, -1.0)  # SUMO's word for: as it likes
        self._held = held


def _gap_m(body_m: FloatArray, pose_m: FloatArray, length_m: float) -> float:
    """From a vehicle's front bumper straight on to points (n, 2) of a body; infinite where none lies in its band."""
    cos, sin = math.cos(float(pose_m[2])), math.sin(float(pose_m[2]))
    apart = body_m - pose_m[:2]
    along, aside = cos * apart[:, 0] + sin * apart[:, 1], cos * apart[:, 1] - sin * apart[:, 0]
    inside = (np.abs(aside) < BAND_M) & (along > 0.0)
    return max(float(along[inside].min()) - 0.5 * length_m, 0.0) if inside.any() else math.inf
