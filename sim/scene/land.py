"""The ground: grass in uneven tones, fields with their rows, fences around some."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.spatial import KDTree

from hippodrome.core.types import FloatArray
from hippodrome.sim.scene.mesh import Mesh, Surface, boxes, merge, placed, polygons, turned
from hippodrome.sim.scene.placement import Bools, Border, Shapes, clear_of, quilt, rectangles, spread

CELL_M: Final = 80.0  # as the tiles, so that no cell straddles two
FINE_CELLS: Final = 8  # per side of a cell near the road
NEAR_M: Final = 90.0  # from the road, where the ground's unevenness is visible
REACH_M: Final = 280.0  # from the road, where the haze takes over
PATCH_CELLS: Final = 5  # a side of the squares in which cells are sought: REACH_M and a cell's diagonal are less
FIELD_Z_M: Final = 0.006
ROW_Z_M: Final = 0.014
GRASS: Final = np.array([0.36, 0.46, 0.21])
STRAW: Final = np.array([0.50, 0.50, 0.27])
# Field and row colours: wheat, young corn, ploughed earth, meadow, rape.
FIELDS: Final = np.array([[0.74, 0.64, 0.36], [0.42, 0.38, 0.24], [0.42, 0.33, 0.25], [0.44, 0.54, 0.24], [0.70, 0.66, 0.16]])
ROWS: Final = np.array([[0.66, 0.55, 0.28], [0.30, 0.48, 0.20], [0.34, 0.26, 0.19], [0.38, 0.50, 0.20], [0.62, 0.62, 0.20]])
PATCHES: Final = np.array([[0.28, 0.42, 0.16], [0.46, 0.52, 0.24], [0.54, 0.52, 0.30], [0.24, 0.36, 0.15], [0.46, 0.40, 0.28]])
FIELD_GAP_M: Final = 55.0  # of country road side per proposed field; about half find room
FENCED_SHARE: Final = 0.45
POST_GAP_M: Final = 2.5
ROW_M: Final = 2.4  # between rows
WOOD: Final = np.array([0.46, 0.38, 0.29])


def ground_mesh(road_points_m: FloatArray, rng: np.random.Generator, holds: Callable[[FloatArray], Bools]) -> Mesh:
    """Grass around all roads (n, 2), coarse where far away; the cells whose middles (k, 2) are held."""
    grid = _cells_near(road_points_m) * CELL_M
    grid = grid[holds(grid + 0.5 * CELL_M)]
    distance = KDTree(road_points_m).query(grid + 0.5 * CELL_M)[0] - 0.7 * CELL_M  # less the cell's half diagonal
    fine, coarse = grid[distance < NEAR_M], grid[(distance >= NEAR_M) & (distance < REACH_M)]
    step = CELL_M / FINE_CELLS
    offsets = step * np.stack(np.meshgrid(np.arange(FINE_CELLS), np.arange(FINE_CELLS)), axis=-1).reshape(1, -1, 2)
    tone = np.random.default_rng(rng.integers(2**63))
    seeds = tone.integers(2**63, size=2)
    parts = [_squares((fine[:, None] + offsets).reshape(-1, 2), step, seeds), _squares(coarse, CELL_M, seeds)]
    return merge(parts)


def _cells_near(points_m: FloatArray) -> FloatArray:
    """Columns and rows (k, 2) of the cells around points (n, 2), row by row: all that reach within ``REACH_M`` of one, and some
    more. Their number follows the points', not the extent of the network, whose parts may lie continents apart."""
    low, high = (np.floor((points_m.min(axis=0) - REACH_M) / CELL_M), np.ceil((points_m.max(axis=0) + REACH_M) / CELL_M))
    parts = np.floor(points_m / (PATCH_CELLS * CELL_M)).astype(np.int64)
    around = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(1, -1, 2)
    parts = np.unique((np.unique(parts, axis=0)[:, None] + around).reshape(-1, 2), axis=0)
    inside = np.stack(np.meshgrid(np.arange(PATCH_CELLS), np.arange(PATCH_CELLS)), axis=-1).reshape(1, -1, 2)
    cells = (PATCH_CELLS * parts[:, None] + inside).reshape(-1, 2).astype(np.float64)
    cells = cells[np.all((cells >= low) & (cells < high), axis=1)]
    ordered: FloatArray = cells[np.lexsort((cells[:, 0], cells[:, 1]))]
    return ordered


def _squares(corner_m: FloatArray, side_m: float, seeds: np.ndarray) -> Mesh:
    """Ground squares with a colour at each corner, taken from fields that know no squares."""
    corners = corner_m[:, None] + side_m * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    flat = corners.reshape(-1, 2)
    dry = quilt(flat, 140.0, np.random.default_rng(seeds[0]))[:, None]
    mottle = quilt(flat, 28.0, np.random.default_rng(seeds[1]))[:, None]
    albedo = ((1.0 - 0.6 * dry) * GRASS + 0.6 * dry * STRAW) * (0.84 + 0.30 * mottle)
    return polygons(np.concatenate([corners, np.zeros((len(corners), 4, 1))], 2), albedo.reshape(-1, 4, 3), Surface.GRASS)


