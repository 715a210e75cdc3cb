"""Poles, street lamps, traffic signs and lights, bus shelters, billboards, hay bales."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Final, TypeAlias

import numpy as np
import shapely

from hippodrome.core.types import FloatArray
from hippodrome.sim.scene.mesh import Mesh, boxes, instances, merge, polygons
from hippodrome.sim.scene.placement import Bools, Border, Shapes, clear_of, rectangles, spread

POLE_GAP_M: Final = 34.0  # between utility poles or lamps
POST_CLEARANCE_M: Final = 0.5  # between a post and the asphalt
TOUCHING_M: Final = 0.05  # of a board over the edge of a lane: the widest end just there, and bends are made of corners
STEEL, WOOD, DARK = np.array([0.62, 0.64, 0.66]), np.array([0.42, 0.33, 0.25]), np.array([0.14, 0.15, 0.16])
RED, WHITE, YELLOW, BLUE, GREEN = (
    np.array(c) for c in ([0.78, 0.10, 0.10], [0.94, 0.94, 0.92], [0.95, 0.78, 0.12], [0.12, 0.30, 0.62], [0.10, 0.46, 0.26])
)
Maker: TypeAlias = Callable[[np.random.Generator, FloatArray, FloatArray], Mesh]  # at centre (1, 2) and yaw (1,)
STRAW: Final = np.array([0.80, 0.70, 0.42])


def furniture_mesh(
    border: Border,
    town_share: FloatArray,
    signals_m: FloatArray,
    left_hand: bool,
    roads: Shapes,
    taken: Shapes,
    rng: np.random.Generator,
) -> Mesh:
    """Everything on a post beside the road; ``signals_m`` (K, 3) at the lanes' ends."""
    in_town = rng.random(len(town_share)) < town_share
    parts = [_lines_of_poles(border, in_town, roads, taken, rng), _signals(signals_m, left_hand, roads, rng)]
    for make, spacing_m, setback_m in (
        (_sign, 70.0, 0.9),
        (_shelter, 260.0, 2.6),
        (_billboard, 320.0, 5.0),
        (_bales, 160.0, 9.0),
    ):
        parts.append(_sprinkled(make, border, spacing_m, setback_m, roads, taken, rng))
    return merge(parts)


def _lines_of_poles(border: Border, in_town: np.ndarray, roads: Shapes, taken: Shapes, rng: np.random.Generator) -> Mesh:
    """Evenly spaced, hence the greedy selection; wooden poles in the country, lamps in town."""
    order = rng.permutation(len(border.length_m))
    foot = (border.point_m + 1.1 * border.outward)[order]
    points = shapely.points(foot)
    free = np.flatnonzero(clear_of(points, roads, POST_CLEARANCE_M) & clear_of(points, taken, 0.3))
    free = free[spread(points[free], POLE_GAP_M)]
    yaw, lamp = border.inward_yaw_rad()[order][free], in_town[order][free]
    parts = []
    for template, rows in ((_utility_pole(), ~lamp), (_lamp(), lamp)):
        k = int(rows.sum())
        scale = np.stack([np.ones(k), np.ones(k), rng.uniform(0.85, 1.1, k)], axis=1)
        parts.append(instances(template, foot[free][rows], yaw[rows], scale, rng.uniform(0.9, 1.1, (k, 3))))
    return merge(parts)


def _signals(signals_m: FloatArray, left_hand: bool, roads: Shapes, rng: np.random.Generator) -> Mesh:
    """Each is moved sideways from its lane until it stands beside the asphalt; where there is no room, it is left out."""
    k = len(signals_m)
    heading = signals_m[:, 2]
    outward = (1.0 if left_hand else -1.0) * np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    offset = np.full(k, np.nan)
    for shift_m in np.arange(0.0, 12.0, 0.5):
        free = np.isnan(offset) & clear_of(shapely.points(signals_m[:, :2] + shift_m * outward), roads, POST_CLEARANCE_M)
        offset[free] = shift_m
    placed = np.flatnonzero(~np.isnan(offset))
    foot = (signals_m[:, :2] + np.nan_to_num(offset)[:, None] * outward)[placed]
    kind, yaw = rng.integers(3, size=k)[placed], (heading + 0.5 * np.pi)[placed]
    parts = [
        _copies(template, foot[kind == i], yaw[kind == i]) for i, template in enumerate((_yield(), _stop(), _traffic_light()))
    ]
    return merge(parts)


