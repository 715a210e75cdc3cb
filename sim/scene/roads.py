"""Asphalt, paint and road edges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np
import shapely
from scipy.spatial import KDTree

from hippodrome.core.types import FloatArray
from hippodrome.sim.scene.lanes import PIECE_M, PROBE_M, Beside, Pieces, beside, cut_lanes
from hippodrome.sim.scene.mesh import Mesh, Surface, merge, placed, polygons
from hippodrome.sim.scene.placement import Bools, Shapes, clear_of, paved_area, turning_places
from hippodrome.sim.scene.relief import Relief, rim_mesh, stands_low, underside_mesh
from hippodrome.sim.types import Town

JUNCTION_Z_M: Final = 0.025  # layers lie far enough apart for the depth buffer, and too close to be seen
ROAD_Z_M: Final = 0.03
REPAIR_Z_M: Final = 0.04
REPAIRED_SHARE: Final = 0.12  # of the lanes' length: an ordinary road has been opened here and there
PAINT_Z_M: Final = 0.05
DASH_PERIOD_M: Final = 9.0  # a dash of one piece and a gap of two
PAVED_SHARE: Final = 0.5
MOUTH_M: Final = 3.0  # beyond a lane's border the land must reach this far to be land and not the notch of a junction's outline
PAVEMENT_M: Final = 1.6
LINE_M: Final = 0.14  # width of a painted line
KERB_M: Final = (0.16, 0.12)  # width, height
VERGE_M: Final = 0.9  # gravel between the asphalt and the grass
ASPHALT: Final = np.array([0.40, 0.40, 0.42])
PAINT: Final = np.array([0.93, 0.93, 0.90])
GRAVEL: Final = np.array([0.56, 0.52, 0.45])
KERBSTONE: Final = np.array([0.68, 0.67, 0.65])
PAVING: Final = np.array([0.62, 0.60, 0.57])


def road_mesh(
    town: Town,
    origin_m: FloatArray,
    town_share: Callable[[FloatArray], FloatArray],
    rng: np.random.Generator,
    relief: Relief | None = None,
) -> tuple[Mesh, Mesh]:
    """Bold and fine parts of the roads; ``town_share`` gives at (k, 2) how much of a town it is there: kerbs or gravel.

    ``relief`` is the ground below, from which roads are told from bridges; None: it is flat.
    """
    network = town.network
    pieces = cut_lanes(network, origin_m, town.heights_m)
    tone = np.where(network.is_internal, 1.0, rng.uniform(0.88, 1.1, len(network.edge_ids))[network.lane_edge])[pieces.lane]
    patch = rng.uniform(0.97, 1.03, len(pieces.lane))
    bold = [
        strip(pieces, -pieces.half_width_m, pieces.half_width_m, ROAD_Z_M, ASPHALT * (tone * patch)[:, None]),
        _junctions(town, origin_m),
    ]
    fine = []
    roads, junctions = paved_area(town, origin_m)
    turned_at = turning_places(town, origin_m)
    open_road = ~network.is_internal[pieces.lane]
    for side in (1, -1):
        kind, other = beside(pieces, network.is_internal, side)
        turn = beside(pieces, network.is_internal, side, probe_m=0.05)[0] == Beside.NOTHING  # not between two lanes that part
        edge = pieces.select((kind == Beside.NOTHING) & (open_road | (turn & ~_leads_into(pieces, side, junctions))))
        edge = edge.select(~_leads_into(edge, side, turned_at))
        paved = (town_share(edge.middle_m()) > PAVED_SHARE) & _has_room(edge, side, roads)
        low = stands_low(edge, relief)
        bold += [_verge(edge.select(~paved & low), side), _pavement(edge.select(paved & low), side)]
        if relief is not None:
            bold.append(rim_mesh(edge, side, relief))
        fine.append(_line(edge, side, inset_m=0.2))
        between = np.isin(kind, (Beside.OPPOSITE, Beside.SAME_DIRECTION)) & open_road & (pieces.lane < other)
        dashed = between & (pieces.along_m % DASH_PERIOD_M < PIECE_M)
        fine.append(_line(pieces.select(dashed), side, inset_m=0.0))
    if relief is not None:
        bold.append(underside_mesh(pieces, relief))
    return merge(bold), merge([_repairs(pieces.select(open_road), rng), *fine, _stop_lines(town, origin_m)])


def _leads_into(pieces: Pieces, side: int, junctions: Shapes) -> Bools:
    """Whether a junction's area goes on beyond the border: then the border is no edge of the road."""
    reach = [pieces.middle_m() + side * pieces.left_normal() * (pieces.half_width_m + r)[:, None] for r in (PROBE_M, MOUTH_M)]
    return ~clear_of(shapely.linestrings(np.stack(reach, axis=1)), junctions, 0.0)


