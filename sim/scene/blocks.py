"""Large networks in square blocks: which of them a drive can see, and the part of a town that lies near a place.

A town up to ``WHOLE_KM`` is drawn as one. Of a larger one only the blocks within sight of the drive are made. What stands in a
block is drawn from the seed and the block's place alone: two drives see the same things there, whatever else each of them passes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import shapely

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, IntArray
from hippodrome.sim.network import edge_lengths_m
from hippodrome.sim.scene.placement import Bools, Shapes
from hippodrome.sim.types import Town

WHOLE_KM: Final = 60.0  # of directed road: what is smaller costs little as a whole; all scenarios of this project are
BLOCK_M: Final = 240.0  # a whole number of tiles; half of what one sees, so that little beyond sight is made
SEEN_M: Final = 480.0  # from the rear axle: the far plane, and the way to a camera mounted far ahead
BESIDE_M: Final = 60.0  # roads this far outside a block propose things that may stand in it
HORIZON_M: Final = 190.0  # and tree lines, which stand far behind the road
ROUNDED_M: Final = 10.0  # places of a drive closer than this see the same
OVERHANG_M: Final = 30.0  # crowns over a block's border, and the way from the rear axle to the camera
GROUND_M: Final = 340.0  # roads this far outside a block have their land in it


@dataclass(frozen=True, slots=True)
class Block:
    """A square of the ground, relative to the scene's origin; ``column`` and ``row`` count blocks from there."""

    column: int
    row: int

    def low_m(self) -> FloatArray:
        """The corner (2,) with the smallest coordinates, which belongs to the block; the opposite one does not."""
        return BLOCK_M * np.array([self.column, self.row], dtype=np.float64)

    def holds(self, points_m: FloatArray, beyond_m: float = 0.0) -> Bools:
        """Whether each point (k, 2) lies in the block, or no farther than ``beyond_m`` outside in each axis."""
        local = points_m - self.low_m()
        inside: Bools = np.all((local >= -beyond_m) & (local < BLOCK_M + beyond_m), axis=1)
        return inside

    def outside(self) -> Shapes:
        """Everything around the block as one obstacle (1,), so that what is placed stays inside."""
        x, y = self.low_m()
        far = 10.0 * BLOCK_M
        around = shapely.box(x - far, y - far, x + BLOCK_M + far, y + BLOCK_M + far)
        return np.array([around.difference(shapely.box(x, y, x + BLOCK_M, y + BLOCK_M))], dtype=object)

    def stream(self, seed: int) -> np.random.Generator:
        """The block's own random numbers."""
        return np.random.default_rng([seed, *(2 * abs(n) + (n < 0) for n in (self.column, self.row))])


def is_drawn_whole(town: Town) -> bool:
    """Whether a town is small enough to be drawn as one."""
    return float(edge_lengths_m(town.network).sum()) <= 1e3 * WHOLE_KM


def blocks_seen(path_m: FloatArray, view: tuple[FloatArray, float] | None = None) -> list[Block]:
    """The blocks within ``SEEN_M`` of places (n, 2) relative to the scene's origin, row by row.

    With ``view``, the directions (n,) in which one looks there and half the angle that one sees [rad], less than a quarter of a
    turn, only those that may be seen.
    """
    places = np.unique(np.round(path_m / ROUNDED_M), axis=0) * ROUNDED_M if view is None else path_m
    home = np.floor(places / BLOCK_M).astype(np.int64)
    reach = int(np.ceil(SEEN_M / BLOCK_M)) + 1
    found = []
    for step in np.stack(np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1)), axis=-1).reshape(-1, 2):
        low = (home + step) * BLOCK_M
        gap = np.maximum(np.maximum(low - places, places - low - BLOCK_M), 0.0)
        seen = np.linalg.norm(gap, axis=1) < SEEN_M + ROUNDED_M
        if view is not None:
            seen &= _is_ahead(low - places, *view)
        found.append((home + step)[seen])
    cells = np.unique(np.concatenate(found)[:, ::-1], axis=0)
    return [Block(int(column), int(row)) for row, column in cells]


