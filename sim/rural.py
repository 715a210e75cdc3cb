"""Winding country roads: the curves, bends and T-junctions of the rural town."""

from __future__ import annotations

from itertools import combinations
from typing import Final

import numpy as np
from shapely import LineString
from shapely.ops import substring

from hippodrome.core.se2 import wrap
from hippodrome.core.types import FloatArray
from hippodrome.sim.generators import Plan, Street, compact, planar_streets, spread_nodes

DRAWING_STEP_M: Final = 2.0  # polyline detail; at 12 m radius one step turns 10 degrees
MIN_RADIUS_M: Final = 12.0  # a country road's tightest bend
CLEARANCE_M: Final = 12.0  # between roads away from their crossing: two carriageways and a hedge
CROSSING_M: Final = 18.0  # stretch at a crossing where roads may be closer than that
BEND: Final = 0.12  # sideways swing of the rolling bends, as a share of the road's length
PIECE_M: Final = 48.0  # less what the crossings take, 37 m: Town07's mean edge, 4.39 km in 119 edges
CURVINESS: Final = 1.07  # road length over straight length that curves and bends add on average


def rural_plan(width_m: float, height_m: float, length_m: float, rng: np.random.Generator) -> Plan:
    """Winding two-way roads of about ``length_m`` within the box, in pieces of ``PIECE_M``."""
    margin = BEND * 0.25 * min(width_m, height_m)
    inner = np.array([width_m, height_m]) - 2.0 * margin
    straight = length_m / CURVINESS
    # A planar street pattern of mean degree 3 over n spread nodes in area A measures about 1.5 sqrt(A n).
    count = max(6, round((straight / 1.5) ** 2 / float(inner.prod())))
    nodes = margin + spread_nodes(float(inner[0]), float(inner[1]), count, rng)
    streets = planar_streets(nodes, straight, rng)
    return _in_pieces(compact(Plan(nodes, streets, _winding_shapes(nodes, streets, rng))))


def _winding_shapes(nodes_m: FloatArray, streets: tuple[Street, ...], rng: np.random.Generator) -> tuple[FloatArray, ...]:
    """Curves that run smoothly through crossings, straightened as far as needed to keep clear of one another."""
    leaving = _leaving_rad(nodes_m, streets)
    shapes: list[FloatArray] = []
    for i, (a, b) in enumerate(streets):
        swing, waves = rng.uniform(-BEND, BEND), int(rng.integers(1, 4))
        tries = (_curve(nodes_m[[a, b]], leaving[i], swing * f, waves, f) for f in (1.0, 0.8, 0.6, 0.3, 0.0))
        shapes.append(next((c for c in tries if _is_drivable(c, streets[i], streets, shapes)), nodes_m[[a, b]]))
    return tuple(shapes)


def _leaving_rad(nodes_m: FloatArray, streets: tuple[Street, ...]) -> FloatArray:
    """Directions (S, 2) in which each street leaves its two crossings: opposite arms become one through road."""
    chord = np.array([np.arctan2(*(nodes_m[b] - nodes_m[a])[::-1]) for a, b in streets])
    leaving = np.stack([chord, wrap(chord + np.pi)], axis=1)
    bent = leaving.copy()
    for node in range(len(nodes_m)):
        arms = [(i, street.index(node)) for i, street in enumerate(streets) if node in street]
        free = set(arms)
        by_opposition = sorted(combinations(arms, 2), key=lambda p: abs(float(wrap(leaving[p[0]] - leaving[p[1]]))), reverse=True)
        for one, other in by_opposition:
            kink = float(wrap(leaving[other] - leaving[one] - np.pi))
            # Beyond 60 degrees nobody calls it the same road, unless there is no other.
            if one in free and other in free and (len(arms) == 2 or abs(kink) < np.pi / 3):
                bent[one] = wrap(leaving[one] + 0.5 * kink)
                bent[other] = wrap(leaving[other] - 0.5 * kink)
                free -= {one, other}
    return bent


