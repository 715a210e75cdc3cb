"""What hypotheses of the place have in common: how far along a way ahead most of them have a lane.

A raster holds for each cell the directions of the lanes that pass by, as bits, so that poses are looked up and not searched.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.navigation.paving import grid_over
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.roads.paths import centreline
from hippodrome.core.types import FloatArray

Bits: TypeAlias = NDArray[np.uint32]
CELL_M: Final = 0.5
MOST_CELLS: Final = 1 << 23  # of the raster: a larger town has coarser cells
BESIDE_M, ASKEW_RAD = 0.75, 0.5  # a way has a lane where one is so near and of about its direction
DIRECTIONS: Final = 32
RIM_M: Final = 5.0
WAY_STEP_M: Final = 2.0  # between the poses of a way


@dataclass(frozen=True, slots=True, eq=False)
class LaneField:
    """For each cell (n, m), rows along x, a bit for each of ``DIRECTIONS`` that a lane there has, more or less."""

    bits: Bits
    corner_m: FloatArray  # (2,)
    cell_m: float

    def agreed(self, ways: FloatArray, poses: FloatArray) -> FloatArray:
        """Share (w, n) of the poses (k, 3) that have a lane along each of the ways (w, n, 3), in the vehicle's axes, so far."""
        shares: FloatArray = _agreed(self.bits, self.corner_m, self.cell_m, ways, poses)
        return shares


def lane_field(network: RoadNetwork) -> LaneField:
    """The raster of a network."""
    low, cell_m, shape = grid_over(network, RIM_M, CELL_M, MOST_CELLS)
    bits = np.zeros(shape, dtype=np.uint32)
    reach = math.ceil(BESIDE_M / cell_m)
    side = np.arange(-reach, reach + 1)
    around = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
    around = around[np.hypot(*around.T) * cell_m <= BESIDE_M + 0.25 * cell_m]
    lengths = network.lane_lengths_m()
    for lane in range(network.lane_count):
        at_m = np.linspace(0.0, lengths[lane], max(int(lengths[lane] / (0.5 * cell_m)), 1) + 1)
        points = centreline(network, lane, at_m)
        step = centreline(network, lane, np.minimum(at_m + 1.0, lengths[lane])) - centreline(
            network, lane, np.maximum(at_m - 1.0, 0.0)
        )
        mask = _directions(np.arctan2(step[:, 1], step[:, 0]))
        cells = np.floor((points - low) / cell_m).astype(np.int64)[:, None, :] + around[None, :, :]
        flat = cells.reshape(-1, 2)
        np.bitwise_or.at(bits, (flat[:, 0], flat[:, 1]), np.repeat(mask, len(around)))
    return LaneField(bits, low, cell_m)


def _directions(heading_rad: FloatArray) -> Bits:
    """The bits (n,) of all directions within ``ASKEW_RAD`` of headings (n,)."""
    middle = (np.arange(DIRECTIONS) + 0.5) * (2.0 * math.pi / DIRECTIONS)
    off = np.abs((heading_rad[:, None] - middle[None, :] + math.pi) % (2.0 * math.pi) - math.pi)
    bits: Bits = ((off < ASKEW_RAD).astype(np.uint32) << np.arange(DIRECTIONS, dtype=np.uint32)).sum(axis=1).astype(np.uint32)
    return bits


@njit(cache=True)
def _agreed(bits: Bits, corner: FloatArray, cell_m: float, ways: FloatArray, poses: FloatArray) -> FloatArray:
    share = np.zeros((ways.shape[0], ways.shape[1]))
    for w in range(ways.shape[0]):
        for k in range(len(poses)):
            cos, sin = math.cos(poses[k, 2]), math.sin(poses[k, 2])
            for i in range(ways.shape[1]):
                x = poses[k, 0] + cos * ways[w, i, 0] - sin * ways[w, i, 1] - corner[0]
                y = poses[k, 1] + sin * ways[w, i, 0] + cos * ways[w, i, 1] - corner[1]
                a, b = math.floor(x / cell_m), math.floor(y / cell_m)
                if a < 0 or b < 0 or a >= bits.shape[0] or b >= bits.shape[1]:
                    break
                turn = ((poses[k, 2] + ways[w, i, 2]) / (2.0 * math.pi)) % 1.0
                if not (bits[a, b] >> np.uint32(min(int(turn * DIRECTIONS), DIRECTIONS - 1))) & np.uint32(1):
                    break
                share[w, i] += 1.0 / len(poses)
    return share


def agreed_m(share: FloatArray, enough: float) -> float:
    """How far of a way (n,) at least the share ``enough`` of the poses have a lane."""
    short = np.flatnonzero(share < enough)
    count = len(share) if len(short) == 0 else int(short[0])
    return WAY_STEP_M * max(count - 1, 0)