def _copies(template: Mesh, foot_m: FloatArray, yaw_rad: FloatArray) -> Mesh:
    return instances(template, foot_m, yaw_rad, np.ones((len(foot_m), 3)), np.ones((len(foot_m), 3)))


def _sprinkled(
    make: Maker, border: Border, spacing_m: float, setback_m: float, roads: Shapes, taken: Shapes, rng: np.random.Generator
) -> Mesh:
    site = border.draw(spacing_m, rng)
    k = len(site.length_m)
    centre = site.point_m + site.outward * setback_m
    shapes = rectangles(centre, site.inward_yaw_rad(), np.full(k, 0.9 * setback_m), np.full(k, 0.6 * setback_m))
    free = np.flatnonzero(clear_of(shapes, roads, 0.3) & clear_of(shapes, taken, 0.3))
    made = [make(rng, centre[i : i + 1], site.inward_yaw_rad()[i : i + 1]) for i in free]
    return merge([thing for thing, beside in zip(made, _are_beside(made, roads), strict=True) if beside])


def _are_beside(things: Sequence[Mesh], roads: Shapes) -> Bools:
    """Which things stand beside the roads with all their parts: boards are wider than the ground that is kept free for them, and
    the road on the other side, or a side street, may be nearer than the one that they stand at."""
    outlines = np.array([shapely.MultiPoint(thing.vertices_m[:, :2]).convex_hull for thing in things], dtype=object)
    beside = np.ones(len(things), dtype=np.bool_)
    if len(things) and len(roads):
        thing, road = shapely.STRtree(roads).query(outlines, predicate="intersects")
        over = shapely.intersects(outlines[thing], shapely.buffer(roads[road], -TOUCHING_M))
        beside[thing[over]] = False
    return beside


def _box(origin: list[float], size: list[float], albedo: FloatArray) -> Mesh:
    return boxes(np.array([origin]), np.zeros(1), np.array([size]), albedo)


def _plate(corners_xz: list[list[float]], albedo: FloatArray, y_m: float = 0.06) -> Mesh:
    """A plate facing its own +y, grey behind. Corners clockwise in (x, z), which is counter-clockwise seen from the front."""
    front = np.array([[x, y_m, z] for x, z in corners_xz])
    return merge([polygons(front[None], albedo), polygons(front[::-1][None] - [0.0, 0.02, 0.0], STEEL)])


def _disc(sides: int, radius: float, z: float, turn: float = 0.0) -> list[list[float]]:
    angle = turn - 2.0 * np.pi * np.arange(sides) / sides
    return [[radius * float(np.cos(a)), z + radius * float(np.sin(a))] for a in angle]


@cache
def _utility_pole() -> Mesh:
    return merge(
        [
            _box([0, 0, 0], [0.24, 0.24, 8.5], WOOD),
            _box([0, 0, 7.6], [1.9, 0.14, 0.16], WOOD),
            _box([0, 0, 6.9], [1.3, 0.12, 0.14], WOOD),
        ]
    )


@cache
def _lamp() -> Mesh:
    return merge(
        [
            _box([0, 0, 0], [0.16, 0.16, 6.8], STEEL),
            _box([0, 0.7, 6.7], [0.12, 1.5, 0.10], STEEL),
            _box([0, 1.4, 6.6], [0.3, 0.6, 0.12], WHITE),
        ]
    )


@cache
def _yield() -> Mesh:
    down = [[-0.45, 2.6], [0.45, 2.6], [0.0, 1.85]]
    inner = [[-0.27, 2.50], [0.27, 2.50], [0.0, 2.05]]
    return merge([_box([0, 0, 0], [0.07, 0.07, 2.6], STEEL), _plate(down, RED), _plate(inner, WHITE, y_m=0.08)])


