"""The buildings of the scene, as obstacles."""

from __future__ import annotations

import numpy as np
import shapely

from hippodrome.core.types import FloatArray
from hippodrome.sim.loop.contact import EGO_SIZE_M, corners_m, ego_box
from hippodrome.sim.scene.blocks import BLOCK_M, Block, is_drawn_whole
from hippodrome.sim.scene.town_mesh import Land, building_footprints, land_of
from hippodrome.sim.types import Town


class Walls:
    """Says whether the ego touches a building. Places are worked out when they are first asked for: few drive there."""

    def __init__(self, town: Town, seed: int, origin_m: FloatArray) -> None:
        self._town, self._seed, self._origin_m = town, seed, origin_m
        self._land: Land | None = None
        self._trees: dict[Block | None, shapely.STRtree] = {}

    def touch(self, pose_m: tuple[float, float, float]) -> bool:
        """Whether the ego's body overlaps a building."""
        body = shapely.Polygon(corners_m(ego_box(pose_m), EGO_SIZE_M)[0] - self._origin_m)
        if is_drawn_whole(self._town):
            return len(self._tree(None).query(body, predicate="intersects")) > 0
        at = np.floor((np.array(pose_m[:2]) - self._origin_m) / BLOCK_M).astype(np.int64).tolist()
        near = [Block(at[0] + dx, at[1] + dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1)]
        near = [block for block in near if bool(block.holds(np.array([pose_m[:2]]) - self._origin_m, 10.0)[0])]
        return any(len(self._tree(block).query(body, predicate="intersects")) > 0 for block in near)

    def _tree(self, block: Block | None) -> shapely.STRtree:
        if block not in self._trees:
            self._land = self._land or land_of(self._town, self._origin_m)
            shapes = building_footprints(self._land, self._seed, self._origin_m, block)
            self._trees[block] = shapely.STRtree(shapes)
        return self._trees[block]
