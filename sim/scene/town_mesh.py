"""The geometry of a town, from the town and a seed alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.sim.scene.buildings import building_mesh, place_buildings
from hippodrome.sim.scene.furniture import furniture_mesh
from hippodrome.sim.scene.land import field_mesh, ground_mesh, patch_mesh, place_fields
from hippodrome.sim.scene.lanes import cut_lanes
from hippodrome.sim.scene.mesh import Mesh, merge
from hippodrome.sim.scene.placement import borders, paved_area, quilt
from hippodrome.sim.scene.roads import road_mesh
from hippodrome.sim.scene.vegetation import hedge_mesh, place_trees, tree_mesh, treeline_mesh
from hippodrome.sim.types import Town

DISTRICT_M: Final = 260.0  # over which a town changes its character
RURAL_SHARE, TOWN_SHARE = 0.12, 0.75  # of built-up character, for towns called rural and for the others


def town_mesh(town: Town, seed: int, origin_m: FloatArray) -> tuple[Mesh, Mesh]:
    """Bold parts, drawn at any distance, and fine ones, relative to the origin. Each kind of thing has its own random stream."""
    district, road, build, plant, hedge, field, post, ground = np.random.default_rng(seed).spawn(8)
    share = _town_share(town, district)
    pieces = cut_lanes(town.network, origin_m)
    border, paved = borders(pieces, town.network.is_internal), paved_area(town, origin_m)[0]
    fields = place_fields(border, share(border.point_m), paved, field)
    buildings = place_buildings(border, share(border.point_m), paved, fields.footprints(), build)
    built = np.concatenate([buildings.footprints(), fields.footprints()])
    trees = place_trees(border, paved, built, plant)
    hedges, hedge_ground = hedge_mesh(border, paved, built, hedge)
    taken = np.concatenate([built, hedge_ground])
    signals = town.signals_m - [*origin_m, 0.0]
    posts = furniture_mesh(border, share(border.point_m), signals, town.left_hand, paved, taken, post)
    road_bold, road_fine = road_mesh(town, origin_m, share, road)
    house_bold, house_fine = building_mesh(buildings, build)
    field_bold, field_fine = field_mesh(fields, field)
    treelines = treeline_mesh(border, paved, plant)
    land = ground_mesh(pieces.middle_m(), ground)
    # What hides other things comes first: the depth test then spares the shading of what is hidden, the ground last of all.
    bold = merge([house_bold, hedges, road_bold, tree_mesh(trees, plant), treelines, field_bold, land])
    return bold, merge([house_fine, posts, road_fine, field_fine, patch_mesh(border, ground)])


def _town_share(town: Town, rng: np.random.Generator) -> Callable[[FloatArray], FloatArray]:
    """How much of a town it is at (k, 2), 0..1: districts of a few hundred metres around the mean for this kind of town."""
    mean = RURAL_SHARE if "rural" in town.name.lower() else TOWN_SHARE
    seed = int(rng.integers(2**63))

    def share(points_m: FloatArray) -> FloatArray:
        return (quilt(points_m, DISTRICT_M, np.random.default_rng(seed)) < mean).astype(np.float64) * 0.85

    return share
