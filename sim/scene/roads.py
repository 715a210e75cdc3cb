"""Asphalt, paint and road edges."""

from __future__ import annotations

from typing import Final

import numpy as np
import shapely

from hippodrome.core.types import FloatArray
from hippodrome.sim.scene.lanes import Beside, Pieces, beside, cut_lanes
from hippodrome.sim.scene.mesh import Mesh, Surface, merge, polygons
from hippodrome.sim.types import Town

JUNCTION_Z_M: Final = 0.025  # layers lie far enough apart for the depth buffer, and too close to be seen
ROAD_Z_M: Final = 0.03
PAINT_Z_M: Final = 0.05
LINE_M: Final = 0.14  # width of a painted line
KERB_M: Final = (0.16, 0.12)  # width, height
VERGE_M: Final = 0.9  # gravel between the asphalt and the grass
ASPHALT: Final = np.array([0.40, 0.40, 0.42])
PAINT: Final = np.array([0.93, 0.93, 0.90])
GRAVEL: Final = np.array([0.56, 0.52, 0.45])
KERBSTONE: Final = np.array([0.68, 0.67, 0.65])
PAVING: Final = np.array([0.62, 0.60, 0.57])


def road_mesh(town: Town, origin_m: FloatArray, rng: np.random.Generator) -> tuple[Mesh, Mesh]:
    """Bold and fine parts of the roads."""
    network = town.network
    pieces = cut_lanes(network, origin_m)
    tone = rng.uniform(0.86, 1.12, len(network.edge_ids))[network.lane_edge]
    tone = np.where(network.is_internal, 1.0, tone)
    patch = rng.uniform(0.96, 1.04, len(pieces.lane))
    surface = strip(pieces, -pieces.half_width_m, pieces.half_width_m, ROAD_Z_M, ASPHALT * (tone[pieces.lane] * patch)[:, None])
    bold, fine = [surface, _junctions(town, origin_m)], []
    open_road = ~network.is_internal[pieces.lane]
    for side in (1, -1):
        kind, other = beside(pieces, network.is_internal, side)
        edge = (kind == Beside.NOTHING) & open_road
        bold.append(_verge(pieces.select(edge), side))
        fine.append(_line(pieces.select(edge), side, inset_m=0.2))
        dash = (
            (kind != Beside.NOTHING)
            & (kind != Beside.JUNCTION)
            & open_road
            & (pieces.lane < other)
            & (pieces.along_m % (3 * 3.0) < 3.0)
        )
        fine.append(_line(pieces.select(dash), side, inset_m=0.0))
    return merge(bold), merge(fine)


def strip(
    pieces: Pieces, right_m: FloatArray, left_m: FloatArray, z_m: float, albedo: FloatArray, surface: Surface = Surface.MINERAL
) -> Mesh:
    """Flat quads along the pieces, between two lateral offsets (P,), left positive."""
    corners = [
        pieces.start_m + right_m[:, None] * pieces.start_normal,
        pieces.end_m + right_m[:, None] * pieces.end_normal,
        pieces.end_m + left_m[:, None] * pieces.end_normal,
        pieces.start_m + left_m[:, None] * pieces.start_normal,
    ]
    flat = np.stack(corners, axis=1)
    return polygons(np.concatenate([flat, np.full((*flat.shape[:2], 1), z_m)], axis=2), albedo, surface)


def _line(pieces: Pieces, side: int, inset_m: float) -> Mesh:
    middle = side * (pieces.half_width_m - inset_m)
    return strip(pieces, middle - 0.5 * LINE_M, middle + 0.5 * LINE_M, PAINT_Z_M, PAINT)


def _verge(pieces: Pieces, side: int) -> Mesh:
    inner, outer = side * (pieces.half_width_m - 0.05), side * (pieces.half_width_m + VERGE_M)
    return strip(pieces, np.minimum(inner, outer), np.maximum(inner, outer), 0.5 * JUNCTION_Z_M, GRAVEL)


def _junctions(town: Town, origin_m: FloatArray) -> Mesh:
    """The junctions' outlines, triangulated."""
    outlines = [shapely.Polygon(outline - origin_m) for outline in town.junction_polygons_m]
    valid = shapely.make_valid(np.array(outlines, dtype=object))
    parts = shapely.get_parts(shapely.constrained_delaunay_triangles(valid))
    if len(parts) == 0:
        return merge([])
    corners = shapely.get_coordinates(shapely.get_exterior_ring(shapely.orient_polygons(parts))).reshape(-1, 4, 2)[:, :3]
    flat = np.concatenate([corners, np.full((len(corners), 3, 1), JUNCTION_Z_M)], axis=2)
    return polygons(flat, ASPHALT)
