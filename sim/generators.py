"""Plans of towns: crossings and the streets between them, before netconvert makes lanes of them.

Every plan keeps at least two streets at each crossing, so that no tour ever has to turn round.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree
from scipy.spatial import Delaunay

from hippodrome.core.se2 import wrap
from hippodrome.core.types import FloatArray

MIN_CORNER_RAD: Final = np.deg2rad(50.0)  # streets leaving a crossing closer than this would overlap for many metres
MAX_ARMS: Final = 4  # more streets at one crossing are rare and make star-shaped junctions
GRID_JITTER: Final = 0.16  # of a block: enough that no two blocks look alike, too little to fold the grid
MIN_CROSSINGS: Final = 2  # with fewer, there is no choice of way and the two driving directions never meet
MISSING_BLOCKS: Final = 0.15  # share of streets left out of the grid and the rings
CROSSING_REACH_M: Final = 10.0  # netconvert's junction areas reach this far into each arm, on average over the four kinds
MAX_KINK_RAD: Final = np.deg2rad(20.0)  # SUMO, too, calls anything below this straight on
RING_STEP_RAD: Final = np.deg2rad(4.0)  # drawing detail of circular streets

Street: TypeAlias = tuple[int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """N crossings and the two-way streets between them, each drawn as a polyline from its first crossing to its second."""

    nodes_m: FloatArray  # (N, 2)
    streets: tuple[Street, ...]
    shapes_m: tuple[FloatArray, ...]  # (n, 2) each, end points included

    def length_m(self) -> float:
        """Length of all streets between the paved crossings, each street counted once."""
        drawn = sum(float(np.linalg.norm(np.diff(shape, axis=0), axis=1).sum()) for shape in self.shapes_m)
        through = through_nodes(self)
        ends = sum(not through[node] for street in self.streets for node in street)
        return drawn - ends * CROSSING_REACH_M


def closest_plan(make: Callable[[int], Plan], sizes: Sequence[int], length_m: float) -> Plan:
    """The plan of the size whose streets add up closest to ``length_m``; a town with crossings before a mere ring."""
    plans = [make(size) for size in sizes]
    return min(plans, key=lambda plan: (_crossings(plan) < MIN_CROSSINGS, abs(plan.length_m() - length_m)))


def _crossings(plan: Plan) -> int:
    """Nodes where there is a choice of way."""
    return int(np.count_nonzero(_arm_counts(len(plan.nodes_m), plan.streets) >= 3))


def grid_plan(width_m: float, height_m: float, blocks: int, rng: np.random.Generator) -> Plan:
    """A grid of about ``blocks`` blocks with jittered crossings and some streets missing."""
    columns = max(1, round(float(np.sqrt(blocks * width_m / height_m)))) + 1
    rows = max(1, round(blocks / (columns - 1))) + 1
    spacing = np.array([width_m / (columns - 1), height_m / (rows - 1)])
    lattice = np.stack(np.meshgrid(np.arange(columns), np.arange(rows), indexing="xy"), axis=-1).reshape(-1, 2)
    nodes: FloatArray = (lattice + GRID_JITTER * rng.uniform(-1.0, 1.0, lattice.shape)) * spacing
    east = [(i, i + 1) for i in range(len(nodes)) if (i + 1) % columns]
    north = [(i, i + columns) for i in range(len(nodes) - columns)]
    streets = _thinned(len(nodes), east + north, MISSING_BLOCKS, rng)
    return Plan(nodes, streets, tuple(nodes[list(street)] for street in streets))


def radial_plan(width_m: float, height_m: float, rings: int, arms: int, rng: np.random.Generator) -> Plan:
    """Ring roads round an open centre, joined by radial streets; angles and radii jittered, some streets missing."""
    angle = 2.0 * np.pi * (np.arange(arms) + rng.uniform(-0.15, 0.15, (rings, arms))) / arms
    radius = (np.arange(1, rings + 1)[:, None] + rng.uniform(-0.2, 0.2, (rings, arms))) / (rings + 0.2)
    scale = np.array([0.5 * width_m, 0.5 * height_m])
    polar = np.stack([radius, angle], axis=-1).reshape(-1, 2)
    nodes = _from_polar(polar) * scale
    around = [(r * arms + a, r * arms + (a + 1) % arms) for r in range(rings) for a in range(arms)]
    outward = [(i, i + arms) for i in range((rings - 1) * arms)]
    streets = _thinned(len(nodes), around + outward, MISSING_BLOCKS, rng)
    shapes = tuple(_arc(polar[a], polar[b]) * scale for a, b in streets)
    return Plan(nodes, streets, shapes)


def spread_nodes(width_m: float, height_m: float, count: int, rng: np.random.Generator) -> FloatArray:
    """``count`` crossings (count, 2), irregular but evenly spread: each the best of 20 random candidates (Mitchell, 1991)."""
    box = np.array([width_m, height_m])
    nodes = rng.uniform(size=(1, 2)) * box
    while len(nodes) < count:
        candidates = rng.uniform(size=(20, 2)) * box
        gap = np.linalg.norm(candidates[:, None] - nodes[None], axis=-1).min(axis=1)
        nodes = np.concatenate([nodes, candidates[np.argmax(gap)][None]])
    return np.asarray(nodes, dtype=np.float64)


def planar_streets(nodes_m: FloatArray, length_m: float, rng: np.random.Generator) -> tuple[Street, ...]:
    """Streets between irregular crossings: a spanning tree of Delaunay's edges, then more until dead ends are gone and the
    length is reached, wherever corners stay open and crossings have at most ``MAX_ARMS`` arms."""
    pairs = _delaunay_pairs(nodes_m)
    length = np.linalg.norm(nodes_m[pairs[:, 0]] - nodes_m[pairs[:, 1]], axis=1)
    cost = length * rng.lognormal(0.0, 0.25, len(length))
    count = len(nodes_m)
    tree = minimum_spanning_tree(coo_array((cost, (pairs[:, 0], pairs[:, 1])), shape=(count, count)))
    streets = [(int(a), int(b)) for a, b in zip(*tree.nonzero(), strict=True)]
    order = [(int(a), int(b)) for a, b in pairs[np.argsort(cost)]]
    for only_dead_ends in (True, False):
        for street in order:
            arms = _arm_counts(count, streets)
            dead_end = min(arms[street[0]], arms[street[1]]) < 2
            enough = not only_dead_ends and _straight_length_m(nodes_m, streets) >= length_m
            if street not in streets and (dead_end or not (only_dead_ends or enough)) and _fits(nodes_m, streets, street):
                streets.append(street)
    return _without_dead_ends(count, streets)


def compact(plan: Plan) -> Plan:
    """The plan without crossings that no street reaches."""
    used = sorted({node for street in plan.streets for node in street})
    number = {node: i for i, node in enumerate(used)}
    return Plan(plan.nodes_m[used], tuple((number[a], number[b]) for a, b in plan.streets), plan.shapes_m)


def without_dead_ends(plan: Plan) -> Plan:
    """The plan without streets that lead nowhere."""
    kept = set(_without_dead_ends(len(plan.nodes_m), list(plan.streets)))
    pairs = [(street, shape) for street, shape in zip(plan.streets, plan.shapes_m, strict=True) if street in kept]
    return compact(Plan(plan.nodes_m, tuple(street for street, _ in pairs), tuple(shape for _, shape in pairs)))


def through_nodes(plan: Plan) -> tuple[bool, ...]:
    """For each crossing whether it is none: two streets that meet within ``MAX_KINK_RAD`` of straight on."""
    leaving: list[list[float]] = [[] for _ in plan.nodes_m]
    for (a, b), shape in zip(plan.streets, plan.shapes_m, strict=True):
        for node, (near, far) in ((a, shape[:2]), (b, shape[-2:][::-1])):
            leaving[node].append(float(np.arctan2(far[1] - near[1], far[0] - near[0])))
    bends = (arms[1] - arms[0] - np.pi if len(arms) == 2 else np.pi for arms in leaving)
    return tuple(bool(abs(wrap(np.asarray(bend))) < MAX_KINK_RAD) for bend in bends)


def _thinned(count: int, streets: list[Street], share: float, rng: np.random.Generator) -> tuple[Street, ...]:
    """Leaves out a share of the streets at random, never one that would make a dead end or cut the town in two."""
    kept = list(streets)
    for i in rng.permutation(len(streets)):
        if len(streets) - len(kept) >= share * len(streets):
            break
        rest = [street for street in kept if street != streets[i]]
        if _arm_counts(count, rest).min() >= 2 and _is_connected(count, rest):
            kept = rest
    return tuple(kept)


def _without_dead_ends(count: int, streets: list[Street]) -> tuple[Street, ...]:
    arms = _arm_counts(count, streets)
    kept = [street for street in streets if min(arms[street[0]], arms[street[1]]) >= 2]
    return tuple(kept) if len(kept) == len(streets) else _without_dead_ends(count, kept)


def _fits(nodes_m: FloatArray, streets: list[Street], street: Street) -> bool:
    """Whether a street leaves all corners at both of its crossings open enough."""
    for here, there in (street, street[::-1]):
        others = [b if a == here else a for a, b in streets if here in (a, b)]
        if len(others) >= MAX_ARMS:
            return False
        if others and _corner_rad(nodes_m, here, there, others) < MIN_CORNER_RAD:
            return False
    return True


def _corner_rad(nodes_m: FloatArray, here: int, there: int, others: list[int]) -> float:
    bearing = np.arctan2(*(nodes_m[others] - nodes_m[here]).T[::-1])
    own = np.arctan2(*(nodes_m[there] - nodes_m[here])[::-1])
    return float(np.abs(wrap(bearing - own)).min())


def _delaunay_pairs(nodes_m: FloatArray) -> np.ndarray[tuple[int, int], np.dtype[np.int64]]:
    corners = Delaunay(nodes_m).simplices
    pairs = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [0, 2]]]), axis=1)
    return np.unique(pairs, axis=0).astype(np.int64)


def _arm_counts(count: int, streets: Sequence[Street]) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.bincount(np.array(streets, dtype=np.int64).ravel(), minlength=count)


def _is_connected(count: int, streets: list[Street]) -> bool:
    source, target = np.array(streets).T
    parts, _ = connected_components(coo_array((np.ones(len(source)), (source, target)), shape=(count, count)), directed=False)
    return bool(parts == 1)


def _straight_length_m(nodes_m: FloatArray, streets: list[Street]) -> float:
    source, target = np.array(streets).T
    return float(np.linalg.norm(nodes_m[source] - nodes_m[target], axis=1).sum())


def _from_polar(polar: FloatArray) -> FloatArray:
    """Points (n, 2) from rows (radius, angle_rad)."""
    points: FloatArray = polar[:, :1] * np.stack([np.cos(polar[:, 1]), np.sin(polar[:, 1])], axis=1)
    return points


def _arc(start: FloatArray, end: FloatArray) -> FloatArray:
    """A street between two polar points that turns round the centre the short way."""
    turn = float(wrap(end[1] - start[1]))
    share = np.linspace(0.0, 1.0, 2 + int(abs(turn) / RING_STEP_RAD))[:, None]
    return _from_polar(start + share * np.array([end[0] - start[0], turn]))