def patch_mesh(border: Border, rng: np.random.Generator) -> Mesh:
    """Irregular patches of taller, drier or trodden grass and bare earth beside the road (fine)."""
    site = border.draw(2.0, rng)
    k, sides = len(site.length_m), 6
    centre = site.point_m + site.outward * (1.2 + 12.0 * rng.random(k) ** 2)[:, None]
    angle = 2.0 * np.pi * np.arange(sides) / sides + rng.uniform(0.0, 1.0, (k, 1))
    radius = rng.uniform(0.3, 1.5, (k, 1)) * rng.uniform(0.5, 1.0, (k, sides))
    local = np.stack([1.6 * radius * np.cos(angle), radius * np.sin(angle), np.full((k, sides), FIELD_Z_M)], axis=-1)
    albedo = PATCHES[rng.integers(len(PATCHES), size=k)] * rng.uniform(0.85, 1.15, (k, 1))
    return polygons(turned(local, centre, site.inward_yaw_rad()), albedo, Surface.GRASS)


@dataclass(frozen=True, slots=True, eq=False)
class Fields:
    """k rectangular fields, their front (+y) to the road."""

    centre_m: FloatArray  # (k, 2)
    yaw_rad: FloatArray  # (k,)
    length_m: FloatArray  # (k,) along the road
    width_m: FloatArray  # (k,)

    def select(self, rows: np.ndarray) -> Fields:
        return Fields(self.centre_m[rows], self.yaw_rad[rows], self.length_m[rows], self.width_m[rows])

    def footprints(self) -> Shapes:
        return rectangles(self.centre_m, self.yaw_rad, self.length_m, self.width_m)


def place_fields(border: Border, town_share: FloatArray, roads: Shapes, rng: np.random.Generator) -> Fields:
    """Fields come first, as they did in history; houses fill what is left."""
    site = border.draw(FIELD_GAP_M / np.maximum(1.0 - town_share, 0.05), rng)
    k = len(site.length_m)
    length, width = rng.uniform(18.0, 60.0, k), rng.uniform(14.0, 40.0, k)
    centre = site.point_m + site.outward * (rng.uniform(2.5, 9.0, k) + 0.5 * width)[:, None]
    proposed = Fields(centre, site.inward_yaw_rad() + rng.normal(0.0, 0.06, k), length, width)
    proposed = proposed.select(clear_of(proposed.footprints(), roads, 1.6))
    return proposed.select(spread(proposed.footprints(), 2.0))


def field_mesh(fields: Fields, rng: np.random.Generator) -> tuple[Mesh, Mesh]:
    """Fields (bold), their rows and fences (fine)."""
    k = len(fields.yaw_rad)
    kind = rng.integers(len(FIELDS), size=k)
    tone = rng.uniform(0.9, 1.1, (k, 1))
    base = _sheets(fields, np.zeros(k), FIELD_Z_M, FIELDS[kind] * tone)
    rows = np.floor(fields.width_m / ROW_M).astype(np.int64)
    owner = np.repeat(np.arange(k), rows)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(rows) - rows, rows)
    offset = (number + 0.5) * ROW_M - 0.5 * fields.width_m[owner]
    narrow = replace(fields.select(owner), width_m=np.full(len(owner), 0.45 * ROW_M))
    stripes = _sheets(narrow, offset, ROW_Z_M, (ROWS[kind] * tone)[owner])
    return base, merge([stripes, _fences(fields.select(rng.random(k) < FENCED_SHARE))])


def _sheets(fields: Fields, offset_m: FloatArray, z_m: float, albedo: FloatArray) -> Mesh:
    """Flat rectangles (k,), shifted along their own y axis."""
    x = 0.5 * fields.length_m[:, None] * np.array([-1, 1, 1, -1])
    y = 0.5 * fields.width_m[:, None] * np.array([-1, -1, 1, 1]) + offset_m[:, None]
    local = np.stack([x, y, np.full_like(x, z_m)], axis=-1)
    return placed(local[:, None], fields.centre_m, fields.yaw_rad, albedo, Surface.CROP)


def _fences(fields: Fields) -> Mesh:
    """Two rails and posts along the front of each field."""
    k, front = len(fields.yaw_rad), 0.5 * fields.width_m + 0.6
    rails = []
    for z_m in (0.45, 0.90):
        foot = turned(np.stack([0.0 * front, front, np.full(k, z_m)], axis=1)[:, None], fields.centre_m, fields.yaw_rad)[:, 0]
        rails.append(boxes(foot, fields.yaw_rad, np.stack([fields.length_m, np.full(k, 0.05), np.full(k, 0.13)], axis=1), WOOD))
    posts = np.floor(fields.length_m / POST_GAP_M).astype(np.int64)
    owner = np.repeat(np.arange(k), posts)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(posts) - posts, posts)
    x = (number + 0.5) * POST_GAP_M - 0.5 * fields.length_m[owner]
    local = np.stack([x, front[owner], np.zeros(len(x))], axis=1)[:, None]
    foot = turned(local, fields.centre_m[owner], fields.yaw_rad[owner])[:, 0]
    post = boxes(foot[:, :2], fields.yaw_rad[owner], np.tile([0.12, 0.12, 1.15], (len(x), 1)), 0.9 * WOOD)
    return merge([*rails, post])