def _has_room(pieces: Pieces, side: int, roads: Shapes) -> Bools:
    """Whether a pavement beyond the border would stay off every other road."""
    reach = pieces.half_width_m + KERB_M[0] + PAVEMENT_M
    corners = [
        at + side * normal * reach[:, None]
        for at, normal in ((pieces.start_m, pieces.start_normal), (pieces.end_m, pieces.end_normal))
    ]
    return clear_of(shapely.linestrings(np.stack(corners, axis=1)), roads, 0.5)


def strip(
    pieces: Pieces,
    right_m: FloatArray,
    left_m: FloatArray,
    z_m: float | FloatArray,
    albedo: FloatArray,
    surface: Surface = Surface.MINERAL,
) -> Mesh:
    """Quads along the pieces, between two lateral offsets (P,), left positive; ``z_m`` one height or the 4 corners'."""
    corners = [
        pieces.start_m + right_m[:, None] * pieces.start_normal,
        pieces.end_m + right_m[:, None] * pieces.end_normal,
        pieces.end_m + left_m[:, None] * pieces.end_normal,
        pieces.start_m + left_m[:, None] * pieces.start_normal,
    ]
    flat = np.stack(corners, axis=1)
    road_z = np.stack([pieces.start_z_m, pieces.end_z_m, pieces.end_z_m, pieces.start_z_m], axis=1)
    height = (np.broadcast_to(z_m, flat.shape[:2]) + road_z)[..., None]
    return polygons(np.concatenate([flat, height], axis=2), albedo, surface)


def _line(pieces: Pieces, side: int, inset_m: float) -> Mesh:
    middle = side * (pieces.half_width_m - inset_m)
    return strip(pieces, middle - 0.5 * LINE_M, middle + 0.5 * LINE_M, PAINT_Z_M, PAINT)


def _verge(pieces: Pieces, side: int) -> Mesh:
    inner, outer = side * (pieces.half_width_m - 0.05), side * (pieces.half_width_m + VERGE_M)
    return strip(pieces, np.minimum(inner, outer), np.maximum(inner, outer), 0.5 * JUNCTION_Z_M, GRAVEL)


def _pavement(pieces: Pieces, side: int) -> Mesh:
    """A kerb with its face to the road, and slabs behind it, sloping down to the grass."""
    border, kerb, slabs = (side * (pieces.half_width_m + w) for w in (0.0, KERB_M[0], KERB_M[0] + PAVEMENT_M))
    face = _slope(pieces, border, border + side * 0.02, 0.0, KERB_M[1], KERBSTONE, side)
    top = _slope(pieces, border + side * 0.02, kerb, KERB_M[1], KERB_M[1], KERBSTONE, side)
    slab = _slope(pieces, kerb, slabs, KERB_M[1], KERB_M[1], PAVING, side)
    back = _slope(pieces, slabs, slabs + side * 0.15, KERB_M[1], 0.0, PAVING, side)
    return merge([face, top, slab, back])


