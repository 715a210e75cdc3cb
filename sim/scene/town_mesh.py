"""The geometry of a town, from the town and a seed alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.sim.scene.blocks import BESIDE_M, GROUND_M, HORIZON_M, Block, town_near
from hippodrome.sim.scene.buildings import Buildings, building_mesh, place_buildings
from hippodrome.sim.scene.furniture import furniture_mesh
from hippodrome.sim.scene.land import Fields, field_mesh, ground_mesh, patch_mesh, place_fields
from hippodrome.sim.scene.lanes import cut_lanes
from hippodrome.sim.scene.mesh import Mesh, merge
from hippodrome.sim.scene.placement import Bools, Border, Shapes, borders, other_lanes, paved_area, quilt
from hippodrome.sim.scene.relief import Relief, relief_of
from hippodrome.sim.scene.roads import road_mesh
from hippodrome.sim.scene.vegetation import hedge_mesh, place_trees, tree_mesh, treeline_mesh
from hippodrome.sim.types import Town

DISTRICT_M: Final = 260.0  # over which a town changes its character
RURAL_SHARE, TOWN_SHARE = 0.12, 0.75  # of built-up character, for towns called rural and for the others


@dataclass(frozen=True, slots=True, eq=False)
class Land:
    """A town, or the part of it around one block, and the land along its roads, relative to the scene's origin."""

    town: Town
    border: Border  # where the land begins
    horizon: Border  # along which tree lines are placed
    road_points_m: FloatArray  # (n, 2) every few metres along all lanes
    relief: Relief | None = None  # the ground's height; None: it is flat
    block: Block | None = None  # where things may stand; None: everywhere

    def holds(self, points_m: FloatArray) -> Bools:
        """Whether each point (k, 2) lies where things may stand."""
        return np.ones(len(points_m), dtype=np.bool_) if self.block is None else self.block.holds(points_m)


def land_of(town: Town, origin_m: FloatArray) -> Land:
    """The land along all roads of a town."""
    pieces = cut_lanes(town.network, origin_m, town.heights_m)
    border = borders(pieces, town.network.is_internal)
    return Land(town, border, border, pieces.middle_m(), None if town.heights_m is None else relief_of(pieces))


def town_mesh(town: Town, seed: int, origin_m: FloatArray) -> tuple[Mesh, Mesh]:
    """Bold parts, drawn at any distance, and fine ones, relative to the origin. Each kind of thing has its own random stream."""
    return _mesh(land_of(town, origin_m), np.random.default_rng(seed).spawn(8), origin_m)


def block_mesh(land: Land, seed: int, origin_m: FloatArray, block: Block) -> tuple[Mesh, Mesh]:
    """The same of one block of a large town, of whose land at least all must be given that lies up to ``GROUND_M`` outside.

    Districts, the roads' tones and the ground's are the whole town's; all else comes from the block's own stream.
    """
    whole, own = np.random.default_rng(seed).spawn(8), block.stream(seed).spawn(8)
    near = _land_near(land, origin_m, block)
    if len(near.road_points_m) == 0:
        return merge([]), merge([])
    if near.town.network.lane_count == 0:
        paved = np.zeros(0, dtype=object)
        return _lifted(
            merge([treeline_mesh(near.horizon, paved, own[3], block.outside()), _ground(near, whole[7])]), near
        ), merge([])
    return _mesh(near, [*whole[:2], *own[2:7], whole[7]], origin_m)


def _land_near(land: Land, origin_m: FloatArray, block: Block) -> Land:
    """The part of the land that a block and what is seen in it need."""
    border_m, points_m = land.border.point_m, land.road_points_m
    return Land(
        town=town_near(land.town, origin_m, [block], BESIDE_M),
        border=land.border.select(block.holds(border_m, BESIDE_M)),
        horizon=land.border.select(block.holds(border_m, HORIZON_M)),
        road_points_m=points_m[block.holds(points_m, GROUND_M)],
        relief=land.relief,
        block=block,
    )


