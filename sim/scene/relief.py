"""The ground where roads climb: it follows the roads, and what passes above others stands on bridges."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.spatial import KDTree

from hippodrome.core.types import FloatArray
from hippodrome.sim.scene.lanes import Pieces
from hippodrome.sim.scene.mesh import Mesh, merge, polygons
from hippodrome.sim.scene.placement import Bools

UNDER_M: Final = 15.0  # a road with another one this near, seen from above, and
BELOW_M: Final = 2.5  # this far below, is a bridge there, and the ground does not follow it
NEIGHBOURS: Final = 32  # places looked at around each: lanes side by side, every few metres
SMOOTH_M: Final = 5.0  # distance within which the ground follows no road in particular
SUNK_M: Final = 0.35  # the ground lies so far below the roads, so that its straight edges stay beneath their bends
DECK_M: Final = 0.9  # thickness of a bridge
HIGH_M: Final = 2.5  # above the ground, from which on a road is a bridge and no dam
VERGE_M: Final = 0.85  # a wall beside a road on the ground stands below its verge
KERB_M: Final = 0.1  # and that of a bridge beside its asphalt
PARAPET_M: Final = 0.95
RAILED_M: Final = 1.2  # above the ground, from which on a road has parapets
CONCRETE: Final = np.array([0.60, 0.59, 0.56])


@dataclass(frozen=True, slots=True, eq=False)
class Relief:
    """Places on the ground, among which its height is interpolated."""

    tree: KDTree  # of places (n, 2)
    heights_m: FloatArray  # (n,)

    def at_m(self, points_m: FloatArray) -> FloatArray:
        """Height (k,) of the ground at (k, 2): the nearest roads' by the inverse square of their distance, a little lower."""
        count = min(8, len(self.heights_m))
        distance, row = self.tree.query(points_m, k=count)
        distance, row = distance.reshape(len(points_m), count), row.reshape(len(points_m), count)
        weight = 1.0 / (distance**2 + SMOOTH_M**2)
        height: FloatArray = (weight * self.heights_m[row]).sum(axis=1) / weight.sum(axis=1) - SUNK_M
        return height

    def lifted(self, mesh: Mesh) -> Mesh:
        """What was made for flat ground, on this one: each vertex goes up by the ground below it."""
        if len(mesh.vertices_m) == 0:
            return mesh
        up = np.zeros_like(mesh.vertices_m)
        up[:, 2] = self.at_m(mesh.vertices_m[:, :2].astype(np.float64))
        return replace(mesh, vertices_m=mesh.vertices_m + up)


def relief_of(pieces: Pieces) -> Relief:
    """The ground along roads; bridges do not carry it."""
    points, z = pieces.middle_m(), pieces.middle_z_m()
    near = KDTree(points).query(points, k=min(NEIGHBOURS, len(z)), distance_upper_bound=UNDER_M)[1].reshape(len(z), -1)
    around = np.append(z, np.inf)[near]
    grounded = around.min(axis=1) > z - BELOW_M
    return Relief(KDTree(points[grounded]), z[grounded])


def rim_mesh(edge: Pieces, side: int, relief: Relief) -> Mesh:
    """Below a road's left (+1) or right (-1) border a wall down to the ground, or a bridge's side; parapets where it is high."""
    above = _above_m(edge, relief)
    low, railed = edge.select(above <= RAILED_M), edge.select(above > RAILED_M)
    parts = [_wall(low, side, VERGE_M, relief), _wall(railed, side, KERB_M, relief), _parapet(railed, side)]
    return merge(parts)


def stands_low(pieces: Pieces, relief: Relief | None) -> Bools:
    """Whether each piece has ground beside it, on which a verge or a pavement can lie."""
    return np.ones(len(pieces.lane), dtype=np.bool_) if relief is None else _above_m(pieces, relief) <= RAILED_M


def underside_mesh(pieces: Pieces, relief: Relief) -> Mesh:
    """Bridges from below."""
    high = pieces.select(_above_m(pieces, relief) > HIGH_M)
    left, right = _rim(high, 1, KERB_M), _rim(high, -1, KERB_M)
    corners = np.stack([right[0], left[0], left[1], right[1]], axis=1) - [0.0, 0.0, DECK_M]
    return polygons(corners, 0.7 * CONCRETE)


def _above_m(pieces: Pieces, relief: Relief) -> FloatArray:
    return pieces.middle_z_m() - relief.at_m(pieces.middle_m())


def _rim(pieces: Pieces, side: int, beyond_m: float) -> tuple[FloatArray, FloatArray]:
    """Two ends (P, 3) of lines beyond the border, in driving direction."""
    reach = side * (pieces.half_width_m + beyond_m)[:, None]
    start = np.column_stack([pieces.start_m + reach * pieces.start_normal, pieces.start_z_m])
    end = np.column_stack([pieces.end_m + reach * pieces.end_normal, pieces.end_z_m])
    return start, end


def _upright(start: FloatArray, end: FloatArray, low_m: FloatArray, high_m: float, side: int) -> Mesh:
    """Quads between two heights above the rim, seen from the left (+1) or the right (-1)."""
    up = np.array([0.0, 0.0, 1.0])
    low, high = low_m[:, None] * up, high_m * up
    corners = np.stack([end + low, start + low, start + high, end + high], axis=1)
    return polygons(corners if side > 0 else corners[:, ::-1], CONCRETE)


def _wall(pieces: Pieces, side: int, beyond_m: float, relief: Relief) -> Mesh:
    above = _above_m(pieces, relief)
    depth = np.where(above > HIGH_M, DECK_M, above + 1.0)  # a wall's foot stands in the ground
    return _upright(*_rim(pieces, side, beyond_m), -depth, 0.0, side)


def _parapet(pieces: Pieces, side: int) -> Mesh:
    """A wall that is seen from both sides."""
    start, end = _rim(pieces, side, KERB_M)
    return merge([_upright(start, end, np.zeros(len(start)), PARAPET_M, seen_from) for seen_from in (1, -1)])