def _slope(
    pieces: Pieces,
    inner_m: FloatArray,
    outer_m: FloatArray,
    inner_z_m: float,
    outer_z_m: float | FloatArray,
    albedo: FloatArray,
    side: int,
) -> Mesh:
    """A strip seen from above, whose two long edges lie at different heights."""
    right, left = (inner_m, outer_m) if side > 0 else (outer_m, inner_m)
    right_z, left_z = (inner_z_m, outer_z_m) if side > 0 else (outer_z_m, inner_z_m)
    return strip(pieces, right, left, np.array([right_z, right_z, left_z, left_z]), albedo)


def _repairs(pieces: Pieces, rng: np.random.Generator) -> Mesh:
    """Rectangles of newer or older asphalt."""
    chosen = pieces.select(rng.random(len(pieces.lane)) < REPAIRED_SHARE)
    right = chosen.half_width_m * rng.uniform(-0.85, 0.1, len(chosen.lane))
    left = right + chosen.half_width_m * rng.uniform(0.3, 0.75, len(chosen.lane))
    return strip(chosen, right, left, REPAIR_Z_M, ASPHALT * rng.uniform(0.72, 1.16, (len(chosen.lane), 1)))


def _stop_lines(town: Town, origin_m: FloatArray) -> Mesh:
    """Bars across the lanes' ends where a signal or sign stands."""
    network = town.network
    last = network.point_start[1:] - 1
    end, before = network.points_m[last], network.points_m[last - 1]
    near = KDTree(town.signals_m[:, :2]).query(end)[0] < 3.0 if len(town.signals_m) else np.zeros(len(end), dtype=bool)
    rows = near & ~network.is_internal
    heading = np.arctan2(*(end - before)[rows].T[::-1])
    half = 0.5 * network.width_m[rows] - 0.1
    x, y = np.broadcast_to([-0.9, -0.5, -0.5, -0.9], (len(half), 4)), half[:, None] * np.array([-1, -1, 1, 1])
    return placed(
        np.stack([x, y, np.full_like(y, PAINT_Z_M)], axis=-1)[:, None],
        end[rows] - origin_m if town.heights_m is None else np.column_stack([end - origin_m, town.heights_m[last]])[rows],
        heading,
        np.tile(PAINT, (len(half), 1)),
    )


def _junctions(town: Town, origin_m: FloatArray) -> Mesh:
    """The junctions' outlines, triangulated; where roads climb, each corner at the height of the nearest one of its outline."""
    turned_at = _outlines(town.turning_places_m, origin_m)
    if town.junction_heights_m is None or town.heights_m is None:
        return merge([_outlines(town.junction_polygons_m, origin_m), turned_at])
    nearest = KDTree(town.network.points_m - origin_m).query(turned_at.vertices_m[:, :2])[1]
    parts = [_raised(turned_at, town.heights_m[nearest])]
    for outline_m, heights_m in zip(town.junction_polygons_m, town.junction_heights_m, strict=True):
        mesh = _outlines((outline_m,), origin_m)
        nearest = KDTree(outline_m - origin_m).query(mesh.vertices_m[:, :2])[1]
        parts.append(_raised(mesh, heights_m[nearest]))
    return merge(parts)


def _raised(mesh: Mesh, by_m: FloatArray) -> Mesh:
    up = np.column_stack([np.zeros((len(by_m), 2)), by_m]).astype(np.float32)
    return replace(mesh, vertices_m=mesh.vertices_m + up)


def _outlines(outlines_m: tuple[FloatArray, ...], origin_m: FloatArray) -> Mesh:
    outlines = [shapely.Polygon(outline - origin_m) for outline in outlines_m]
    valid = shapely.make_valid(np.array(outlines, dtype=object))
    parts = shapely.get_parts(shapely.constrained_delaunay_triangles(valid))
    if len(parts) == 0:
        return merge([])
    corners = shapely.get_coordinates(shapely.get_exterior_ring(shapely.orient_polygons(parts))).reshape(-1, 4, 2)[:, :3]
    flat = np.concatenate([corners, np.full((len(corners), 3, 1), JUNCTION_Z_M)], axis=2)
    return polygons(flat, ASPHALT)
