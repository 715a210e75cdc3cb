"""Triangle soups with what shading needs: normals, albedo and how the season and the light treat each surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from hippodrome.core.types import Float32Array, FloatArray, IntArray, UInt8Array


class Surface(IntEnum):
    """How conditions change a surface's colour."""

    MINERAL = 0  # walls, roofs, asphalt, paint: the same all year
    GRASS = 1
    CROP = 2
    LEAF = 3  # broad-leaved
    NEEDLE = 4
    WINDOW = 5  # lit at dusk


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """n vertices and m faces, counter-clockwise seen from outside."""

    vertices_m: Float32Array  # (n, 3)
    normals: Float32Array  # (n, 3) unit
    albedo: Float32Array  # (n, 3) sRGB, 0..1, before season and light
    surface: UInt8Array  # (n,) Surface
    faces: IntArray  # (m, 3)


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh of several, in order."""
    counts = np.cumsum([0, *(len(m.vertices_m) for m in meshes)])
    return Mesh(
        vertices_m=np.concatenate([np.zeros((0, 3), np.float32), *(m.vertices_m for m in meshes)]),
        normals=np.concatenate([np.zeros((0, 3), np.float32), *(m.normals for m in meshes)]),
        albedo=np.concatenate([np.zeros((0, 3), np.float32), *(m.albedo for m in meshes)]),
        surface=np.concatenate([np.zeros(0, np.uint8), *(m.surface for m in meshes)]),
        faces=np.concatenate([np.zeros((0, 3), np.int32), *(m.faces + c for m, c in zip(meshes, counts, strict=False))]).astype(
            np.int32
        ),
    )


def polygons(corners_m: FloatArray, albedo: FloatArray, surface: Surface = Surface.MINERAL) -> Mesh:
    """Flat convex polygons (k, c, 3), each with its own vertices; ``albedo`` (3,), (k, 3) or (k, c, 3)."""
    corners = np.asarray(corners_m, dtype=np.float64)
    k, c = corners.shape[:2]
    normals = _cross(
        corners[:, c // 2] - corners[:, 0], corners[:, -1] - corners[:, 1 % c] if c > 3 else corners[:, 2] - corners[:, 0]
    )
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    colour = np.asarray(albedo, dtype=np.float32)
    colour = colour[:, None, :] if colour.ndim == 2 else colour
    fan = np.array([[0, i, i + 1] for i in range(1, c - 1)])
    return Mesh(
        vertices_m=corners.reshape(-1, 3).astype(np.float32),
        normals=np.repeat(normals, c, axis=0).astype(np.float32),
        albedo=np.ascontiguousarray(np.broadcast_to(colour, (k, c, 3))).reshape(-1, 3),
        surface=np.full(k * c, surface, dtype=np.uint8),
        faces=(np.arange(k)[:, None, None] * c + fan).reshape(-1, 3).astype(np.int32),
    )


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Products (k, 3) at right angles to vectors (k, 3). NumPy's own spends more time on its arguments than on a small mesh."""
    product: FloatArray = np.empty(a.shape)
    for axis in range(3):
        one, other = (axis + 1) % 3, (axis + 2) % 3
        product[:, axis] = a[:, one] * b[:, other] - a[:, other] * b[:, one]
    return product


def turned(local: FloatArray, origin_m: FloatArray, yaw_rad: FloatArray) -> FloatArray:
    """Local points (k, c, 3) turned by yaw (k,) and moved to (k, 2) or (k, 3)."""
    cos, sin = np.cos(yaw_rad)[:, None], np.sin(yaw_rad)[:, None]
    x = cos * local[..., 0] - sin * local[..., 1] + origin_m[:, 0, None]
    y = sin * local[..., 0] + cos * local[..., 1] + origin_m[:, 1, None]
    z = local[..., 2] + (origin_m[:, 2, None] if origin_m.shape[1] == 3 else 0.0)
    return np.stack(np.broadcast_arrays(x, y, z), axis=-1)


def placed(
    local_m: FloatArray, centre_m: FloatArray, yaw_rad: FloatArray, albedo: FloatArray, surface: Surface = Surface.MINERAL
) -> Mesh:
    """Polygons (k, f, c, 3) in the axes of k things, whose colours (k, 3) they take."""
    k, f, c, _ = local_m.shape
    world = turned(local_m.reshape(k, f * c, 3), centre_m, yaw_rad)
    return polygons(world.reshape(k * f, c, 3), np.repeat(albedo, f, axis=0), surface)


# Corners of a unit box's faces (length -0.5..0.5, width -0.5..0.5, height 0..1): front, left, back, right, top.
BOX_FACES = np.array(
    [
        [[0.5, -0.5, 0], [0.5, 0.5, 0], [0.5, 0.5, 1], [0.5, -0.5, 1]],
        [[0.5, 0.5, 0], [-0.5, 0.5, 0], [-0.5, 0.5, 1], [0.5, 0.5, 1]],
        [[-0.5, 0.5, 0], [-0.5, -0.5, 0], [-0.5, -0.5, 1], [-0.5, 0.5, 1]],
        [[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, -0.5, 1], [-0.5, -0.5, 1]],
        [[-0.5, -0.5, 1], [0.5, -0.5, 1], [0.5, 0.5, 1], [-0.5, 0.5, 1]],
    ]
)


def boxes(
    origin_m: FloatArray, yaw_rad: FloatArray, size_m: FloatArray, albedo: FloatArray, surface: Surface = Surface.MINERAL
) -> Mesh:
    """Upright boxes without a bottom: origin (k, 2) or (k, 3) at the centre of the base, size (k, 3) length, width, height."""
    k = len(origin_m)
    local = BOX_FACES.reshape(1, 20, 3) * size_m[:, None, :]
    corners = turned(local, origin_m, yaw_rad).reshape(k * 5, 4, 3)
    colour = np.repeat(np.broadcast_to(albedo, (k, 3)), 5, axis=0)
    return polygons(corners, colour, surface)


def instances(template: Mesh, origin_m: FloatArray, yaw_rad: FloatArray, scale: FloatArray, tint: FloatArray) -> Mesh:
    """Copies of a template at (k, 2), scaled by (k, 3) along its own axes, its albedo multiplied by tint (k, 3)."""
    k, n = len(origin_m), len(template.vertices_m)
    vertices = turned(template.vertices_m[None] * scale[:, None, :], origin_m, yaw_rad)
    normals = turned(template.normals[None] / scale[:, None, :], np.zeros((k, 3)), yaw_rad)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    return Mesh(
        vertices_m=vertices.reshape(-1, 3).astype(np.float32),
        normals=normals.reshape(-1, 3).astype(np.float32),
        albedo=np.clip(template.albedo[None] * tint[:, None, :], 0.0, 1.0).reshape(-1, 3).astype(np.float32),
        surface=np.tile(template.surface, k),
        faces=(np.arange(k)[:, None, None] * n + template.faces).reshape(-1, 3).astype(np.int32),
    )