def _is_ahead(low_m: FloatArray, heading_rad: FloatArray, half_view_rad: float) -> Bools:
    """Whether blocks with corners ``low_m`` (n, 2) before the eye reach into the angle that is seen."""
    ends = np.array([-OVERHANG_M, BLOCK_M + OVERHANG_M])
    corners = low_m[:, None, :] + np.stack(np.meshgrid(ends, ends), axis=-1).reshape(1, 4, 2)
    ahead = np.ones(len(low_m), dtype=np.bool_)
    for side in (1.0, -1.0):
        inward = heading_rad + side * (half_view_rad - 0.5 * np.pi)
        ahead &= np.any(corners[..., 0] * np.cos(inward)[:, None] + corners[..., 1] * np.sin(inward)[:, None] > 0.0, axis=1)
    return ahead


def town_near(town: Town, origin_m: FloatArray, blocks: list[Block], beyond_m: float) -> Town:
    """The part of a town whose lanes, junctions and signals reach into the bounding box of blocks, grown by ``beyond_m``.

    Lanes stay whole, and edges keep their numbers; how lanes follow one another is left out.
    """
    corners = np.array([block.low_m() for block in blocks]) + origin_m
    low, high = corners.min(axis=0) - beyond_m, corners.max(axis=0) + BLOCK_M + beyond_m
    network, outlines = town.network, town.junction_polygons_m
    heights, levels = town.heights_m, town.junction_heights_m
    lanes = np.flatnonzero(_touch(*_bounds(network.points_m, network.point_start[:-1]), low, high))
    near = [i for i, outline in enumerate(outlines) if _reaches(outline, low, high)]
    signals = town.signals_m[_touch(town.signals_m[:, :2], town.signals_m[:, :2], low, high)]
    return replace(
        town,
        network=_lanes_only(network, lanes),
        junction_polygons_m=tuple(outlines[i] for i in near),
        signals_m=signals,
        turning_places_m=tuple(outline for outline in town.turning_places_m if _reaches(outline, low, high)),
        other_lanes_m=tuple(outline for outline in town.other_lanes_m if _reaches(outline, low, high)),
        heights_m=None if heights is None else heights[_point_rows(network, lanes)],
        junction_heights_m=None if levels is None else tuple(levels[i] for i in near),
    )


def _point_rows(network: RoadNetwork, lanes: np.ndarray) -> np.ndarray:
    """Rows of ``points_m`` that belong to the lanes, in their order."""
    counts = np.diff(network.point_start)[lanes]
    starts = np.concatenate([[0], np.cumsum(counts)])
    rows: np.ndarray = np.repeat(network.point_start[lanes] - starts[:-1], counts) + np.arange(starts[-1])
    return rows


def _bounds(points_m: FloatArray, starts: IntArray) -> tuple[FloatArray, FloatArray]:
    return np.minimum.reduceat(points_m, starts, axis=0), np.maximum.reduceat(points_m, starts, axis=0)


def _reaches(outline_m: FloatArray, low_m: FloatArray, high_m: FloatArray) -> bool:
    return bool(np.all(outline_m.max(axis=0) >= low_m) and np.all(outline_m.min(axis=0) <= high_m))


def _touch(least_m: FloatArray, most_m: FloatArray, low_m: FloatArray, high_m: FloatArray) -> Bools:
    touch: Bools = np.all((most_m >= low_m) & (least_m <= high_m), axis=1)
    return touch


def _lanes_only(network: RoadNetwork, lanes: np.ndarray) -> RoadNetwork:
    """The chosen lanes as they lie, without what leads from one to another."""
    counts = np.diff(network.point_start)[lanes]
    starts = np.concatenate([[0], np.cumsum(counts)])
    none = np.full(len(lanes), -1, dtype=np.int32)
    return replace(
        network,
        lane_ids=tuple(network.lane_ids[lane] for lane in lanes),
        lane_edge=network.lane_edge[lanes],
        is_internal=network.is_internal[lanes],
        width_m=network.width_m[lanes],
        speed_limit_mps=network.speed_limit_mps[lanes],
        points_m=network.points_m[_point_rows(network, lanes)],
        point_start=starts.astype(np.int32),
        successor=np.zeros(0, dtype=np.int32),
        successor_start=np.zeros(len(lanes) + 1, dtype=np.int32),
        left_lane=none,
        right_lane=none,
    )
