"""Where things may stand: along the road's borders, off the road, and clear of one another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.special import ndtr

from hippodrome.core.types import FloatArray
from hippodrome.sim.scene.lanes import Beside, Pieces, beside
from hippodrome.sim.types import Town

Bools: TypeAlias = NDArray[np.bool_]
Shapes: TypeAlias = NDArray[np.object_]  # of shapely geometries


@dataclass(frozen=True, slots=True, eq=False)
class Border:
    """B pieces of the road's outer border, where the land begins."""

    point_m: FloatArray  # (B, 2) middle
    outward: FloatArray  # (B, 2) unit, away from the road
    length_m: FloatArray  # (B,)

    def select(self, rows: np.ndarray) -> Border:
        return Border(self.point_m[rows], self.outward[rows], self.length_m[rows])

    def inward_yaw_rad(self) -> FloatArray:
        """Yaw (B,) that turns a thing's own y axis, its front, to the road."""
        yaw: FloatArray = np.arctan2(-self.outward[:, 1], -self.outward[:, 0]) - 0.5 * np.pi
        return yaw

    def draw(self, spacing_m: float | FloatArray, rng: np.random.Generator) -> Border:
        """A random selection with one piece per ``spacing_m`` (scalar or (B,)) of border on average, in random order."""
        chosen = np.flatnonzero(rng.random(len(self.length_m)) < self.length_m / spacing_m)
        return self.select(rng.permutation(chosen))


def borders(pieces: Pieces, is_internal: Bools) -> Border:
    """The outer border of all roads, junctions left out."""
    parts = []
    for side in (1, -1):
        edge = (beside(pieces, is_internal, side)[0] == Beside.NOTHING) & ~is_internal[pieces.lane]
        piece = pieces.select(edge)
        outward = side * piece.left_normal()
        length = np.linalg.norm(piece.end_m - piece.start_m, axis=1)
        parts.append((piece.middle_m() + outward * piece.half_width_m[:, None], outward, length))
    return Border(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def paved_area(town: Town, origin_m: FloatArray) -> tuple[Shapes, Shapes]:
    """Polygons of all that is paved (lanes and junctions), and of the junctions alone."""
    network = town.network
    owner = np.repeat(np.arange(network.lane_count), np.diff(network.point_start))
    centrelines = shapely.linestrings(network.points_m - origin_m, indices=owner)
    lanes = shapely.buffer(centrelines, 0.5 * network.width_m, cap_style="flat", join_style="mitre", mitre_limit=2.0)
    outlines = np.array([shapely.Polygon(outline - origin_m) for outline in town.junction_polygons_m], dtype=object)
    junctions: Shapes = shapely.make_valid(outlines)
    return np.concatenate([lanes, junctions, turning_places(town, origin_m)]), junctions


def turning_places(town: Town, origin_m: FloatArray) -> Shapes:
    """Polygons of the paving at dead ends."""
    return np.array([shapely.Polygon(outline - origin_m) for outline in town.turning_places_m], dtype=object)


def other_lanes(town: Town, origin_m: FloatArray) -> Shapes:
    """Polygons of the lanes that are closed to cars: nothing stands on them either."""
    outlines = np.array([shapely.Polygon(outline - origin_m) for outline in town.other_lanes_m], dtype=object)
    shapes: Shapes = shapely.make_valid(outlines)
    return shapes


def rectangles(centre_m: FloatArray, yaw_rad: FloatArray, length_m: FloatArray, width_m: FloatArray) -> Shapes:
    """Footprints (k,) as polygons."""
    x = 0.5 * length_m[:, None] * np.array([1, 1, -1, -1])
    y = 0.5 * width_m[:, None] * np.array([-1, 1, 1, -1])
    cos, sin = np.cos(yaw_rad)[:, None], np.sin(yaw_rad)[:, None]
    corners = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1) + centre_m[:, None, :]
    shapes: Shapes = shapely.polygons(corners)
    return shapes


def clear_of(shapes: Shapes, obstacles: Shapes, distance_m: float | FloatArray) -> Bools:
    """Which shapes (k,) keep their distance (scalar or (k,)) from every obstacle."""
    clear = np.ones(len(shapes), dtype=bool)
    if len(shapes) and len(obstacles):
        hits = shapely.STRtree(obstacles).query(shapes, predicate="dwithin", distance=distance_m)
        clear[hits[0]] = False
    return clear


def spread(shapes: Shapes, distance_m: float) -> Bools:
    """Which shapes stay when the earlier one wins wherever two come closer than ``distance_m``."""
    stays = np.ones(len(shapes), dtype=bool)
    if len(shapes) == 0:
        return stays
    later, earlier = shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=distance_m)
    rival = later > earlier
    order = np.lexsort((earlier[rival], later[rival]))
    for one, other in zip(later[rival][order].tolist(), earlier[rival][order].tolist(), strict=True):
        if stays[other]:
            stays[one] = False
    return stays


def quilt(points_m: FloatArray, scale_m: float, rng: np.random.Generator) -> FloatArray:
    """A smooth random field at (k, 2), uniform in 0..1 and correlated over about ``scale_m``: a sum of random plane waves."""
    waves = 12  # enough for the sum to be close to normal
    direction = rng.uniform(0.0, 2.0 * np.pi, waves)
    number = 2.0 * np.pi / scale_m * rng.uniform(0.35, 1.0, waves)
    phase = rng.uniform(0.0, 2.0 * np.pi, waves)
    argument = points_m @ (number * np.stack([np.cos(direction), np.sin(direction)])) + phase
    field: FloatArray = ndtr(np.cos(argument).sum(axis=1) / np.sqrt(0.5 * waves))
    return field
