"""Paint along the borders of the lane as factors between keyframes: how far one lies ahead of the other along the road.

Where a border has dashes, their ends pass from one keyframe to the next, and who comes by again sees them again. Either tells the
way between two keyframes to one or two decimetres, whatever the wheels say (``core.reading.dashes``).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from hippodrome.core.reading.dashes import (
    FIRST_M,
    LEFT,
    NEXT_LANE_M,
    PLACES,
    RIGHT,
    SAME_LANE_M,
    SAME_WAY_RAD,
    SIGMA_M,
    STEP_M,
    ahead_by_paint,
    shared_borders,
)
from hippodrome.core.refinement.factors import BinaryFactors, State
from hippodrome.core.se2 import between, wrap
from hippodrome.core.solvers.robust import geman_mcclure_weight
from hippodrome.core.types import Edges, FloatArray, IntArray, UInt8Array, Visits

PASSED_M: Final = (0.7, 6.0)  # way between consecutive keyframes whose frames are compared
PASSED_REACH_M: Final = 1.0  # by which the wheels may be wrong over that way
PAINT_EDGE: Final = 255  # in the place of an ``EdgeKind``: such edges are not kept with the map
NEAR_M: Final = 5.0  # along the road, within which keyframes of two visits are compared
REVISIT_REACH_M: Final = 3.5  # by which their places may be wrong: dashes repeat after 6 m and more
FACING_M: Final = 2.0 * FIRST_M + STEP_M * (PLACES - 1)  # way between oncoming vehicles that look at one stretch of a line
LATER: Final = 12  # keyframes after which a visit is another one
UNTOLD: Final = 1e4  # standard deviation (m, rad) of what paint does not tell
LOSES_AT: Final = 3.0  # error in sigmas at which a comparison has lost three quarters of its weight


def passed_m(paint: UInt8Array, state: State) -> FloatArray:
    """The way (S - 1,) from each keyframe to the next as the paint that passed tells it; nan where it does not.

    Args:
        paint: (S, 2, PAINT_PLACES) of the keyframes.
        state: where they are, to half a metre from one to the next.
    """
    way_m = np.full(len(paint) - 1, np.nan)
    expected_m = np.linalg.norm(np.diff(state.poses[:, :2], axis=0), axis=1)
    dashed = paint.max(axis=2) > 0
    compared = np.any(dashed[:-1] & dashed[1:], axis=1) & (expected_m > PASSED_M[0]) & (expected_m < PASSED_M[1])
    for i in np.flatnonzero(compared).tolist():
        told = [ahead_by_paint(paint[i, b], paint[i + 1, b], float(expected_m[i]), PASSED_REACH_M) for b in (0, 1)]
        way_m[i] = _mean_of_finite(told)
    return way_m


def revisits(paint: UInt8Array, state: State) -> Edges:
    """Edges between keyframes of different visits of one stretch of road, from the earlier to the later one.

    Each keyframe is compared with the nearest earlier one in its lane, in either lane beside, and with the oncoming one that
    looked at most of the same line. The edges are of the kind ``PAINT_EDGE``: in metres, and of their motion only the way along
    the road is told.

    Args:
        paint: (S, 2, PAINT_PLACES) of the S keyframes.
        state: where they are, to about two metres along the road.
    """
    rows = np.flatnonzero(paint.any(axis=(1, 2)))
    poses = state.poses[rows]
    reach_m = math.hypot(FACING_M + NEAR_M, NEXT_LANE_M[1])
    pairs = cKDTree(poses[:, :2]).query_pairs(reach_m, output_type="ndarray") if len(rows) else np.zeros((0, 2), dtype=np.int64)
    pairs = pairs[rows[pairs[:, 1]] - rows[pairs[:, 0]] >= LATER]
    seen = between(poses[pairs[:, 0]], poses[pairs[:, 1]])
    facing = np.abs(wrap(seen[:, 2] - math.pi)) < SAME_WAY_RAD
    aside = np.abs(seen[:, 1])
    beside = (aside > NEXT_LANE_M[0]) & (aside < NEXT_LANE_M[1])
    same_way = (np.abs(seen[:, 2]) < SAME_WAY_RAD) & (beside | (aside < SAME_LANE_M))
    expected_m = seen[:, 0] - np.where(facing, FACING_M, 0.0)
    relation = np.where(facing, 2.0, np.where(beside, np.sign(seen[:, 1]), 0.0))
    order = np.flatnonzero((np.abs(expected_m) < NEAR_M) & (same_way | (facing & beside)))
    order = order[np.lexsort((np.abs(expected_m[order]), relation[order], pairs[order, 1]))]
    found: list[tuple[int, int, float]] = []
    last = (-1, 0.0)
    for k in order.tolist():
        earlier, later = int(rows[pairs[k, 0]]), int(rows[pairs[k, 1]])
        if last == (later, float(relation[k])):
            continue
        way_m = _way_m(paint[earlier], paint[later], float(expected_m[k]), float(seen[k, 1]), bool(facing[k]))
        if math.isfinite(way_m):
            found.append((earlier, later, way_m + (FACING_M if facing[k] else 0.0)))
            last = later, float(relation[k])
    return _edges(found)


def _way_m(earlier: UInt8Array, later: UInt8Array, expected_m: float, left_m: float, facing: bool) -> float:
    """By how far two keyframes with this paint (2, PAINT_PLACES) are apart; the later one is ``left_m`` to the left.

    An oncoming vehicle sees the line between both the other way round, as one does that is ``FACING_M`` behind it and looks on.
    """
    if facing:
        border = LEFT if left_m > 0.0 else RIGHT
        return float(ahead_by_paint(earlier[border], later[border, ::-1].copy(), expected_m, REVISIT_REACH_M))
    borders = shared_borders(left_m)
    return _mean_of_finite([ahead_by_paint(earlier[a], later[b], expected_m, REVISIT_REACH_M) for a, b in borders])


def _mean_of_finite(told: list[float]) -> float:
    finite = [one for one in told if math.isfinite(one)]
    return sum(finite) / len(finite) if finite else math.nan


def _edges(found: list[tuple[int, int, float]]) -> Edges:
    count = len(found)
    ends: IntArray = np.array([one[:2] for one in found], dtype=np.int32).reshape(-1, 2)
    motion = np.zeros((count, 3))
    motion[:, 0] = [one[2] for one in found]
    return Edges(
        source=ends[:, 0],
        target=ends[:, 1],
        motion=motion,
        sigma=np.tile([SIGMA_M, UNTOLD, UNTOLD], (count, 1)),
        kind=np.full(count, PAINT_EDGE, dtype=np.uint8),
        margin=np.zeros(count, dtype=np.float32),
    )


def with_revisits(closures: Edges, found: Edges) -> Edges:
    """Closures and revisits as one array of edges."""
    names = ("source", "target", "motion", "sigma", "kind", "margin")
    return replace(closures, **{name: np.concatenate([getattr(closures, name), getattr(found, name)]) for name in names})


def passed_factors(state: State, way_m: FloatArray, gyro: int) -> BinaryFactors:
    """The way from each keyframe to the next by the paint that passed: one component, with a Geman-McClure weight.

        r_i = (|p_{i+1} - p_i| - d_i) / sigma

    Where no paint told d_i, residual and Jacobians are 0.
    """
    step = np.diff(state.poses[:, :2], axis=0)
    length = np.maximum(np.linalg.norm(step, axis=1), 1e-6)
    told = np.isfinite(way_m)
    residual = np.where(told, length - np.where(told, way_m, 0.0), 0.0) / SIGMA_M
    weight = np.where(told, geman_mcclure_weight(residual**2, LOSES_AT**2), 0.0)
    gain = np.sqrt(weight)
    target = np.zeros((len(step), 1, state.width))
    target[:, 0, :2] = step / length[:, None] * (gain / SIGMA_M)[:, None]
    no_gyro = np.zeros((len(step), 1, gyro))
    return BinaryFactors((residual * gain)[:, None], -target, target, no_gyro, weight[:, None])


def painted(visits: Visits) -> UInt8Array | None:
    """The paint (S, 2, PAINT_PLACES) at the keyframes, if any was kept; a copy, as a map read from a file is read-only."""
    return None if visits.lane is None or visits.lane.paint is None else visits.lane.paint.copy()
