"""Houses, barns, blocks, halls, churches, silos. Their massing (size, yaw, distance, height, roof) tells places apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.spatial import KDTree

from hippodrome.core.types import FloatArray, IntArray
from hippodrome.sim.scene.mesh import Mesh, Surface, boxes, merge, placed, polygons, turned
from hippodrome.sim.scene.placement import Border, Shapes, clear_of, rectangles, spread

# From..to of length, width, wall height [m], roof pitch [deg] (0: flat), distance of the front from the road [m].
KINDS: Final = np.array(
    [
        [8.0, 14.0, 7.0, 10.0, 3.0, 6.2, 30.0, 50.0, 3.5, 12.0],  # 0 house
        [9.0, 18.0, 6.5, 9.0, 2.6, 3.2, 18.0, 32.0, 4.0, 14.0],  # 1 bungalow
        [14.0, 28.0, 9.0, 14.0, 3.8, 6.5, 22.0, 42.0, 6.0, 22.0],  # 2 barn
        [3.5, 8.0, 3.0, 5.0, 2.2, 3.0, 0.0, 25.0, 3.0, 18.0],  # 3 shed
        [14.0, 30.0, 10.0, 14.0, 8.0, 19.0, 0.0, 0.0, 4.0, 9.0],  # 4 block of flats
        [18.0, 40.0, 13.0, 24.0, 4.5, 9.0, 0.0, 0.0, 6.0, 18.0],  # 5 hall
        [14.0, 22.0, 7.5, 10.0, 6.0, 9.0, 42.0, 55.0, 6.0, 16.0],  # 6 church
        [4.0, 6.5, 4.0, 6.5, 8.0, 16.0, 0.0, 0.0, 6.0, 22.0],  # 7 silo
    ]
)
HOUSE, BUNGALOW, BARN, SHED, BLOCK, HALL, CHURCH, SILO = range(8)
RURAL_MIX: Final = np.array([0.38, 0.16, 0.17, 0.17, 0.01, 0.03, 0.03, 0.05])
TOWN_MIX: Final = np.array([0.40, 0.10, 0.02, 0.10, 0.22, 0.12, 0.02, 0.02])
STOREY_M: Final = 2.9
EAVES_M: Final = 0.45  # overhang of pitched roofs
ROAD_CLEARANCE_M: Final = 2.0  # a pavement's width between wall and asphalt
LONELY_M: Final = 24.0  # from a road's border to the nearest building
GAP_M: Final = 1.5  # between buildings

FACADES: Final = np.array(
    [
        [0.90, 0.88, 0.83],
        [0.88, 0.80, 0.62],
        [0.78, 0.62, 0.44],
        [0.66, 0.36, 0.28],
        [0.55, 0.30, 0.24],
        [0.74, 0.73, 0.70],
        [0.62, 0.68, 0.60],
        [0.60, 0.66, 0.74],
        [0.84, 0.70, 0.62],
    ]
)
ROOFS: Final = np.array([[0.62, 0.30, 0.22], [0.50, 0.24, 0.18], [0.34, 0.28, 0.25], [0.28, 0.29, 0.32], [0.42, 0.40, 0.40]])
TIMBER: Final = np.array([[0.50, 0.22, 0.17], [0.42, 0.32, 0.23], [0.60, 0.56, 0.50], [0.36, 0.40, 0.38], [0.70, 0.70, 0.68]])
FLAT_ROOF: Final = np.array([0.46, 0.45, 0.44])
DOOR: Final = np.array([0.34, 0.24, 0.18])
GATE: Final = np.array([0.44, 0.42, 0.42])


@dataclass(frozen=True, slots=True, eq=False)
class Buildings:
    """k buildings; the front is their own +y side, the ridge runs along x."""

    kind: IntArray  # (k,)
    centre_m: FloatArray  # (k, 2)
    yaw_rad: FloatArray  # (k,)
    size_m: FloatArray  # (k, 3) length, width, height of the walls
    rise_m: FloatArray  # (k,) of the roof above the walls, 0: flat
    hip: FloatArray  # (k,) 0 gable .. 1 hipped, shortening of the ridge as a share of half the width
    facade: FloatArray  # (k, 3)
    roof: FloatArray  # (k, 3)
    glazing: FloatArray  # (k,) pitch of the windows [m]; 0: one band per storey

    def select(self, rows: np.ndarray) -> Buildings:
        return Buildings(*(getattr(self, name)[rows] for name in self.__slots__))

    def footprints(self) -> Shapes:
        return rectangles(self.centre_m, self.yaw_rad, self.size_m[:, 0], self.size_m[:, 1])


def place_buildings(border: Border, town_share: FloatArray, roads: Shapes, fields: Shapes, rng: np.random.Generator) -> Buildings:
    """Two rows along the roads, off the fields; ``town_share`` (B,) mixes the rural kinds with those of a town.

    Stretches that stay lonely get a second round, since a road without any building in view cannot be recognised.
    """
    sparse = 1.0 + 0.5 * (1.0 - town_share)
    front = _propose(border, town_share, spacing_m=10.0 * sparse, behind_m=(0.0, 4.0), stray_rad=0.12, rng=rng)
    back = _propose(border, town_share, spacing_m=14.0 * sparse, behind_m=(14.0, 48.0), stray_rad=0.6, rng=rng)
    first = _admitted(join([front, back]), roads, fields)
    lonely = KDTree(first.centre_m).query(border.point_m)[0] > LONELY_M
    spacing = np.full(int(lonely.sum()), 5.0)  # many proposals, of which few find room
    second = _propose(border.select(lonely), town_share[lonely], spacing, behind_m=(0.0, 20.0), stray_rad=0.5, rng=rng)
    return _admitted(join([first, second]), roads, fields)


def _admitted(proposed: Buildings, roads: Shapes, fields: Shapes) -> Buildings:
    """Those that stand clear of roads and fields, and of the ones before them."""
    footprints = proposed.footprints()
    clear = clear_of(footprints, roads, ROAD_CLEARANCE_M) & clear_of(footprints, fields, GAP_M)
    return proposed.select(np.flatnonzero(clear)[spread(footprints[clear], GAP_M)])


def join(groups: list[Buildings]) -> Buildings:
    return Buildings(*(np.concatenate([getattr(group, name) for group in groups]) for name in Buildings.__slots__))


def _propose(
    border: Border,
    town_share: FloatArray,
    spacing_m: FloatArray,
    behind_m: tuple[float, float],
    stray_rad: float,
    rng: np.random.Generator,
) -> Buildings:
    chosen = np.flatnonzero(rng.random(len(border.length_m)) < border.length_m / spacing_m)
    chosen = rng.permutation(chosen)
    site, k = border.select(chosen), len(chosen)
    mix = np.cumsum(RURAL_MIX + town_share[chosen, None] * (TOWN_MIX - RURAL_MIX), axis=1)
    kind = np.minimum((rng.random(k)[:, None] > mix).sum(axis=1), len(KINDS) - 1).astype(np.int32)
    low, high = KINDS[kind, 0::2], KINDS[kind, 1::2]
    length, width, wall, pitch_deg, setback = (low + rng.random((k, 5)) * (high - low)).T
    setback = setback + rng.uniform(*behind_m, k)
    yaw = site.inward_yaw_rad() + rng.normal(0.0, stray_rad, k) + 0.5 * np.pi * (rng.random(k) < 0.22)
    width = np.where(kind == SILO, length, width)
    wooden = np.isin(kind, (BARN, SHED))
    facade = np.where(wooden[:, None], TIMBER[rng.integers(len(TIMBER), size=k)], FACADES[rng.integers(len(FACADES), size=k)])
    facade = np.where((kind == SILO)[:, None], [0.70, 0.72, 0.74], facade)
    reach = 0.5 * np.maximum(length, width)
    return Buildings(
        kind=kind,
        centre_m=site.point_m + site.outward * (setback + reach)[:, None],
        yaw_rad=yaw,
        size_m=np.stack([length, width, wall], axis=1),
        rise_m=np.where(pitch_deg < 8.0, 0.0, 0.5 * width * np.tan(np.radians(pitch_deg))),
        hip=np.where(np.isin(kind, (HOUSE, BUNGALOW)) & (rng.random(k) < 0.3), rng.uniform(0.5, 1.0, k), 0.0),
        facade=np.clip(facade * rng.uniform(0.88, 1.1, (k, 1)), 0.0, 1.0),
        roof=ROOFS[rng.integers(len(ROOFS), size=k)] * rng.uniform(0.85, 1.15, (k, 1)),
        glazing=np.where(np.isin(kind, (BLOCK, HALL)) & (rng.random(k) < 0.5), 0.0, rng.uniform(2.2, 3.6, k)),
    )


def building_mesh(buildings: Buildings, rng: np.random.Generator) -> tuple[Mesh, Mesh]:
    """Bold parts (walls, roofs) and fine ones (windows, doors, chimneys)."""
    square = buildings.select(buildings.kind != SILO)
    pitched, flat = square.select(square.rise_m > 0.0), square.select(square.rise_m == 0.0)
    bold = [_walls(square), _flat_roofs(flat), _pitched_roofs(pitched), _silos(buildings.select(buildings.kind == SILO))]
    church = square.select(square.kind == CHURCH)
    homely = square.select(np.isin(square.kind, (HOUSE, BUNGALOW, BLOCK, CHURCH, HALL)))
    fine = [_windows(homely, rng), _doors(square), _chimneys(pitched.select(np.isin(pitched.kind, (HOUSE, BUNGALOW))), rng)]
    return merge([*bold, _towers(church)]), merge(fine)


def _local(buildings: Buildings, corners: FloatArray, albedo: FloatArray) -> Mesh:
    return placed(corners, buildings.centre_m, buildings.yaw_rad, albedo)


def _ring(buildings: Buildings, out_m: float, z_m: FloatArray) -> FloatArray:
    """Corners (k, 4, 3) of the footprint grown by ``out_m``, counter-clockwise from front right."""
    x, y = 0.5 * buildings.size_m[:, 0] + out_m, 0.5 * buildings.size_m[:, 1] + out_m
    return np.stack([np.stack([sx * x, sy * y, z_m], axis=1) for sx, sy in ((1, -1), (1, 1), (-1, 1), (-1, -1))], axis=1)


def _walls(buildings: Buildings) -> Mesh:
    foot, top = _ring(buildings, 0.0, np.zeros(len(buildings.kind))), _ring(buildings, 0.0, buildings.size_m[:, 2])
    after = [1, 2, 3, 0]
    return _local(buildings, np.stack([foot, foot[:, after], top[:, after], top], axis=2), buildings.facade)


def _flat_roofs(buildings: Buildings) -> Mesh:
    return _local(buildings, _ring(buildings, 0.0, buildings.size_m[:, 2])[:, None], np.tile(FLAT_ROOF, (len(buildings.kind), 1)))


def _pitched_roofs(buildings: Buildings) -> Mesh:
    """Two slopes seen from above and below, and two ends: upright gables in the wall's colour, or hips in the roof's."""
    wall, rise, half_width = buildings.size_m[:, 2], buildings.rise_m, 0.5 * buildings.size_m[:, 1]
    eaves = _ring(buildings, EAVES_M, wall - EAVES_M * rise / half_width)
    is_hip = buildings.hip > 0.0
    half_ridge = np.maximum(0.5 * buildings.size_m[:, 0] + EAVES_M - buildings.hip * half_width, 0.3)
    ridge = np.stack([np.stack([s * half_ridge, 0.0 * rise, wall + rise], axis=1) for s in (1, -1)], axis=1)
    right = np.stack([eaves[:, 3], eaves[:, 0], ridge[:, 0], ridge[:, 1]], axis=1)
    left = np.stack([eaves[:, 1], eaves[:, 2], ridge[:, 1], ridge[:, 0]], axis=1)
    slopes = np.stack([right, left], axis=1)
    gable_foot = _ring(buildings, 0.0, wall)
    peak = np.stack([np.stack([s * 0.5 * buildings.size_m[:, 0], 0.0 * rise, wall + rise], axis=1) for s in (1, -1)], axis=1)
    gables = np.stack([np.stack([gable_foot[:, 2 * i], gable_foot[:, 2 * i + 1], peak[:, i]], axis=1) for i in (0, 1)], axis=1)
    hips = np.stack([np.stack([eaves[:, 2 * i], eaves[:, 2 * i + 1], ridge[:, i]], axis=1) for i in (0, 1)], axis=1)
    hipped, gabled = buildings.select(is_hip), buildings.select(~is_hip)
    return merge(
        [
            _local(buildings, slopes, buildings.roof),
            _local(buildings, slopes[:, :, ::-1], 0.6 * buildings.roof),
            _local(gabled, gables[~is_hip], gabled.facade),
            _local(hipped, hips[is_hip], hipped.roof),
        ]
    )


def _silos(buildings: Buildings) -> Mesh:
    """Twelve-sided cylinders with a conical cap."""
    angle = np.linspace(0.0, 2.0 * np.pi, 13)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    radius, height = 0.5 * buildings.size_m[:, :1, None], buildings.size_m[:, 2, None, None]
    rim = radius * circle[None]
    low = np.concatenate([rim, np.zeros((*rim.shape[:2], 1))], axis=2)
    high = np.concatenate([rim, np.broadcast_to(height, (*rim.shape[:2], 1))], axis=2)
    apex = np.broadcast_to(np.concatenate([np.zeros((len(rim), 1, 2)), height + 0.6 * radius], axis=2), low[:, :-1].shape)
    sides = np.stack([low[:, :-1], low[:, 1:], high[:, 1:], high[:, :-1]], axis=2)
    cap = np.stack([high[:, :-1], high[:, 1:], apex], axis=2)
    return merge([_local(buildings, sides, buildings.facade), _local(buildings, cap, 0.8 * buildings.facade)])


def _towers(churches: Buildings) -> Mesh:
    """A square tower with a pyramid at one end of the nave."""
    k = len(churches.kind)
    side, height = 0.55 * churches.size_m[:, 1], 2.1 * churches.size_m[:, 2]
    offset = np.stack([0.5 * (churches.size_m[:, 0] - side), np.zeros(k), np.zeros(k)], axis=1)
    centre = turned(offset[:, None, :], churches.centre_m, churches.yaw_rad)[:, 0]
    tower = boxes(centre[:, :2], churches.yaw_rad, np.stack([1.02 * side, 1.02 * side, height], axis=1), churches.facade)
    x = 0.53 * side
    foot = np.stack(
        [np.stack([offset[:, 0] + sx * x, sy * x, height], 1) for sx, sy in ((1, -1), (1, 1), (-1, 1), (-1, -1))], axis=1
    )
    apex = np.repeat((offset + np.stack([np.zeros(k), np.zeros(k), height + 1.7 * side], axis=1))[:, None], 4, axis=1)
    return merge([tower, _local(churches, np.stack([foot, foot[:, [1, 2, 3, 0]], apex], axis=2), churches.roof)])


def _windows(buildings: Buildings, rng: np.random.Generator) -> Mesh:
    """Panes a little in front of the walls: in columns, or one band per storey."""
    k = len(buildings.kind)
    owner, wall = np.repeat(np.arange(k), 4), np.tile(np.arange(4), k)
    span = np.where(wall % 2 == 0, buildings.size_m[owner, 1], buildings.size_m[owner, 0])
    depth = np.where(wall % 2 == 0, buildings.size_m[owner, 0], buildings.size_m[owner, 1])
    storeys = np.maximum(np.floor((buildings.size_m[:, 2] + 0.3) / STOREY_M), 1.0)[owner].astype(np.int64)
    band = buildings.glazing[owner] == 0.0
    columns = np.where(band, 1, np.maximum(np.floor((span - 1.2) / np.maximum(buildings.glazing[owner], 1.0)), 1)).astype(
        np.int64
    )
    panes = storeys * columns
    row = np.repeat(np.arange(len(owner)), panes)
    number = np.arange(len(row)) - np.repeat(np.cumsum(panes) - panes, panes)
    column, storey = number % columns[row], number // columns[row]
    width = np.where(band[row], span[row] - 1.6, 0.42 * span[row] / columns[row])
    along = ((column + 0.5) / columns[row] - 0.5) * (span[row] - 0.8)
    tall = buildings.kind[owner[row]] == CHURCH
    sill, height = 0.95 + STOREY_M * storey, np.where(tall, 2.6, 1.3)
    kept = (rng.random(len(row)) < 0.9) & (sill + height < buildings.size_m[owner[row], 2]) & (~tall | (storey == 0))
    row, width, along, sill, height = row[kept], width[kept], along[kept], sill[kept], height[kept]
    corners = np.stack(
        [
            np.stack([0.5 * depth[row] + 0.03, along + sx * 0.5 * width, sill + sz * height], 1)
            for sx, sz in ((-1, 0), (1, 0), (1, 1), (-1, 1))
        ],
        1,
    )
    front = turned(corners, np.zeros((len(row), 2)), 0.5 * np.pi * wall[row])
    glass = np.array([0.20, 0.24, 0.29]) * rng.uniform(0.7, 1.5, (len(row), 1))
    world = turned(front, buildings.centre_m[owner[row]], buildings.yaw_rad[owner[row]])
    return polygons(world, glass, Surface.WINDOW)


def _doors(buildings: Buildings) -> Mesh:
    """A door, or a barn's and a hall's gate, on the front."""
    gate = np.isin(buildings.kind, (BARN, HALL, SHED))
    width = np.where(gate, np.minimum(3.6, 0.4 * buildings.size_m[:, 0]), 1.1)
    height = np.where(gate, np.minimum(3.6, 0.8 * buildings.size_m[:, 2]), 2.1)
    y = 0.5 * buildings.size_m[:, 1] + 0.05
    corners = np.stack(
        [np.stack([-sx * 0.5 * width, y, sz * height], 1) for sx, sz in ((-1, 0), (1, 0), (1, 1), (-1, 1))], axis=1
    )
    return _local(buildings, corners[:, None], np.where(gate[:, None], GATE, DOOR))


def _chimneys(buildings: Buildings, rng: np.random.Generator) -> Mesh:
    k = len(buildings.kind)
    offset = np.stack([rng.uniform(-0.25, 0.25, k) * buildings.size_m[:, 0], 0.12 * buildings.size_m[:, 1]], axis=1)
    foot = np.concatenate([offset, (buildings.size_m[:, 2] + 0.4 * buildings.rise_m)[:, None]], axis=1)
    centre = turned(foot[:, None], buildings.centre_m, buildings.yaw_rad)[:, 0]
    size = np.stack([np.full(k, 0.6), np.full(k, 0.6), 0.6 * buildings.rise_m + 0.9], axis=1)
    return boxes(centre, buildings.yaw_rad, size, np.array([0.48, 0.28, 0.22]))
