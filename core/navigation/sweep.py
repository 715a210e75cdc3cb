"""The way that a car can drive: of all that its turning circle and wheels allow, the one nearest to a line and clear of borders.

A beam search over curvatures: step by step each way that is kept is continued with every change of curvature that the wheels can
make, ways whose swept body touches a border are dropped, and of ways that are at the same place only the best is kept.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from hippodrome.core.types import FloatArray, UInt8Array

STEP_M = 0.5  # of the search
STEPS = 22
BEAM = 64  # ways that are kept at each step
UNIT_1PM = 0.02  # of curvature
MOST_UNITS = 16  # a little less than the turning circle
CHANGES = np.array([0, -1, 1, -3, 3, -7, 7])  # of curvature in a step; a car at walking pace turns its wheels so fast
COMFORT_M = 1.25  # from the car's middle line to a border; nearer costs
ROOM_WEIGHT, HEADING_WEIGHT, CHANGE_WEIGHT, UNSEEN_COST = 6.0, 1.5, 8.0, 0.2
BODY_M = np.array([0.0, 1.35, 2.7, 3.4])  # points of the middle line that are kept clear, ahead of the rear axle ..
BODY_LESS_M = np.array([0.0, 0.0, 0.0, 0.35])  # .. and how much nearer to a border they may be: the bumper is rounded
WHEELS_M = np.array([[0.0, -0.9], [0.0, 0.9], [2.7, -0.9], [2.7, 0.9]])  # where the ground should have been seen
OUTWARD_WEIGHT = 3.0  # what is off the line on the side of the oncoming lane counts more
SLOTS = 4096  # for places that are taken
REACH = 7  # samples of the line, within which it is followed in one step


@njit(cache=True)
def distance_at(field: FloatArray, corner: FloatArray, cell_m: float, x: float, y: float) -> float:
    """The distance field between its cells' middles; far away beyond its rim."""
    u, v = (x - corner[0]) / cell_m - 0.5, (y - corner[1]) / cell_m - 0.5
    i, j = math.floor(u), math.floor(v)
    if i < 0 or j < 0 or i >= field.shape[0] - 1 or j >= field.shape[1] - 1:
        return 7.0
    p, q = u - i, v - j
    low = (1.0 - q) * field[i, j] + q * field[i, j + 1]
    high = (1.0 - q) * field[i + 1, j] + q * field[i + 1, j + 1]
    return float((1.0 - p) * low + p * high)


@njit(cache=True)
def room_m(field: FloatArray, corner: FloatArray, cell_m: float, x: float, y: float, heading: float) -> float:
    """Distance from the car's middle line to the nearest border."""
    cos, sin = math.cos(heading), math.sin(heading)
    least = 99.0
    for k in range(len(BODY_M)):
        d = distance_at(field, corner, cell_m, x + BODY_M[k] * cos, y + BODY_M[k] * sin)
        least = min(least, d + BODY_LESS_M[k])
    return least


@njit(cache=True)
def _is_unseen(cells: UInt8Array, corner: FloatArray, cell_m: float, x: float, y: float) -> bool:
    i, j = math.floor((x - corner[0]) / cell_m), math.floor((y - corner[1]) / cell_m)
    return bool(i < 0 or j < 0 or i >= cells.shape[0] or j >= cells.shape[1] or cells[i, j] == 0)


