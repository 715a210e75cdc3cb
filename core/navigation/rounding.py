"""The line round a corner that is sharper than the turning circle: a little wide before, close by the inner edge, and back.

The line along the border turns as the border does. A car that follows it as well as it can begins to turn too late and comes out
on the oncoming lane, since how early it has to begin is told by where it has to come out. So the corner of the line is replaced
by a bend that the car can drive, from the line before it to the line after it: the curvature rises, holds and falls. Of those
bends the one is taken on which the car comes least near to the border, and least far to the side of the oncoming lane.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from hippodrome.core.navigation.sweep import room_m
from hippodrome.core.types import FloatArray

STEP_M = 0.25  # between the samples of a line
WINDOW = 4  # samples over which it is sharp, if it turns by ..
SHARP_RAD = 0.3  # .. so much: a little less than full lock does
TURNS_RAD = (0.6, 2.4)  # of a corner; sharper ones are no corners, but the end of the border
CURVATURES_1PM = np.array([0.2, 0.24, 0.28, 0.32])  # that are tried; the sweep turns no sharper
RATE_1PM2 = 0.26  # by which the curvature rises, and falls, in a metre: the wheels at walking pace
BEFORE_M = np.array([-0.1, 0.1, 0.3, 0.5, 0.6])  # beside the line before the bend, on the side of the oncoming lane
AFTER_M = np.array([-0.4, -0.25, -0.1, 0.1, 0.3])  # and after it ..
INSIDE_M = 0.25  # .. best so much to the inside: where the street leads is seen late, and outside of it others come
SWING = 0.2  # metres aside in a metre ahead, at most, before the bend
LATE_M = 0.6  # who comes out this much beside the line after it begins the bend at once
BACK_M = 6.0  # in which one comes back to that line
KEPT_M = 1.0  # of room, where there can be as much
SHORT_COST, BEFORE_COST, AFTER_COST = 40.0, 0.1, 1.0
MOST_ROWS, FINE = 60, 5  # of a bend, and parts of a step in its integration
STRAIGHT_RAD = 0.2  # a line that turns by more before the bend is not followed beside itself


@njit(cache=True)
def _corner(line: FloatArray, side: float) -> tuple[int, int]:
    """The first and the last sample of the line's first sharp corner to the own side; two equal ones where there is none."""
    first, last = 0, 0
    for k in range(len(line) - WINDOW):
        turn = side * ((line[k + WINDOW, 2] - line[k, 2] + math.pi) % (2.0 * math.pi) - math.pi)
        if turn > SHARP_RAD:
            if last == 0:
                first = k
            elif k > last:
                break
            last = k + WINDOW
    return first, last


@njit(cache=True)
def _bend(pose: FloatArray, now: float, curvature: float, turn: float, side: float) -> FloatArray:
    """Poses (n, 3) of a bend to the own side from a pose, where the curvature is ``now``: it rises, holds, and falls again."""
    x, y, heading, bend, turned = pose[0], pose[1], pose[2], now, 0.0
    poses = np.zeros((MOST_ROWS, 3))
    poses[0] = pose
    count = 1
    fine_m = STEP_M / FINE
    while count < MOST_ROWS:
        for _ in range(FINE):
            falls = bend > 0.0 and turned + 0.5 * bend * bend / RATE_1PM2 >= turn
            bend = max(bend - RATE_1PM2 * fine_m, 0.0) if falls else min(bend + RATE_1PM2 * fine_m, curvature)
            step = side * bend * fine_m
            x, y = x + fine_m * math.cos(heading + 0.5 * step), y + fine_m * math.sin(heading + 0.5 * step)
            heading, turned = heading + step, turned + bend * fine_m
        poses[count, 0], poses[count, 1], poses[count, 2] = x, y, heading
        count += 1
        if turned > 0.5 * turn and bend == 0.0:
            break
    return poses[:count]


@njit(cache=True)
def _short_m3(poses: FloatArray, room: FloatArray, corner: FloatArray, cell_m: float) -> float:
    """By how much the room along poses is less than it should be, squared and summed over the way."""
    total = 0.0
    for k in range(len(poses)):
        short = max(KEPT_M - room_m(room, corner, cell_m, poses[k, 0], poses[k, 1], poses[k, 2]), 0.0)
        total += short**2 * STEP_M
    return total


