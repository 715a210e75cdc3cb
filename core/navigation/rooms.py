"""How much room there is about the vehicle, up to the rim of the paving that the network knows or of the ground that was seen."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from hippodrome.core.navigation.border import CELL_M, OTHER, SPECK, UNKNOWN
from hippodrome.core.navigation.sight import Ground
from hippodrome.core.roads.geometry import RoadGeometry, project
from hippodrome.core.types import FloatArray

REACH_M: Final = 14.0  # of the map of room, from the vehicle to each side
FINE_M: Final = 0.2  # and its cells
LANES_M: Final = 6.0  # farther from every lane's middle there is no road
OUTSIDE_M: Final = -4.0  # said of what lies beyond the map
BODY_AHEAD_M: Final = (-1.2, 4.0)  # what the vehicle stands on is road, whatever was seen of it
BODY_ASIDE_M: Final = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class RoomMap:
    """Distances from the nearest border, negative beyond it, in square cells.

    Args:
        metres: (n, m) at the middles of the cells.
        corner_m: (2,) where the first cell begins.
        cell_m: size of a cell.
    """

    metres: FloatArray
    corner_m: FloatArray
    cell_m: float

    def __call__(self, points_m: FloatArray) -> FloatArray:
        """The room (n,) at points (n, 2), linear between the cells' middles; far beyond any border outside of the map."""
        at = (points_m - self.corner_m) / self.cell_m - 0.5
        cell = np.floor(at).astype(np.int64)
        size = np.array(self.metres.shape) - 1
        inside = np.all((cell >= 0) & (cell < size), axis=1)
        i, j = np.clip(cell, 0, size - 1).T
        p, q = (at - np.floor(at)).T
        low = (1.0 - q) * self.metres[i, j] + q * self.metres[i, j + 1]
        high = (1.0 - q) * self.metres[i + 1, j] + q * self.metres[i + 1, j + 1]
        return np.where(inside, (1.0 - p) * low + p * high, OUTSIDE_M)

    def points_m(self) -> FloatArray:
        """The middles (n, m, 2) of the cells."""
        axes = (self.corner_m[k] + self.cell_m * (np.arange(self.metres.shape[k]) + 0.5) for k in (0, 1))
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=2)


def room_on_roads(roads: RoadGeometry, pose: FloatArray) -> RoomMap:
    """Room on the paving about a pose: inside of the strip of any lane, also within junctions."""
    count = round(2.0 * REACH_M / FINE_M)
    empty = RoomMap(np.zeros((count, count)), pose[:2] - REACH_M, FINE_M)
    near = project(roads, empty.points_m().reshape(-1, 2), LANES_M)
    beside = np.full(count * count, OUTSIDE_M)
    np.maximum.at(beside, near.point, 0.5 * roads.network.width_m[near.lane] - near.distance_m)
    paved = cv2.morphologyEx((beside.reshape(count, count) > 0.0).astype(np.uint8), cv2.MORPH_CLOSE, SPECK)  # seams of lanes
    inward, outward = (cv2.distanceTransform(part, cv2.DIST_L2, 5) for part in (paved, 1 - paved))
    metres = FINE_M * np.where(paved > 0, inward - 0.5, 0.5 - outward).astype(np.float64)
    return RoomMap(metres, empty.corner_m, FINE_M)


def room_on_seen_ground(ground: Ground) -> RoomMap:
    """Room on the ground that was seen to be road, in the axes of the ground's map; what was not seen is a border."""
    cells, corner_m = ground.around(REACH_M)
    other = cv2.morphologyEx((cells == OTHER).astype(np.uint8), cv2.MORPH_OPEN, SPECK)
    known = cv2.morphologyEx((cells != UNKNOWN).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), dtype=np.uint8))
    road = ((other == 0) & (known > 0)).astype(np.uint8)
    found = RoomMap(np.zeros(cells.shape), corner_m, CELL_M)
    apart = found.points_m() - ground.pose[:2]
    cos, sin = math.cos(ground.pose[2]), math.sin(ground.pose[2])
    ahead, aside = cos * apart[..., 0] + sin * apart[..., 1], cos * apart[..., 1] - sin * apart[..., 0]
    road[(ahead > BODY_AHEAD_M[0]) & (ahead < BODY_AHEAD_M[1]) & (np.abs(aside) < BODY_ASIDE_M)] = 1
    inward, outward = (cv2.distanceTransform(part, cv2.DIST_L2, 5) for part in (road, 1 - road))
    metres = CELL_M * np.where(road > 0, inward - 0.5, 0.5 - outward).astype(np.float64)
    return RoomMap(metres, corner_m, CELL_M)


def before_obstacle(room: RoomMap, pose: FloatArray, ahead_m: float) -> RoomMap:
    """The same where the street is barred so far ahead of a pose's rear axle."""
    apart = room.points_m() - pose[:2]
    along = math.cos(pose[2]) * apart[..., 0] + math.sin(pose[2]) * apart[..., 1]
    return RoomMap(np.minimum(room.metres, ahead_m - along), room.corner_m, room.cell_m)
