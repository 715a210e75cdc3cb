"""The geometry of a town, from the town and a seed alone."""

from __future__ import annotations

import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.sim.scene.mesh import Mesh, Surface, boxes, merge, polygons
from hippodrome.sim.scene.roads import road_mesh
from hippodrome.sim.types import Town


def town_mesh(town: Town, seed: int, origin_m: FloatArray) -> tuple[Mesh, Mesh]:
    """Bold parts, drawn at any distance, and fine ones, relative to the origin."""
    rng = np.random.default_rng(seed)
    road_bold, road_fine = road_mesh(town, origin_m, rng)
    low, high = town.network.points_m.min(0) - origin_m - 200, town.network.points_m.max(0) - origin_m + 200
    n = 400
    xy = rng.uniform(low, high, (n, 2))
    from scipy.spatial import KDTree

    keep = KDTree(town.network.points_m - origin_m).query(xy)[0] > 20
    house = boxes(
        xy[keep], rng.uniform(0, 3, keep.sum()), rng.uniform(6, 14, (keep.sum(), 3)), rng.uniform(0.4, 0.9, (keep.sum(), 3))
    )
    gx, gy = np.meshgrid(np.arange(low[0], high[0], 20.0), np.arange(low[1], high[1], 20.0))
    c = np.stack([gx.ravel(), gy.ravel(), np.zeros(gx.size)], 1)
    q = c[:, None, :] + np.array([[0, 0, 0], [20, 0, 0], [20, 20, 0], [0, 20, 0]])
    ground = polygons(q, np.array([0.36, 0.47, 0.24]) * rng.uniform(0.9, 1.1, (len(q), 1)), Surface.GRASS)
    return merge([road_bold, house, ground]), road_fine
