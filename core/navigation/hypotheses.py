"""Hypotheses of the place: particles on the lanes of a network, in compiled loops.

Monte Carlo localization (Dellaert, Fox, Burgard, Thrun, "Monte Carlo localization for mobile robots", ICRA 1999) on a road
network as in Brubaker, Geiger, Urtasun, "Lost! Leveraging the crowd for probabilistic visual self-localization" (CVPR 2013). A
particle is a pose that moves by dead reckoning with its own scale, and the place on the lanes that it belongs to: where a lane
ends, it is split over all ways on. What it is worth is told by how well it keeps to its lane, and by what is seen of the ground.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numba import njit

from hippodrome.core.types import FloatArray, Int8Array, IntArray, UInt8Array

X, Y, HEADING, SCALE, WEIGHT, ALONG, ASIDE, TURN = range(8)  # columns: SCALE in standard deviations, WEIGHT a logarithm
COLUMNS: Final = 8
UNLIKELY: Final = 2.0  # the most that one glance at the lane counts against a particle: it may be the lane that is misjudged
FREE_ASIDE_M, ASIDE_M, TURN_RAD = 1.0, 1.0, 0.25  # off the lane's middle by less is usual; what is not has these deviations
PER_M: Final = 0.15  # weight of keeping to the lane, per metre
DEAD_END: Final = 3.0  # the price of a metre beyond the end of all lanes
AGAINST_RAD: Final = 2.0  # against its lane a particle has turned round
LATE_M: Final = 0.3  # beyond its border a particle changes to the lane beside it


def scattered(pose: FloatArray, scatter: FloatArray, along_m: float, aside_m: float, lane_rad: float) -> FloatArray:
    """Particles (n, COLUMNS) about a pose (3,) on a lane: ``scatter`` (n, 4) is added to x, y, heading and the scale."""
    rows = np.zeros((len(scatter), COLUMNS))
    rows[:, :4] = scatter + np.array([*pose, 0.0])
    rows[:, ALONG], rows[:, ASIDE] = along_m, aside_m
    rows[:, TURN] = math.remainder(float(pose[2]) - lane_rad, 2.0 * math.pi)
    return rows


def move_aside(rows: FloatArray, aside_m: float) -> None:
    """Move particles to the left of their headings."""
    rows[:, X] -= aside_m * np.sin(rows[:, HEADING])
    rows[:, Y] += aside_m * np.cos(rows[:, HEADING])
    rows[:, ASIDE] += aside_m


@njit(cache=True)
def _wrap(angle: float) -> float:
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@njit(cache=True)
def _settle(
    row: FloatArray, segment: int, begin: FloatArray, direction: FloatArray, length: FloatArray, position: FloatArray
) -> None:
    """Enter where a particle is on its segment: along its lane, aside of it, and turned against it."""
    dx, dy = row[X] - begin[segment, 0], row[Y] - begin[segment, 1]
    ux, uy = direction[segment, 0], direction[segment, 1]
    row[ALONG] = position[segment] + ux * dx + uy * dy
    row[ASIDE] = ux * dy - uy * dx
    row[TURN] = _wrap(row[HEADING] - math.atan2(uy, ux))


@njit(cache=True)
def move(
    rows: FloatArray,
    segments: IntArray,
    count: int,
    distance_m: float,
    turned_rad: float,
    scale_sigma: float,
    segment_lane: IntArray,
    segment_start: IntArray,
    begin: FloatArray,
    direction: FloatArray,
    length: FloatArray,
    position: FloatArray,
    successor: IntArray,
    successor_start: IntArray,
    left_lane: IntArray,
    right_lane: IntArray,
    width: FloatArray,
    lane_length: FloatArray,
) -> int:
    """Move ``count`` particles and weigh how they keep to their lanes; returns how many there are then: some have split."""
    alive = count
    for i in range(count):
        row = rows[i]
        step = distance_m * math.exp(scale_sigma * row[SCALE])
        chord = row[HEADING] + 0.5 * turned_rad
        row[X] += step * math.cos(chord)
        row[Y] += step * math.sin(chord)
        row[HEADING] = _wrap(row[HEADING] + turned_rad)
        segment = segments[i]
        for _ in range(64):
            lane = segment_lane[segment]
            along = direction[segment, 0] * (row[X] - begin[segment, 0]) + direction[segment, 1] * (row[Y] - begin[segment, 1])
            if along < 0.0 and segment > segment_start[lane] and distance_m < 0.0:
                segment -= 1
                continue
            if along <= length[segment]:
                break
            if segment + 1 < segment_start[lane + 1]:
                segment += 1
                continue
            first, last = successor_start[lane], successor_start[lane + 1]
            if first == last:
                row[WEIGHT] -= DEAD_END * abs(step)
                break
            ways = last - first
            row[WEIGHT] -= math.log(ways)
            for k in range(first + 1, last):
                if alive < len(rows):
                    rows[alive] = row
                    segments[alive] = segment_start[successor[k]]
                    _settle(rows[alive], segments[alive], begin, direction, length, position)
                    alive += 1
            segment = segment_start[successor[first]]
        _settle(row, segment, begin, direction, length, position)
        lane = segment_lane[segment]
        beside = left_lane[lane] if row[ASIDE] > 0.0 else right_lane[lane]
        if beside >= 0 and abs(row[ASIDE]) > 0.5 * width[lane] + LATE_M:
            there = row[ALONG] * lane_length[beside] / max(lane_length[lane], 1e-6)
            segment = segment_start[beside]
            while segment + 1 < segment_start[beside + 1] and position[segment + 1] <= there:
                segment += 1
            _settle(row, segment, begin, direction, length, position)
        segments[i] = segment
        far = max(abs(row[ASIDE]) - FREE_ASIDE_M, 0.0) / ASIDE_M
        bent = row[TURN] / TURN_RAD
        row[WEIGHT] -= PER_M * abs(step) * (min(0.5 * far * far, UNLIKELY) + min(0.5 * bent * bent, UNLIKELY))
    return alive


@njit(cache=True)
def turn_round(
    rows: FloatArray, segments: IntArray, count: int, segment_lane: IntArray, segment_start: IntArray, begin: FloatArray,
    direction: FloatArray, length: FloatArray, position: FloatArray, opposite: IntArray, lane_length: FloatArray,
) -> None:  # fmt: skip
    """Take particles that have turned against their lanes to the lanes of the opposite direction, -1 where there is none."""
    for i in range(count):
        lane = segment_lane[segments[i]]
        other = opposite[lane]
        if abs(rows[i, TURN]) < AGAINST_RAD or other < 0:
            continue
        there = (1.0 - rows[i, ALONG] / max(lane_length[lane], 1e-6)) * lane_length[other]
        segment = segment_start[other]
        while segment + 1 < segment_start[other + 1] and position[segment + 1] <= there:
            segment += 1
        segments[i] = segment
        _settle(rows[i], segment, begin, direction, length, position)


@njit(cache=True)
def see(
    rows: FloatArray,
    count: int,
    points: FloatArray,
    kinds: UInt8Array,
    other: int,
    levels: Int8Array,
    corner: FloatArray,
    cell_m: float,
    cost: FloatArray,
    weight: float,
    agreement: FloatArray,
) -> None:
    """Weigh particles by the ground: points in the vehicle's axes that are seen to be road, or of the kind ``other``.

    ``cost`` (2, 256) is what it costs at a level of the raster (less its least) that road is seen, and what it costs that it is
    not. ``agreement`` (n,) takes the share of the points whose kind is the one of the raster.
    """
    most = len(cost[0]) // 2
    for i in range(count):
        cos, sin = math.cos(rows[i, HEADING]), math.sin(rows[i, HEADING])
        x, y = rows[i, X] - corner[0], rows[i, Y] - corner[1]
        total, fits = 0.0, 0
        for k in range(len(points)):
            a = math.floor((x + cos * points[k, 0] - sin * points[k, 1]) / cell_m)
            b = math.floor((y + sin * points[k, 0] + cos * points[k, 1]) / cell_m)
            level = -most if a < 0 or b < 0 or a >= levels.shape[0] or b >= levels.shape[1] else int(levels[a, b])
            is_other = 1 if kinds[k] == other else 0
            total += cost[is_other, level + most]
            fits += 1 if (level > 0) != (is_other == 1) else 0
        rows[i, WEIGHT] -= weight * total
        agreement[i] = fits / max(len(points), 1)


@njit(cache=True)
def correct_by_lane(
    rows: FloatArray, segments: IntArray, count: int, segment_lane: IntArray, internal: np.ndarray, direction: FloatArray,
    offset_m: float, heading_rad: float, sigma_m: float, gate_m: float, gate_rad: float, gain: float, weight: float,
) -> None:  # fmt: skip
    """Pull particles on roads towards the place across the lane that was read, and weigh them by how far they were from it."""
    for i in range(count):
        segment = segments[i]
        if internal[segment_lane[segment]]:
            continue
        off, turn = offset_m - rows[i, ASIDE], _wrap(heading_rad - rows[i, TURN])
        cost = min(0.5 * (off / sigma_m) ** 2, UNLIKELY) + min(0.5 * (turn / TURN_RAD) ** 2, UNLIKELY)
        rows[i, WEIGHT] -= weight * cost
        if abs(off) < gate_m and abs(turn) < gate_rad:
            rows[i, X] -= gain * off * direction[segment, 1]
            rows[i, Y] += gain * off * direction[segment, 0]
            rows[i, ASIDE] += gain * off
            rows[i, HEADING] = _wrap(rows[i, HEADING] + gain * turn)
            rows[i, TURN] += gain * turn


@njit(cache=True)
def weigh_by_end(
    rows: FloatArray, segments: IntArray, count: int, segment_lane: IntArray, internal: np.ndarray, lane_length: FloatArray,
    end_m: float, sigma_m: float, outlier: float, weight: float,
) -> None:  # fmt: skip
    """Weigh particles by the end of the lane that was seen ``end_m`` ahead."""
    for i in range(count):
        lane = segment_lane[segments[i]]
        off = 99.0 if internal[lane] else (lane_length[lane] - rows[i, ALONG] - end_m) / sigma_m
        rows[i, WEIGHT] += weight * math.log(outlier + (1.0 - outlier) * math.exp(-0.5 * min(off * off, 200.0)))


@njit(cache=True)
def weigh_by_pose(
    rows: FloatArray, count: int, pose: FloatArray, sigma_m: float, sigma_rad: float, outlier: float, weight: float
) -> None:
    """Weigh particles by a pose (3,) that is told by something that errs now and then."""
    for i in range(count):
        dx, dy, turn = rows[i, X] - pose[0], rows[i, Y] - pose[1], _wrap(rows[i, HEADING] - pose[2]) / sigma_rad
        far = (dx * dx + dy * dy) / sigma_m**2 + turn * turn
        rows[i, WEIGHT] += weight * math.log(outlier + (1.0 - outlier) * math.exp(-0.5 * min(far, 200.0)))


@njit(cache=True)
def resampled(rows: FloatArray, segments: IntArray, share: FloatArray, wanted: int, begin_at: float) -> IntArray:
    """Rows that systematic resampling keeps, ``wanted`` of them; ``share`` adds up to 1, ``begin_at`` lies in [0, 1)."""
    chosen = np.empty(wanted, dtype=np.int32)
    total, k = share[0], 0
    for i in range(wanted):
        at = (i + begin_at) / wanted
        while total < at and k + 1 < len(share):
            k += 1
            total += share[k]
        chosen[i] = k
    return chosen