@cache
def _stop() -> Mesh:
    return merge(
        [
            _box([0, 0, 0], [0.07, 0.07, 2.6], STEEL),
            _plate(_disc(8, 0.45, 2.3, np.pi / 8), RED),
            _plate(_disc(4, 0.2, 2.3, np.pi / 4), WHITE, y_m=0.08),
        ]
    )


@cache
def _traffic_light() -> Mesh:
    head = [_plate(_disc(6, 0.12, 3.2 - 0.32 * i), lamp, y_m=0.17) for i, lamp in enumerate((RED, YELLOW * 0.5, GREEN * 0.6))]
    return merge([_box([0, 0, 0], [0.14, 0.14, 3.4], STEEL), _box([0, 0, 2.35], [0.38, 0.3, 1.05], DARK), *head])


def _sign(rng: np.random.Generator, centre_m: FloatArray, yaw_rad: FloatArray) -> Mesh:
    """A direction or warning sign, seen by those who drive on this side."""
    colour = (BLUE, GREEN, YELLOW, WHITE)[int(rng.integers(4))]
    width, height = rng.uniform(0.7, 1.8), rng.uniform(0.6, 1.1)
    corners = [[-0.5 * width, 1.7 + height], [0.5 * width, 1.7 + height], [0.5 * width, 1.7], [-0.5 * width, 1.7]]
    template = merge([_box([0, 0, 0], [0.08, 0.08, 1.8 + height], STEEL), _plate(corners, colour)])
    turned_to_traffic = yaw_rad + 0.5 * np.pi * (1 if rng.random() < 0.5 else -1)
    return _copies(template, centre_m, turned_to_traffic)


def _shelter(rng: np.random.Generator, centre_m: FloatArray, yaw_rad: FloatArray) -> Mesh:
    """Open to the road (+y)."""
    colour = (BLUE, GREEN, RED, STEEL)[int(rng.integers(4))] * 0.8
    walls = [
        _box([0, -0.7, 0], [3.4, 0.08, 2.3], 0.7 * STEEL),
        _box([-1.7, 0, 0], [0.08, 1.4, 2.3], 0.7 * STEEL),
        _box([1.7, 0, 0], [0.08, 1.4, 2.3], 0.7 * STEEL),
    ]
    return _copies(
        merge([*walls, _box([0, 0.1, 2.3], [3.8, 1.9, 0.18], colour), _box([0, -0.4, 0.4], [2.6, 0.4, 0.08], WOOD)]),
        centre_m,
        yaw_rad,
    )


def _billboard(rng: np.random.Generator, centre_m: FloatArray, yaw_rad: FloatArray) -> Mesh:
    panels = rng.uniform(0.15, 0.95, (4, 3))
    x = np.linspace(-2.2, 2.2, 5)
    plates = [_plate([[x[i], 4.4], [x[i + 1], 4.4], [x[i + 1], 1.9], [x[i], 1.9]], panels[i]) for i in range(4)]
    posts = [_box([sx * 1.6, -0.1, 0], [0.2, 0.2, 4.2], WOOD) for sx in (-1, 1)]
    return _copies(merge([*plates, *posts]), centre_m, yaw_rad + rng.uniform(-0.9, 0.9))


def _bales(rng: np.random.Generator, centre_m: FloatArray, yaw_rad: FloatArray) -> Mesh:
    count = int(rng.integers(2, 6))
    origin = np.stack([1.4 * np.arange(count) - 0.7 * count, rng.uniform(-0.3, 0.3, count)], axis=1)
    stack = boxes(
        origin, rng.normal(0.0, 0.1, count), np.tile([1.25, 1.2, 1.2], (count, 1)) * rng.uniform(0.9, 1.6, (count, 1)), STRAW
    )
    return _copies(stack, centre_m, yaw_rad)
