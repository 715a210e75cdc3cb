"""Trees of several shapes, bushes, hedges and stone walls, tree lines at the horizon."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
import shapely

from hippodrome.core.types import FloatArray, IntArray
from hippodrome.sim.scene.mesh import Mesh, Surface, instances, merge, placed, polygons
from hippodrome.sim.scene.placement import Border, Shapes, clear_of, quilt, rectangles, spread

ROUND, BROAD, POPLAR, SPRUCE, PINE, BUSH = range(6)
# Shape: height [m] from..to, crown radius [m] from..to.
TREES: Final = np.array(
    [
        [5.0, 8.5, 2.0, 3.2],
        [8.0, 13.0, 3.4, 5.2],
        [11.0, 17.0, 1.2, 2.0],
        [7.0, 15.0, 2.0, 3.4],
        [8.0, 12.0, 2.2, 3.2],
        [1.0, 2.4, 0.8, 1.8],
    ]
)
MIX: Final = np.array([0.26, 0.22, 0.08, 0.14, 0.08, 0.22])
BARK: Final = np.array([0.33, 0.26, 0.20])
BRANCH_CLEARANCE_M: Final = 0.4  # between a crown and the asphalt, the walls and other crowns' trunks
HEDGE_STEP_M: Final = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Trees:
    """k trees and bushes."""

    shape: IntArray  # (k,)
    foot_m: FloatArray  # (k, 2)
    height_m: FloatArray  # (k,)
    radius_m: FloatArray  # (k,) of the crown

    def select(self, rows: np.ndarray) -> Trees:
        return Trees(self.shape[rows], self.foot_m[rows], self.height_m[rows], self.radius_m[rows])


def place_trees(border: Border, roads: Shapes, taken: Shapes, rng: np.random.Generator) -> Trees:
    """Gardens and verges near the road, groves behind; dense and bare stretches alternate."""
    near = _propose(border, 7.0, (1.5, 9.0), 45.0, 0.42, rng)
    far = _propose(border, 7.0, (10.0, 60.0), 70.0, 0.40, rng)
    proposed = Trees(*(np.concatenate([getattr(near, name), getattr(far, name)]) for name in Trees.__slots__))
    points = shapely.points(proposed.foot_m)
    reach = proposed.radius_m + BRANCH_CLEARANCE_M
    proposed = proposed.select(clear_of(points, roads, reach) & clear_of(points, taken, 0.6 * reach))
    return proposed.select(spread(shapely.points(proposed.foot_m), 2.2))


def _propose(
    border: Border, spacing_m: float, setback_m: tuple[float, float], grove_m: float, share: float, rng: np.random.Generator
) -> Trees:
    site = border.draw(spacing_m, rng)
    foot = site.point_m + site.outward * rng.uniform(*setback_m, len(site.length_m))[:, None]
    wooded = quilt(foot, grove_m, rng) < share
    foot = foot[wooded]
    k = len(foot)
    # Neighbours are often of one kind: a slow field shifts the draw.
    ticket = np.mod(0.55 * quilt(foot, 90.0, rng) + 0.45 * rng.random(k), 1.0)
    shape = np.minimum(np.searchsorted(np.cumsum(MIX), ticket), len(MIX) - 1).astype(np.int32)
    low, high = TREES[shape, 0::2], TREES[shape, 1::2]
    height, radius = (low + rng.random((k, 2)) * (high - low)).T
    return Trees(shape=shape, foot_m=foot, height_m=height, radius_m=radius)


def tree_mesh(trees: Trees, rng: np.random.Generator) -> Mesh:
    """Copies of a few crooked templates, each turned, stretched and tinted."""
    k = len(trees.shape)
    variant, yaw = rng.integers(VARIANTS, size=k), rng.uniform(0.0, 2.0 * np.pi, k)
    tint = rng.uniform(0.78, 1.2, (k, 1)) * rng.uniform(0.92, 1.08, (k, 3))
    scale = np.stack([trees.radius_m, trees.radius_m, trees.height_m], axis=1)
    parts = []
    for shape in range(len(TREES)):
        for v in range(VARIANTS):
            rows = np.flatnonzero((trees.shape == shape) & (variant == v))
            parts.append(instances(_template(shape, v), trees.foot_m[rows], yaw[rows], scale[rows], tint[rows]))
    return merge(parts)


VARIANTS: Final = 3


@cache
def _template(shape: int, variant: int) -> Mesh:
    """A tree of crown radius 1 and height 1."""
    rng = np.random.default_rng([shape, variant])
    green = {SPRUCE: [0.16, 0.30, 0.18], PINE: [0.20, 0.33, 0.20], POPLAR: [0.30, 0.44, 0.18]}.get(shape, [0.27, 0.42, 0.16])
    leaf = Surface.NEEDLE if shape in (SPRUCE, PINE) else Surface.LEAF
    albedo = np.array(green)
    if shape == ROUND:
        parts = [_blob([0, 0, 0.60], [1.05, 1.05, 0.44], 7, albedo, leaf, rng), _trunk(0.06, 0.4)]
    elif shape == BROAD:
        lobes = [([-0.1, 0.1, 0.62], [0.95, 0.90, 0.42]), ([0.35, -0.35, 0.46], [0.75, 0.75, 0.26])]
        parts = [*(_blob(c, r, n, albedo, leaf, rng) for (c, r), n in zip(lobes, (7, 6), strict=True)), _trunk(0.06, 0.4)]
    elif shape == POPLAR:
        parts = [_blob([0, 0, 0.54], [1.05, 1.05, 0.50], 6, albedo, leaf, rng), _trunk(0.12, 0.2)]
    elif shape == SPRUCE:
        tiers = ((0.10, 0.62, 1.0), (0.42, 0.85, 0.72), (0.68, 1.0, 0.42))
        parts = [*(_cone(low, high, radius, 7, albedo, leaf, rng) for low, high, radius in tiers), _trunk(0.08, 0.15)]
    elif shape == PINE:
        parts = [_blob([0.1, 0, 0.74], [1.05, 0.95, 0.29], 7, albedo, leaf, rng), _trunk(0.07, 0.6)]
    else:
        parts = [_blob([0, 0, 0.42], [1.0, 1.0, 0.56], 6, albedo, leaf, rng)]
    return merge(parts)


def _blob(
    centre: list[float], radii: list[float], sides: int, albedo: FloatArray, surface: Surface, rng: np.random.Generator
) -> Mesh:
    """A lumpy ellipsoid, darker below as under a crown."""
    latitude = np.radians([-90.0, -35.0, 15.0, 55.0, 90.0])
    longitude = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.stack(
        [
            np.stack(
                [np.cos(a) * np.cos(longitude + 0.4 * i), np.cos(a) * np.sin(longitude + 0.4 * i), np.full(sides, np.sin(a))], 1
            )
            for i, a in enumerate(latitude[1:-1])
        ]
    )
    unit = np.concatenate([[[0.0, 0.0, -1.0]], ring.reshape(-1, 3), [[0.0, 0.0, 1.0]]])
    lump = rng.uniform(0.80, 1.0, (len(unit), 1))
    shade = 0.72 + 0.14 * (unit[:, 2:] + 1.0) + rng.uniform(-0.10, 0.10, (len(unit), 1))
    normals = unit / np.array(radii)
    return Mesh(
        vertices_m=(unit * lump * radii + centre).astype(np.float32),
        normals=(normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32),
        albedo=(albedo * shade).astype(np.float32),
        surface=np.full(len(unit), surface, dtype=np.uint8),
        faces=_globe_faces(sides, rings=len(latitude) - 2),
    )


def _globe_faces(sides: int, rings: int) -> IntArray:
    """Triangles of a pole, ``rings`` rings of ``sides`` vertices, and a pole."""
    here = np.arange(sides)
    after = (here + 1) % sides
    top, last = 1 + sides * rings, 1 + sides * (rings - 1)
    faces = [
        np.stack([np.zeros(sides, int), 1 + after, 1 + here], 1),
        np.stack([last + here, last + after, np.full(sides, top)], 1),
    ]
    for ring in range(rings - 1):
        low, high = 1 + ring * sides, 1 + (ring + 1) * sides
        faces += [np.stack([low + here, low + after, high + after], 1), np.stack([low + here, high + after, high + here], 1)]
    return np.concatenate(faces).astype(np.int32)


def _cone(
    low: float, high: float, radius: float, sides: int, albedo: FloatArray, surface: Surface, rng: np.random.Generator
) -> Mesh:
    """One tier of a conifer with a closed underside."""
    angle = 2.0 * np.pi * np.arange(sides) / sides + rng.uniform(0.0, 1.0)
    reach = radius * rng.uniform(0.82, 1.0, sides)
    rim = np.stack([reach * np.cos(angle), reach * np.sin(angle), np.full(sides, low)], axis=1)
    after = np.roll(rim, -1, axis=0)
    apex = np.broadcast_to([0.0, 0.0, high], rim.shape)
    under = np.broadcast_to([0.0, 0.0, low], rim.shape)
    bright = albedo * rng.uniform(0.9, 1.1, (sides, 1))
    return merge(
        [
            polygons(np.stack([rim, after, apex], 1), bright, surface),
            polygons(np.stack([after, rim, under], 1), 0.6 * albedo, surface),
        ]
    )


def _trunk(radius: float, height: float) -> Mesh:
    angle = 2.0 * np.pi * np.arange(4) / 4
    rim = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    after = np.roll(rim, -1, axis=0)
    foot, top = np.zeros((4, 1)), np.full((4, 1), height)
    corners = np.stack([np.hstack([rim, foot]), np.hstack([after, foot]), np.hstack([after, top]), np.hstack([rim, top])], axis=1)
    return polygons(corners, BARK)


def hedge_mesh(border: Border, roads: Shapes, obstacles: Shapes, rng: np.random.Generator) -> tuple[Mesh, Shapes]:
    """Hedges and low stone walls along the road's edge, and the ground that they take."""
    site = border.draw(30.0, rng)
    k = len(site.length_m)
    steps = rng.integers(3, 10, k)
    centre = site.point_m + site.outward * rng.uniform(1.7, 3.5, k)[:, None]
    yaw = site.inward_yaw_rad()
    shapes = rectangles(centre, yaw, HEDGE_STEP_M * steps.astype(np.float64), np.full(k, 1.2))
    free = np.flatnonzero(clear_of(shapes, roads, 0.4) & clear_of(shapes, obstacles, 0.4))
    free = free[spread(shapes[free], 1.0)]
    is_wall = rng.random(k) < 0.25
    height, count = np.where(is_wall, rng.uniform(0.6, 1.1, k), rng.uniform(0.8, 2.0, k)), steps[free]
    owner = np.repeat(free, count)
    step = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    profile = height[owner] * np.where(is_wall[owner], 1.0, rng.uniform(0.8, 1.15, len(owner)))
    half_width = np.where(is_wall[owner], 0.18, rng.uniform(0.38, 0.55, len(owner)))
    parts = []
    for wall in (False, True):
        rows = is_wall[owner] == wall
        x0 = (step - 0.5 * steps[owner])[rows] * HEDGE_STEP_M
        local = _prism(x0, half_width[rows], profile[rows])
        albedo = (np.array([0.52, 0.50, 0.46]) if wall else np.array([0.22, 0.36, 0.15])) * rng.uniform(
            0.85, 1.15, (int(rows.sum()), 1)
        )
        parts.append(placed(local, centre[owner[rows]], yaw[owner[rows]], albedo, Surface.MINERAL if wall else Surface.LEAF))
    return merge(parts), shapes[free]


