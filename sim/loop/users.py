"""The other road users near the ego, as SUMO has them after a step."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Final

import libsumo
import numpy as np

from hippodrome.core.types import FloatArray, IntArray, UInt8Array
from hippodrome.sim.sumo_run import EGO, SIGHT_M
from hippodrome.sim.traffic import VEHICLE_SIZES_M

GUESTS_FROM: Final = 1_000_000  # numbers of vehicles that the background traffic did not send


@dataclass(frozen=True, slots=True, eq=False)
class Users:
    """k vehicles within sight of the ego."""

    names: tuple[str, ...]
    ids: IntArray  # (k,) stable over time
    kinds: UInt8Array  # (k,)
    poses_m: FloatArray  # (k, 3) of the centres, (k, 5) with height and pitch where roads climb
    speed_mps: FloatArray  # (k,)

    @property
    def sizes_m(self) -> FloatArray:
        """Length, width, height (k, 3)."""
        return VEHICLE_SIZES_M[self.kinds]


class Onlooker:
    """Reads SUMO's vehicles; remembers what never changes of each."""

    def __init__(self, in_space: bool) -> None:
        self._in_space = in_space
        self._kinds: dict[str, int] = {}
        self._numbers: dict[str, int] = {}

    def near(self, x_m: float, y_m: float) -> Users:
        """All vehicles but the ego within ``SIGHT_M`` of a point."""
        names, poses, speeds = [], [], []
        for name in libsumo.vehicle.getIDList():
            x, y = libsumo.vehicle.getPosition(name)
            if name == EGO or (x - x_m) ** 2 + (y - y_m) ** 2 > SIGHT_M**2:
                continue
            half = 0.5 * float(VEHICLE_SIZES_M[self._kind(name), 0])
            heading = math.remainder(math.radians(90.0 - libsumo.vehicle.getAngle(name)), math.tau)
            names.append(name)
            poses.append((x - half * math.cos(heading), y - half * math.sin(heading), heading, *self._height(name, half)))
            speeds.append(libsumo.vehicle.getSpeed(name))
        return Users(
            names=tuple(names),
            ids=np.array([self._number(name) for name in names], dtype=np.int32),
            kinds=np.array([self._kind(name) for name in names], dtype=np.uint8),
            poses_m=np.array(poses, dtype=np.float64).reshape(-1, 5 if self._in_space else 3),
            speed_mps=np.array(speeds, dtype=np.float64),
        )

    def _kind(self, name: str) -> int:
        if name not in self._kinds:
            found = re.fullmatch(r"kind(\d+)(@.*)?", libsumo.vehicle.getTypeID(name))
            self._kinds[name] = int(found[1]) if found else 0
        return self._kinds[name]

    def _number(self, name: str) -> int:
        if name not in self._numbers:
            own = re.fullmatch(r"b(\d{1,6})", name)
            self._numbers[name] = int(own[1]) if own else GUESTS_FROM + len(self._numbers)
        return self._numbers[name]

    def _height(self, name: str, half_m: float) -> tuple[float, ...]:
        if not self._in_space:
            return ()
        pitch_rad = math.radians(libsumo.vehicle.getSlope(name))
        return libsumo.vehicle.getPosition3D(name)[2] - half_m * math.sin(pitch_rad), pitch_rad