@njit(cache=True)
def rounded(line: FloatArray, now: float, side: float, room: FloatArray, corner: FloatArray, cell_m: float) -> FloatArray:
    """The line (n, 3) with its first sharp corner to the own side as the car can drive it; as it is where it has none.

    Args:
        line: places and headings, ``STEP_M`` apart, from where the car is.
        now: curvature at which the wheels stand.
        side: of the border: -1 right, 1 left.
        room: the distance to the nearest border; its cells lie from ``corner`` on, ``cell_m`` wide.
        corner: of those cells.
        cell_m: their width.
    """
    first, last = _corner(line, side)
    if last == 0 or not TURNS_RAD[0] < side * (line[last, 2] - line[first, 2]) < TURNS_RAD[1]:
        return line
    begin, end = line[first], line[last]
    cos, sin = math.cos(begin[2]), math.sin(begin[2])
    out_x, out_y = side * math.sin(end[2]), -side * math.cos(end[2])  # away from the border, after the corner
    along = cos * out_x + sin * out_y
    straight = True
    for k in range(first):
        straight = straight and abs(line[k, 2] - begin[2]) < STRAIGHT_RAD
    beside = side * ((line[0, 0] - begin[0]) * sin - (line[0, 1] - begin[1]) * cos)
    best, cost, start_m, best_before = line[:0], 1e9, 0.0, 0.0
    for curvature in CURVATURES_1PM:
        at_once = _bend(line[0], side * now, curvature, side * (end[2] - line[0, 2]), side)
        off = (at_once[-1, 0] - end[0]) * out_x + (at_once[-1, 1] - end[1]) * out_y
        if off > -LATE_M:
            price = AFTER_COST * (off + INSIDE_M) ** 2 + SHORT_COST * _short_m3(at_once, room, corner, cell_m)
            if price < cost:
                best, cost, start_m = at_once, price, 0.0
        turned = _bend(begin, 0.0, curvature, side * (end[2] - begin[2]), side)
        for before in BEFORE_M:
            aside = before if straight else 0.0
            x, y = side * sin * aside, -side * cos * aside
            for after in AFTER_M:
                back_m = ((x + turned[-1, 0] - end[0]) * out_x + (y + turned[-1, 1] - end[1]) * out_y - after) / along
                price = BEFORE_COST * aside**2 + AFTER_COST * (after + INSIDE_M) ** 2
                begin_m = first * STEP_M - back_m
                swings = straight and abs(aside - beside) > SWING * begin_m
                if begin_m < 0.0 or swings or price >= cost:
                    continue
                bend = turned.copy()
                bend[:, 0] += x - back_m * cos
                bend[:, 1] += y - back_m * sin
                price += SHORT_COST * _short_m3(bend, room, corner, cell_m)
                if price < cost:
                    best, cost, start_m, best_before = bend, price, begin_m, aside
    return _joined(line, best, start_m, best_before, begin, end, last, side, straight)


@njit(cache=True)
def _joined(
    line: FloatArray, bend: FloatArray, start_m: float, before: float, begin: FloatArray, end: FloatArray, last: int,
    side: float, straight: bool,
) -> FloatArray:  # fmt: skip
    """The line up to the bend, which it comes to beside itself, the bend, and back to the line after it."""
    if len(bend) == 0:
        return line
    rows = np.zeros((len(line), 3))
    cos, sin = math.cos(begin[2]), math.sin(begin[2])
    count = 0
    ahead = (line[0, 0] - begin[0]) * cos + (line[0, 1] - begin[1]) * sin
    aside = side * ((line[0, 0] - begin[0]) * sin - (line[0, 1] - begin[1]) * cos)
    while count < len(line) and STEP_M * count < start_m:
        u = STEP_M * count / start_m
        if straight:
            off = aside + (before - aside) * u * u * (3.0 - 2.0 * u)
            rows[count, 0] = begin[0] + (ahead + STEP_M * count) * cos + side * sin * off
            rows[count, 1] = begin[1] + (ahead + STEP_M * count) * sin - side * cos * off
            rows[count, 2] = begin[2] - side * math.atan((before - aside) * 6.0 * u * (1.0 - u) / start_m)
        else:
            rows[count] = line[count, :3]
        count += 1
    for k in range(len(bend)):
        if count < len(line):
            rows[count] = bend[k]
            count += 1
    cos, sin = math.cos(end[2]), math.sin(end[2])
    off = side * ((bend[-1, 0] - end[0]) * sin - (bend[-1, 1] - end[1]) * cos)
    near_m = (bend[-1, 0] - end[0]) * cos + (bend[-1, 1] - end[1]) * sin
    k, driven_m = last + max(int(near_m / STEP_M), 0) + 1, STEP_M
    while count < len(line):
        at = min(k, len(line) - 1)
        u = min(driven_m / BACK_M, 1.0)
        beside, over_m = off * (1.0 - u * u * (3.0 - 2.0 * u)), STEP_M * (k - at)
        cos, sin = math.cos(line[at, 2]), math.sin(line[at, 2])
        rows[count, 0] = line[at, 0] + over_m * cos + side * sin * beside
        rows[count, 1] = line[at, 1] + over_m * sin - side * cos * beside
        rows[count, 2] = line[at, 2] + side * math.atan(off * 6.0 * u * (1.0 - u) / BACK_M)
        k, count, driven_m = k + 1, count + 1, driven_m + STEP_M
    return rows


@njit(cache=True)
def bends_of(line: FloatArray, room: FloatArray, corner: FloatArray, cell_m: float, need_m: float, count: int) -> FloatArray:
    """Curvature and heading (count, 2) of a line, as ``rounded`` makes them; no rows where the car has less than that room."""
    rows = np.zeros((count, 2))
    for k in range(count):
        if room_m(room, corner, cell_m, line[k, 0], line[k, 1], line[k, 2]) < need_m:
            return rows[:0]
        turn = (line[k + 1, 2] - line[k, 2] + math.pi) % (2.0 * math.pi) - math.pi
        rows[k, 0], rows[k, 1] = turn / STEP_M, line[k, 2]
    return rows