def _prism(x0: FloatArray, half_width: FloatArray, height: FloatArray) -> FloatArray:
    """Faces (k, 5, 4, 3) of blocks one step long, narrower at the top: right, left, top and both ends."""
    low, high = np.stack([half_width, 0.0 * height], 1), np.stack([0.75 * half_width, height], 1)
    x1 = x0 + HEDGE_STEP_M

    def corner(x: FloatArray, side: int, yz: FloatArray) -> FloatArray:
        return np.stack([x, side * yz[:, 0], yz[:, 1]], axis=1)

    right = [corner(x0, -1, low), corner(x1, -1, low), corner(x1, -1, high), corner(x0, -1, high)]
    left = [corner(x1, 1, low), corner(x0, 1, low), corner(x0, 1, high), corner(x1, 1, high)]
    top = [corner(x0, -1, high), corner(x1, -1, high), corner(x1, 1, high), corner(x0, 1, high)]
    front = [corner(x1, -1, low), corner(x1, 1, low), corner(x1, 1, high), corner(x1, -1, high)]
    back = [corner(x0, 1, low), corner(x0, -1, low), corner(x0, -1, high), corner(x0, 1, high)]
    return np.stack([np.stack(face, axis=1) for face in (right, left, top, front, back)], axis=1)


def treeline_mesh(border: Border, roads: Shapes, rng: np.random.Generator, outside: Shapes) -> Mesh:
    """Ragged walls of wood far behind the road and clear of what lies outside: the horizon is rarely bare."""
    site = border.draw(45.0, rng)
    k, segments = len(site.length_m), 10
    centre = site.point_m + site.outward * rng.uniform(75.0, 190.0, k)[:, None]
    yaw, length = rng.uniform(0.0, np.pi, k), rng.uniform(30.0, 80.0, k)
    shapes = rectangles(centre, yaw, length, np.full(k, 8.0))
    free = np.flatnonzero(clear_of(shapes, roads, 55.0) & clear_of(shapes, outside, 2.0))
    free = free[spread(shapes[free], 12.0)]
    x = (np.linspace(-0.5, 0.5, segments + 1) * length[free, None])[..., None]
    bend = 6.0 * rng.uniform(-1.0, 1.0, (len(free), 1)) * np.cos(np.linspace(-1.5, 1.5, segments + 1))
    top = rng.uniform(7.0, 13.0, (len(free), 1)) * rng.uniform(0.7, 1.0, (len(free), segments + 1))
    top[:, [0, -1]] *= 0.35
    foot = np.concatenate([x, bend[..., None], np.zeros_like(x)], axis=2)
    crown = np.concatenate([x, bend[..., None], top[..., None]], axis=2)
    near = np.stack([foot[:, :-1], foot[:, 1:], crown[:, 1:], crown[:, :-1]], axis=2)
    both = np.concatenate([near, near[:, :, ::-1]], axis=1)
    albedo = np.array([0.20, 0.32, 0.15]) * rng.uniform(0.8, 1.2, (len(free), 1))
    mesh = placed(both, centre[free], yaw[free], albedo, Surface.LEAF)
    upward = np.array([0.0, 0.0, 0.6], dtype=np.float32)  # leaves face the sky as much as the viewer
    normals = mesh.normals + upward
    return Mesh(mesh.vertices_m, normals / np.linalg.norm(normals, axis=1, keepdims=True), mesh.albedo, mesh.surface, mesh.faces)
