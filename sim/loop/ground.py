"""What lies below the ego: the lanes near it, which of them it is on, and whether its wheels stand on the road."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import shapely
from numpy.typing import NDArray

from hippodrome.core.roads.geometry import number_pieces, road_geometry
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray, IntArray
from hippodrome.sim.types import Town

CELL_M: Final = 12.0  # of the index of lanes; what comes within 9 m of a point is in its cell or in one beside it
SAMPLE_M: Final = 6.0  # spacing of the samples by which a lane is put into cells
HEADING_COST_M: Final = 2.0  # a lane that runs askew by a radian is as unlikely as one this much farther aside
STRANGE_COST_M: Final = 1.0  # so much nearer a lane must be that is not reached from the present one
CHANGE_COST_M: Final = 0.3  # so much nearer another lane must be: keeps the lane where two overlap
BEYOND_COST_M: Final = 0.5  # a lane that ends before the point, or begins after it, is the less likely one
ASIDE_M: Final = 2.5  # outside of its lane's border the ego is still on that lane, though badly


@dataclass(frozen=True, slots=True, eq=False)
class Near:
    """The nearest place on each of K lanes near P points."""

    lane: IntArray  # (K,) ascending
    distance_m: FloatArray  # (P, K)
    offset_m: FloatArray  # (P, K) of the point from the lane's centreline, left positive
    position_m: FloatArray  # (P, K) arc length along the lane
    heading_rad: FloatArray  # (P, K) of the lane there
    beyond: NDArray[np.bool_]  # (P, K) the lane ends before the point or begins after it


class Ground:
    """Answers where on the network points are. Made once for a town."""

    def __init__(self, town: Town) -> None:
        self.town, self.network = town, town.network
        self._geometry = road_geometry(town.network)
        self._half_width_m = 0.5 * town.network.width_m
        self._low_m = town.network.points_m.min(axis=0) - CELL_M
        self._columns = int((town.network.points_m[:, 0].max() - self._low_m[0]) / CELL_M) + 3
        self._cell, self._segment = self._index()
        self._near: dict[int, tuple[Any, ...]] = {}
        outlines = [*town.junction_polygons_m, *town.turning_places_m]
        areas = shapely.make_valid(np.array([shapely.Polygon(outline) for outline in outlines], dtype=object))
        shapely.prepare(areas)
        self._areas, self._tree = areas, shapely.STRtree(areas)
        self._kin: dict[int, NDArray[np.int64]] = {}
        owner = np.repeat(np.arange(town.network.lane_count), np.diff(town.network.successor_start))
        self._before: list[list[int]] = [[] for _ in range(town.network.lane_count)]
        for lane, after in zip(owner.tolist(), town.network.successor.tolist(), strict=True):
            self._before[after].append(lane)

    def _index(self) -> tuple[NDArray[np.int64], IntArray]:
        """Pairs of a cell and a segment in it, sorted by both."""
        g = self._geometry
        counts = np.ceil(g.segment_length_m / SAMPLE_M).astype(np.int64) + 1
        segment, number = number_pieces(counts)
        share = number / (counts - 1.0 + (counts == 1))[segment]
        points = g.segment_begin_m[segment] + (share * g.segment_length_m[segment])[:, None] * g.segment_direction[segment]
        at = ((points - self._low_m) / CELL_M).astype(np.int64)
        pairs = np.unique(np.stack([at[:, 1] * self._columns + at[:, 0], segment], axis=1), axis=0)
        return pairs[:, 0], pairs[:, 1].astype(np.int32)

    def _segments_near(self, x_m: float, y_m: float) -> tuple[Any, ...]:
        column, row = (int(v) for v in (np.array([x_m, y_m]) - self._low_m) // CELL_M)
        key = row * self._columns + column
        if key not in self._near:
            cells = [(row + dy) * self._columns + column + dx for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
            bounds = [np.searchsorted(self._cell, [cell, cell + 1]) for cell in cells]
            found = np.unique(np.concatenate([self._segment[a:b] for a, b in bounds])) if bounds else np.zeros(0, np.int32)
            g = self._geometry
            lane = g.segment_lane[found]
            starts = np.flatnonzero(np.diff(lane, prepend=-1))
            self._near[key] = (
                lane[starts], starts, np.diff([*starts, len(found)]), g.segment_begin_m[found], g.segment_direction[found],
                g.segment_length_m[found], g.segment_position_m[found],
                np.arctan2(g.segment_direction[found, 1], g.segment_direction[found, 0]),
            )  # fmt: skip
        return self._near[key]

    def near(self, points_m: FloatArray) -> Near:
        """The lanes near points (P, 2) that lie within 3 m of their mean: all that come within some 6 m of any of them."""
        x, y = points_m.mean(axis=0)
        lanes, starts, counts, begin, direction, length, position, heading = self._segments_near(x, y)
        if len(lanes) == 0:
            nothing = np.zeros((len(points_m), 0))
            return Near(lanes, nothing, nothing, nothing, nothing, nothing.astype(np.bool_))
        dx = points_m[:, :1] - begin[:, 0]
        dy = points_m[:, 1:] - begin[:, 1]
        along = dx * direction[:, 0] + dy * direction[:, 1]
        aside = dy * direction[:, 0] - dx * direction[:, 1]
        on = np.clip(along, 0.0, length)
        over = along - on
        squared = over * over + aside * aside
        least = np.repeat(np.minimum.reduceat(squared, starts, axis=1), counts, axis=1)
        where = np.where(squared == least, np.arange(squared.shape[1]), squared.shape[1])
        best = np.minimum.reduceat(where, starts, axis=1)
        rows = np.arange(len(points_m))[:, None]
        first, last = best == starts, best == starts + counts - 1
        past = over[rows, best]
        return Near(
            lane=lanes,
            distance_m=np.sqrt(squared[rows, best]),
            offset_m=aside[rows, best],
            position_m=position[best] + on[rows, best],
            heading_rad=heading[best],
            beyond=(first & (past < -1e-6)) | (last & (past > 1e-6)),
        )

    def lane_of(self, near: Near, point: int, heading_rad: float, previous: int, expected: int = -1) -> int:
        """Column of ``near`` with the lane that a vehicle is on, -1 if none.

        The lane is the one whose centreline is nearest, counting the heading against it; those that cannot be reached from the
        previous lane, or that end before the point, must be clearly nearer.

        Args:
            near: the lanes near some points.
            point: which of those points.
            heading_rad: of the vehicle.
            previous: the lane at the step before, -1 if none.
            expected: where ways part, the lane that the indicator means, -1 if none.
        """
        cost = near.distance_m[point] + BEYOND_COST_M * near.beyond[point]
        turn = np.abs((near.heading_rad[point] - heading_rad + np.pi) % (2.0 * np.pi) - np.pi)
        cost = cost + HEADING_COST_M * turn
        if previous >= 0:
            cost = cost + STRANGE_COST_M * ~np.isin(near.lane, self.kin(previous)) + CHANGE_COST_M * (near.lane != previous)
        if expected >= 0 and near.lane.size and expected in near.lane:
            cost = cost + CHANGE_COST_M * (self.network.is_internal[near.lane] & (near.lane != expected))
        cost = np.where(near.distance_m[point] <= self._half_width_m[near.lane] + ASIDE_M, cost, np.inf)
        if len(cost) == 0 or not np.isfinite(cost).any():
            return -1
        return int(np.argmin(cost))

    def kin(self, lane: int) -> NDArray[np.int64]:
        """A lane, those after it, those beside it, and those that begin where it begins."""
        if lane not in self._kin:
            siblings = [int(after) for before in self._before[lane] for after in self.network.successors(before)]
            after = [int(one) for one in self.network.successors(lane)]
            further = [int(two) for one in after for two in self.network.successors(one)]
            own = [lane, *after, *further, *self.network.adjacent_lanes(lane), *siblings]
            self._kin[lane] = np.unique(np.array(own, dtype=np.int64))
        return self._kin[lane]

    def line(self, *lanes: int) -> frozenset[int]:
        """Lanes, and those up to two hops after them: what whoever is on them drives along next; -1 stands for no lane."""
        own = {lane for lane in lanes if lane >= 0}
        for _ in range(2):
            own |= {int(after) for lane in own for after in self.network.successors(lane)}
        return frozenset(own)

    def before(self, lane: int) -> list[int]:
        """The lanes that lead into ``lane``."""
        return self._before[lane]

    def is_paved(self, point_m: FloatArray) -> bool:
        """Whether a point (2,) lies on a lane, a junction or a turning place."""
        near = self.near(point_m[None])
        on_lane = (near.distance_m[0] <= self._half_width_m[near.lane]) & ~near.beyond[0]
        return bool(on_lane.any()) or bool(self.in_areas(point_m[None])[0])

    def in_areas(self, points_m: FloatArray) -> NDArray[np.bool_]:
        """Whether points (P, 2) lie in junctions or turning places."""
        inside = np.zeros(len(points_m), dtype=np.bool_)
        inside[self._tree.query(shapely.points(points_m), predicate="intersects")[0]] = True
        return inside

    def lane_length_m(self, lane: int) -> float:
        """Length of a lane's centreline as drawn."""
        return float(self._geometry.lane_length_m[lane])

    def height_m(self, lane: int, position_m: float) -> float:
        """Height of the road at an arc length along a lane; 0 in a flat town."""
        if self.town.heights_m is None or lane < 0:
            return 0.0
        part = slice(self.network.point_start[lane], self.network.point_start[lane + 1])
        steps = np.linalg.norm(np.diff(self.network.points_m[part], axis=0), axis=1)
        return float(np.interp(position_m, np.concatenate([[0.0], np.cumsum(steps)]), self.town.heights_m[part]))

    def pose_at(self, lane: int, position_m: float) -> tuple[float, float, float]:
        """The pose on a lane's centreline at an arc length, taken back to the lane's ends."""
        g = self._geometry
        own = slice(g.segment_start[lane], g.segment_start[lane + 1])
        begins = g.segment_position_m[own]
        k = int(np.clip(np.searchsorted(begins, position_m, side="right") - 1, 0, len(begins) - 1)) + own.start
        along = float(np.clip(position_m - g.segment_position_m[k], 0.0, g.segment_length_m[k]))
        (x, y), (dx, dy) = g.segment_begin_m[k], g.segment_direction[k]
        return float(x + along * dx), float(y + along * dy), float(wrap_compiled(np.arctan2(dy, dx)))
