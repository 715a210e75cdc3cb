"""A town's scene: geometry from the town and a seed alone, then colours for the conditions, cut into tiles."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from hippodrome.core.types import FloatArray, IntArray
from hippodrome.sim.scene.blocks import GROUND_M, blocks_seen, is_drawn_whole, town_near
from hippodrome.sim.scene.conditions_spec import Conditions
from hippodrome.sim.scene.light import colour, extinction_per_m, grain, haze_rgb, light_of, sky_dome
from hippodrome.sim.scene.mesh import Mesh, merge
from hippodrome.sim.scene.town_mesh import block_mesh, land_of, town_mesh
from hippodrome.sim.scene.types import Scene, Tile
from hippodrome.sim.tour import middle_edge, tour_graph
from hippodrome.sim.types import Town

FINE_M: Final = 100e3  # across; 32 bits tell 4 mm apart at 50 km from the middle
TILE_M: Final = 80.0  # small enough to cull well, large enough that a frame needs few draw calls


def build_scene(
    town: Town, seed: int, conditions: Conditions, drive_m: FloatArray | None = None, half_view_rad: float | None = None
) -> Scene:
    """The same town and seed give the same geometry under all conditions, and the same bytes under the same ones.

    Args:
        town: What to draw.
        seed: Of everything beside the roads.
        conditions: Season, light and weather.
        drive_m: Poses (n, 2 or more columns) from which a town of more than ``WHOLE_KM`` is seen: what none of them can see
            is left out. Without them, or of a smaller town, everything is drawn.
        half_view_rad: Half the angle that is seen around each pose's heading, for poses (n, 3) that are few; None: the drive
            looks everywhere.
    """
    origin_m = scene_origin_m(town)
    light = light_of(conditions)
    if drive_m is None or is_drawn_whole(town):
        tiles = _tiles(*town_mesh(town, seed, origin_m), conditions)
    else:
        tiles = tuple(_seen_tiles(town, seed, origin_m, conditions, drive_m, half_view_rad))
    return Scene(
        tiles=tiles,
        sky=sky_dome(conditions),
        origin_m=origin_m,
        haze_rgb=haze_rgb(conditions),
        extinction_per_m=extinction_per_m(conditions),
        light=light,
    )


def scene_origin_m(town: Town) -> FloatArray:
    """Network coordinates (2,) of the scene's zero: the middle of the network, or of the roads that are toured where the network
    is so large that the scene's numbers of 32 bits would not tell centimetres there."""
    low, high = town.network.points_m.min(axis=0), town.network.points_m.max(axis=0)
    if np.max(high - low) > FINE_M:
        roads = tour_graph(town.network)
        middle: FloatArray = np.round(roads.middle_m[middle_edge(roads)])
    else:
        middle = np.round(0.5 * (low + high))
    return middle


def _seen_tiles(
    town: Town, seed: int, origin_m: FloatArray, conditions: Conditions, drive_m: FloatArray, half_view_rad: float | None
) -> Iterator[Tile]:
    """The tiles of the blocks within sight of a drive, block by block."""
    view = None if half_view_rad is None or half_view_rad >= 0.5 * np.pi else (drive_m[:, 2], half_view_rad)
    blocks = blocks_seen(drive_m[:, :2] - origin_m, view)
    land = land_of(town_near(town, origin_m, blocks, GROUND_M), origin_m)
    for block in blocks:
        bold, fine = block_mesh(land, seed, origin_m, block)
        if len(bold.faces):
            yield from _tiles(bold, fine, conditions)


def _tiles(bold: Mesh, fine: Mesh, conditions: Conditions) -> tuple[Tile, ...]:
    """Faces grouped by the tile of their centre, bold ones first; each tile with the vertices that it uses."""
    mesh = merge([bold, fine])
    rgb, rough = colour(mesh, conditions, light_of(conditions)), grain(mesh)
    is_fine = np.arange(len(mesh.faces)) >= len(bold.faces)
    tile = _tile_of_faces(mesh.vertices_m[mesh.faces].mean(axis=1)[:, :2])
    order = np.lexsort((is_fine, tile)).astype(np.int32)
    starts = np.flatnonzero(np.diff(tile[order], prepend=-1))
    return tuple(_tile(mesh, rgb, rough, rows, is_fine) for rows in np.split(order, starts[1:]))


def _tile(mesh: Mesh, rgb: np.ndarray, rough: np.ndarray, rows: IntArray, is_fine: np.ndarray) -> Tile:
    used, faces = np.unique(mesh.faces[rows], return_inverse=True)
    return Tile(
        vertices_m=mesh.vertices_m[used],
        faces=faces.reshape(-1, 3).astype(np.int32),
        rgb=rgb[used],
        grain=rough[used],
        bold_faces=int(np.count_nonzero(~is_fine[rows])),
    )


def _tile_of_faces(centre_m: FloatArray) -> IntArray:
    """Number of the tile (m,) that holds each point (m, 2), counted row by row."""
    cell = np.floor(centre_m / TILE_M).astype(np.int64)
    cell -= cell.min(axis=0)
    number: IntArray = (cell[:, 1] * (cell[:, 0].max() + 1) + cell[:, 0]).astype(np.int32)
    return number