def building_footprints(land: Land, seed: int, origin_m: FloatArray, block: Block | None = None) -> Shapes:
    """Outlines of the buildings of ``town_mesh`` or, with a block, of ``block_mesh``, relative to the origin."""
    whole = np.random.default_rng(seed).spawn(8)
    streams = whole if block is None else block.stream(seed).spawn(8)
    near = land if block is None else _land_near(land, origin_m, block)
    if near.town.network.lane_count == 0 or len(near.road_points_m) == 0:
        return np.zeros(0, dtype=object)
    roads = np.concatenate(_obstacles(near, origin_m))
    return _fields_and_buildings(near, _town_share(near.town, whole[0]), roads, streams[5], streams[2])[1].footprints()


def _obstacles(land: Land, origin_m: FloatArray) -> tuple[Shapes, Shapes]:
    """All that is paved, and all that lies outside of the land's block."""
    paved = np.concatenate([paved_area(land.town, origin_m)[0], other_lanes(land.town, origin_m)])
    return paved, np.zeros(0, dtype=object) if land.block is None else land.block.outside()


def _fields_and_buildings(
    land: Land,
    share: Callable[[FloatArray], FloatArray],
    roads: Shapes,
    field: np.random.Generator,
    build: np.random.Generator,
) -> tuple[Fields, Buildings]:
    """What is placed first; all else stands clear of it."""
    fields = place_fields(land.border, share(land.border.point_m), roads, field)
    return fields, place_buildings(land.border, share(land.border.point_m), roads, fields.footprints(), build)


def _mesh(land: Land, streams: Sequence[np.random.Generator], origin_m: FloatArray) -> tuple[Mesh, Mesh]:
    """What stands on the land, and the surfaces whose middles lie on it."""
    district, road, build, plant, hedge, field, post, ground = streams
    town, border, share = land.town, land.border, _town_share(land.town, district)
    paved, outside = _obstacles(land, origin_m)
    fields, buildings = _fields_and_buildings(land, share, np.concatenate([paved, outside]), field, build)
    built = np.concatenate([buildings.footprints(), fields.footprints(), outside])
    trees = place_trees(border, paved, built, plant)
    hedges, hedge_ground = hedge_mesh(border, paved, built, hedge)
    taken = np.concatenate([built, hedge_ground])
    signals = (town.signals_m - [*origin_m, 0.0])[land.holds(town.signals_m[:, :2] - origin_m)]
    posts = furniture_mesh(border, share(border.point_m), signals, town.left_hand, paved, taken, post)
    road_bold, road_fine = (_inside(mesh, land) for mesh in road_mesh(town, origin_m, share, road, land.relief))
    house_bold, house_fine = building_mesh(buildings, build)
    field_bold, field_fine = field_mesh(fields, field)
    treelines = treeline_mesh(land.horizon, paved, plant, outside)
    grass = _ground(land, ground)
    # What hides other things comes first: the depth test then spares the shading of what is hidden, the ground last of all.
    over, under = merge([house_bold, hedges]), [tree_mesh(trees, plant), treelines, field_bold, grass]
    verge = border.select(land.holds(border.point_m))
    stand, lie = merge([house_fine, posts]), [field_fine, patch_mesh(verge, ground)]
    if land.relief is not None:  # fields and patches are too flat for a ground that is not
        under, lie = [part for part in under if part is not field_bold], []
    lifted = (_lifted(merge(parts), land) for parts in ([over], under, [stand], lie))
    over, low, stand, flat = lifted
    return merge([over, road_bold, low]), merge([stand, road_fine, flat])


def _lifted(mesh: Mesh, land: Land) -> Mesh:
    return mesh if land.relief is None else land.relief.lifted(mesh)


def _ground(land: Land, rng: np.random.Generator) -> Mesh:
    return ground_mesh(land.road_points_m, rng, land.holds)


def _inside(mesh: Mesh, land: Land) -> Mesh:
    """The faces whose middles lie where things may stand."""
    if land.block is None:
        return mesh
    return replace(mesh, faces=mesh.faces[land.holds(mesh.vertices_m[mesh.faces].mean(axis=1, dtype=np.float64)[:, :2])])


def _town_share(town: Town, rng: np.random.Generator) -> Callable[[FloatArray], FloatArray]:
    """How much of a town it is at (k, 2), 0..1: districts of a few hundred metres around the mean for this kind of town."""
    mean = RURAL_SHARE if town.rural else TOWN_SHARE
    seed = int(rng.integers(2**63))

    def share(points_m: FloatArray) -> FloatArray:
        return (quilt(points_m, DISTRICT_M, np.random.default_rng(seed)) < mean).astype(np.float64) * 0.85

    return share