def _curve(ends_m: FloatArray, leaving_rad: FloatArray, swing: float, waves: int, ease: float) -> FloatArray:
    """Hermite curve with rolling bends; ``ease`` 1 leaves the crossings in the given directions, 0 is the straight line."""
    start_m, end_m = ends_m
    chord = end_m - start_m
    length = float(np.linalg.norm(chord))
    share = np.linspace(0.0, 1.0, max(3, int(length / DRAWING_STEP_M) + 1))[:, None]
    leave = length * np.stack([np.cos(leaving_rad), np.sin(leaving_rad)], axis=1)
    out = chord + ease * (leave[0] - chord)
    arrive = chord - ease * (leave[1] + chord)
    left = np.array([-chord[1], chord[0]])
    bends = swing * np.sin(np.pi * share) ** 2 * np.sin(waves * np.pi * share + 0.5 * np.pi * (waves % 2))
    square, cube = share**2, share**3
    ends = (2 * cube - 3 * square + 1) * start_m + (3 * square - 2 * cube) * end_m
    tangents = (cube - 2 * square + share) * out + (cube - square) * arrive
    curve: FloatArray = ends + tangents + bends * left
    return curve


def _is_drivable(curve_m: FloatArray, street: Street, streets: tuple[Street, ...], drawn: list[FloatArray]) -> bool:
    """Whether a curve bends gently and keeps its distance from the roads drawn so far."""
    return _tightest_radius_m(curve_m) >= MIN_RADIUS_M and all(
        _clear(curve_m, street, shape, streets[j]) for j, shape in enumerate(drawn)
    )


def _clear(curve_m: FloatArray, street: Street, other_m: FloatArray, other: Street) -> bool:
    one, two = LineString(curve_m), LineString(other_m)
    shared = set(street) & set(other)
    if not shared:
        return bool(one.distance(two) >= CLEARANCE_M)
    return all(
        bool(_trimmed(one, street.index(node) == 0).distance(_trimmed(two, other.index(node) == 0)) >= CLEARANCE_M)
        for node in shared
    )


def _trimmed(line: LineString, at_start: bool) -> LineString:
    """A road without its stretch at the shared crossing."""
    cut = min(CROSSING_M, 0.45 * line.length)
    return substring(line, cut, line.length) if at_start else substring(line, 0.0, line.length - cut)


def _tightest_radius_m(curve_m: FloatArray) -> float:
    step = np.diff(curve_m, axis=0)
    turn = np.abs(wrap(np.diff(np.arctan2(step[:, 1], step[:, 0]))))
    length = np.linalg.norm(step, axis=1)
    return float(1.0 / max(1e-9, float((turn / (0.5 * (length[1:] + length[:-1]))).max())))


def _in_pieces(plan: Plan) -> Plan:
    """Each road cut into nearly equal pieces of about ``PIECE_M``, as converters from other formats deliver them."""
    nodes = list(plan.nodes_m)
    streets: list[Street] = []
    shapes: list[FloatArray] = []
    for (a, b), shape in zip(plan.streets, plan.shapes_m, strict=True):
        line = LineString(shape)
        pieces = max(1, round(line.length / PIECE_M))
        stops = [a, *range(len(nodes), len(nodes) + pieces - 1), b]
        cuts = np.linspace(0.0, line.length, pieces + 1)
        parts = [_resampled(line, cuts[i], cuts[i + 1]) for i in range(pieces)]
        nodes.extend(part[-1] for part in parts[:-1])
        streets.extend((stops[i], stops[i + 1]) for i in range(pieces))
        shapes.extend(parts)
    return Plan(np.array(nodes), tuple(streets), tuple(shapes))


def _resampled(line: LineString, begin_m: float, end_m: float) -> FloatArray:
    """A stretch of a line in equal steps, the last no shorter than the others (a short one would look like a kink)."""
    stops = np.linspace(begin_m, end_m, max(2, round((end_m - begin_m) / DRAWING_STEP_M) + 1))
    return np.array([line.interpolate(stop).coords[0] for stop in stops])
