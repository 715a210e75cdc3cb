"""Moving vehicles as coloured boxes with cabins, wheels and lamps, shaded for their heading."""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np

from hippodrome.core.types import Float32Array, FloatArray, IntArray, UInt8Array
from hippodrome.sim.scene.light import shade
from hippodrome.sim.scene.mesh import Mesh, boxes, merge, polygons, turned
from hippodrome.sim.scene.types import Light, Tile
from hippodrome.sim.traffic import VEHICLE_SIZES_M

# Usual paints: white, black, silver, grey, blue, red, green, sand.
PAINTS: Final = np.array(
    [
        [0.92, 0.92, 0.90],
        [0.10, 0.10, 0.12],
        [0.72, 0.74, 0.76],
        [0.40, 0.42, 0.45],
        [0.15, 0.28, 0.58],
        [0.70, 0.12, 0.12],
        [0.16, 0.36, 0.24],
        [0.78, 0.68, 0.50],
    ]
)
PAINTED: Final = np.array([1.0, 1.0, 1.0])  # marks the template's vertices that take the vehicle's paint
GLASS, TYRE, HEADLAMP, TAIL_LAMP = (
    np.array(c) for c in ([0.16, 0.20, 0.24], [0.07, 0.07, 0.07], [0.97, 0.97, 0.88], [0.75, 0.08, 0.06])
)
BONNET_SHARE: Final = (0.28, 0.12, 0.0)  # of the length in front of the cabin: car, van, truck
CABIN_SHARE: Final = (0.56, 0.88, 0.24)  # of the length
BELT_SHARE: Final = (0.56, 0.50, 0.45)  # of the height, where the glass begins


def vehicle_mesh(poses_m: FloatArray, kinds: UInt8Array, ids: IntArray, light: Light) -> Tile:
    """All vehicles at centre poses (k, 3), or (k, 5) with height and pitch, as one tile."""
    if len(poses_m) == 0:
        return Tile(
            np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32), np.zeros((0, 3), np.uint8), np.zeros(0, np.uint8), 0
        )
    parts = [_of_kind(kind, poses_m[kinds == kind], ids[kinds == kind]) for kind in np.unique(kinds)]
    mesh = merge(parts)
    smooth = np.zeros(len(mesh.vertices_m), np.uint8)  # grain is fixed to the ground: on what moves it would swim
    return Tile(mesh.vertices_m, mesh.faces, shade(mesh.albedo, mesh.normals, light), smooth, len(mesh.faces))


def _of_kind(kind: int, poses_m: FloatArray, ids: IntArray) -> Mesh:
    template, painted = _template(min(int(kind), len(BONNET_SHARE) - 1))
    k, n = len(poses_m), len(template.vertices_m)
    paint = PAINTS[(ids.astype(np.int64) * 2654435761 >> 8) % len(PAINTS)]  # Knuth's multiplicative hash: neighbours differ
    albedo = np.where(painted[None, :, None], paint[:, None, :], template.albedo[None])
    return Mesh(
        vertices_m=_flat(turned(_pitched(template.vertices_m, poses_m), _feet(poses_m), poses_m[:, 2])),
        normals=_flat(turned(_pitched(template.normals, poses_m), np.zeros((k, 2)), poses_m[:, 2])),
        albedo=_flat(albedo),
        surface=np.tile(template.surface, k),
        faces=(np.arange(k)[:, None, None] * n + template.faces).reshape(-1, 3).astype(np.int32),
    )


def _feet(poses_m: FloatArray) -> FloatArray:
    return poses_m[:, :2] if poses_m.shape[1] == 3 else poses_m[:, [0, 1, 3]]


def _pitched(local: Float32Array, poses_m: FloatArray) -> FloatArray:
    """Points or directions (n, 3) of the template in the axes of each vehicle (1 or k, n, 3), nose up by its pitch."""
    points = local[None].astype(np.float64)
    if poses_m.shape[1] == 3:
        return points
    sin, cos = np.sin(poses_m[:, 4:5]), np.cos(poses_m[:, 4:5])
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    return np.stack(np.broadcast_arrays(cos * x - sin * z, y, sin * x + cos * z), axis=-1)


def _flat(array: np.ndarray) -> Float32Array:
    return array.reshape(-1, 3).astype(np.float32)


@cache
def _template(kind: int) -> tuple[Mesh, np.ndarray]:
    """A vehicle around its centre, x forward, and which of its vertices take the paint."""
    length, width, height = VEHICLE_SIZES_M[kind]
    belt, clearance = BELT_SHARE[kind] * height, 0.25
    cabin, bonnet = CABIN_SHARE[kind] * length, BONNET_SHARE[kind] * length
    middle = 0.5 * length - bonnet - 0.5 * cabin
    parts = [_box([0, 0, clearance], [length, width, belt - clearance], PAINTED), _cabin(middle, belt, cabin, width, height)]
    if kind == 2:
        parts.append(_box([-0.14 * length, 0, belt], [0.72 * length, width, height - belt], PAINTED))
    wheels = [(sx * 0.31 * length, sy * 0.46 * width) for sx in (-1, 1) for sy in (-1, 1)]
    parts += [_box([x, y, 0.0], [0.65, 0.14 * width, 0.62], TYRE) for x, y in wheels]
    sides = [(0.5 * length, HEADLAMP), (-0.5 * length, TAIL_LAMP)]
    parts += [_box([x, sy * 0.38 * width, 0.55 * belt], [0.06, 0.16 * width, 0.16], lamp) for x, lamp in sides for sy in (-1, 1)]
    mesh = merge(parts)
    return mesh, np.all(mesh.albedo == PAINTED, axis=1)


def _box(origin: list[float], size: list[float], albedo: FloatArray) -> Mesh:
    return boxes(np.array([origin]), np.zeros(1), np.array([size]), albedo)


def _cabin(middle: float, belt: float, length: float, width: float, height: float) -> Mesh:
    """Glass all round with raked screens under a painted roof."""
    low, top, rake = belt, height, 0.18 * length
    x0, x1, y, inset = middle - 0.5 * length, middle + 0.5 * length, 0.48 * width, 0.42 * width
    foot = np.array([[x1, -y, low], [x1, y, low], [x0, y, low], [x0, -y, low]])
    roof = np.array(
        [[x1 - rake, -inset, top], [x1 - rake, inset, top], [x0 + 0.6 * rake, inset, top], [x0 + 0.6 * rake, -inset, top]]
    )
    following = [1, 2, 3, 0]
    glass = np.stack([foot, foot[following], roof[following], roof], axis=1)
    return merge([polygons(glass, GLASS), polygons(roof[[3, 0, 1, 2]][None], PAINTED)])