@njit(cache=True)
def drivable(
    field: FloatArray, cells: UInt8Array, corner: FloatArray, cell_m: float, pose: FloatArray, bend: float, line: FloatArray,
    need_m: float, side: float = 0.0,
) -> FloatArray:  # fmt: skip
    """The way from a pose, as rows (n, 4) of curvature, heading, room and whether the ground is unseen, one per ``STEP_M``.

    Args:
        field: distance to the nearest border, in metres; its cells lie from ``corner`` on, ``cell_m`` wide.
        cells: what is known of the same cells; 0 is unknown.
        pose: of the rear axle.
        bend: curvature at which the wheels stand.
        line: (n, 3) places and headings of the line to keep to.
        need_m: room that the car must have; where it has less now, it may not get less.
        side: of the border that the line keeps to: -1 right, +1 left. Away from it lies the oncoming lane; 0 for neither.

    Returns:
        Fewer than ``STEPS`` rows where there is no way on.
    """
    x, y, h = np.zeros((STEPS + 1, BEAM)), np.zeros((STEPS + 1, BEAM)), np.zeros((STEPS + 1, BEAM))
    units, on_line = np.zeros((STEPS + 1, BEAM), np.int64), np.zeros((STEPS + 1, BEAM), np.int64)
    parent, cost = np.zeros((STEPS + 1, BEAM), np.int64), np.zeros((STEPS + 1, BEAM))
    rooms, unseen = np.zeros((STEPS + 1, BEAM)), np.zeros((STEPS + 1, BEAM))
    most = BEAM * len(CHANGES)
    new, new_units, new_line = np.zeros((most, 6)), np.zeros(most, np.int64), np.zeros(most, np.int64)
    new_parent = np.zeros(most, np.int64)
    taken = np.full(SLOTS, -1, np.int64)
    x[0, 0], y[0, 0], h[0, 0] = pose[0], pose[1], pose[2]
    units[0, 0] = min(max(round(bend / UNIT_1PM), -MOST_UNITS), MOST_UNITS)
    need = min(need_m, room_m(field, corner, cell_m, pose[0], pose[1], pose[2]) - 0.03)
    count, depth = 1, 0
    for step in range(1, STEPS + 1):
        found = 0
        for b in range(count):
            last = step - 1
            for c in range(len(CHANGES)):
                unit = units[last, b] + CHANGES[c]
                if abs(unit) > MOST_UNITS:
                    continue
                turn = unit * UNIT_1PM * STEP_M
                chord = h[last, b] + 0.5 * turn
                nx, ny = x[last, b] + STEP_M * math.cos(chord), y[last, b] + STEP_M * math.sin(chord)
                nh = h[last, b] + turn
                room = room_m(field, corner, cell_m, nx, ny, nh)
                if room < need:
                    continue
                at, off = on_line[last, b], 1e9
                for j in range(on_line[last, b], min(on_line[last, b] + REACH, len(line))):
                    d = (line[j, 0] - nx) ** 2 + (line[j, 1] - ny) ** 2
                    if d < off:
                        off, at = d, j
                askew = (nh - line[at, 2] + math.pi) % (2.0 * math.pi) - math.pi
                dark = 0.0
                for k in range(len(WHEELS_M)):
                    ahead, aside = WHEELS_M[k]
                    wx = nx + ahead * math.cos(nh) - aside * math.sin(nh)
                    wy = ny + ahead * math.sin(nh) + aside * math.cos(nh)
                    dark += 1.0 if _is_unseen(cells, corner, cell_m, wx, wy) else 0.0
                outward = math.cos(line[at, 2]) * (ny - line[at, 1]) - math.sin(line[at, 2]) * (nx - line[at, 0])
                if outward * side < 0.0:
                    off *= OUTWARD_WEIGHT
                near = max(COMFORT_M - room, 0.0)
                price = cost[last, b] + off + HEADING_WEIGHT * askew**2 + ROOM_WEIGHT * near**2
                price += CHANGE_WEIGHT * (CHANGES[c] * UNIT_1PM) ** 2 + UNSEEN_COST * dark
                new[found, 0], new[found, 1], new[found, 2], new[found, 3] = nx, ny, nh, price
                new[found, 4], new[found, 5] = room, dark
                new_units[found], new_line[found], new_parent[found] = unit, at, b
                found += 1
        if found == 0:
            break
        depth, count = step, 0
        for k in np.argsort(new[:found, 3]):
            place = math.floor(new[k, 0] / 0.2) * 73 + math.floor(new[k, 1] / 0.2) * 1009
            place += math.floor(new[k, 2] / 0.1) * 9176 + new_units[k] // 2 * 15485863
            slot = place % SLOTS
            if taken[slot] == step:
                continue
            taken[slot] = step
            x[step, count], y[step, count], h[step, count], cost[step, count] = new[k, 0], new[k, 1], new[k, 2], new[k, 3]
            rooms[step, count], unseen[step, count] = new[k, 4], new[k, 5]
            units[step, count], on_line[step, count], parent[step, count] = new_units[k], new_line[k], new_parent[k]
            count += 1
            if count == BEAM:
                break
    rows = np.zeros((depth, 4))
    best = 0
    for step in range(depth, 0, -1):
        rows[step - 1, 0], rows[step - 1, 1] = units[step, best] * UNIT_1PM, h[step, best]
        rows[step - 1, 2], rows[step - 1, 3] = rooms[step, best], unseen[step, best]
        best = parent[step, best]
    return rows
