"""The borders of the road in the map of the ground about the car, and the line that keeps its distance from the own one."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numba import njit

from hippodrome.core.navigation.sweep import distance_at
from hippodrome.core.types import FloatArray, UInt8Array

CELL_M = 0.2
UNKNOWN, ROAD, OTHER, PAINT = 0, 1, 2, 3
STEP_M = 0.25  # of the way along the border
REACH_M = 3.4  # how far aside the border is looked for
AHEAD_M = 0.5  # ahead of the rear axle, where the line of equal distance from the border is followed
SLOPE_M = 0.3  # over which the direction of the border is taken
SPECK = np.ones((3, 3), dtype=np.uint8)  # fewer cells than that are no border, but the rim of a painted line
BESIDE = np.ones((5, 5), dtype=np.uint8)  # an edge line lies within two cells of what is no road
LINE_INSIDE_M = 0.2  # of the kerb an edge line is painted, at least: .25 m in lanes of 3.2 m, less half a line of .12 m
LONGEST_DASH_M = 3.7  # a dash has 3 m
GAP_CELLS = 13.0  # a border goes on where it was hidden, over twice so many cells: round a corner the car looks past it
STRIPES = np.ones((7, 7), dtype=np.uint8)  # far ahead the rows of a frame lie so many cells apart
ISLAND_M = 1.5  # what is no road and no longer than that, joined to nothing, is no border: dirt, or the end of a dash seen askew
UNSEEN_1PM = 0.06  # without any border, one turns gently to the own side
LANE_M = 3.2  # from the border of the other side the own lane is a lane more away than from the own one
MOST_TURN_RAD = 1.9
RECEDES_RAD, STRAIGHT_ON_M = 0.25, 0.2  # a border that leads away by so much is a side street's, for who goes straight on
DECAY_M = 1.6  # distance over which an offset from the way fades
TIGHTEST_1PM = 0.6  # of the line, which no car could drive round a sharp corner
BEND_PER_STEP = 0.25


def borders(part: UInt8Array) -> UInt8Array:
    """1 where cells (n, m) are what the car must not drive on: what is no road, and the painted lines at its edges.

    A line is an edge's if it is thin and longer than any dash, or lies beside what is no road. Stop lines are thick. Ground that
    was not seen is taken for what is nearest of all that was: behind a kerb there is no road, and round a corner, where one
    sees past the kerb's end, the border is expected half-way between the kerb and the last line of sight.
    """
    part = without_islands(part)
    other = cv2.morphologyEx((part == OTHER).astype(np.uint8), cv2.MORPH_OPEN, SPECK)
    paint = (part == PAINT).astype(np.uint8)
    thick = cv2.dilate(cv2.morphologyEx(paint, cv2.MORPH_OPEN, SPECK), SPECK)
    thin = paint * (1 - thick)
    edge = thin * cv2.dilate(other, BESIDE)
    count, label, stats, _ = cv2.connectedComponentsWithStats(thin, connectivity=8)
    if count > 1:
        extent = np.hypot(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]) * CELL_M
        long = extent > LONGEST_DASH_M
        long[0] = False
        edge = np.maximum(edge, long[label].astype(np.uint8))
    found = cv2.morphologyEx(other | edge, cv2.MORPH_CLOSE, STRIPES)
    seen = seen_ground(part)
    to_found = cv2.distanceTransform(1 - found, cv2.DIST_L2, 5)
    near = (to_found <= GAP_CELLS).astype(np.uint8)
    closed = (cv2.distanceTransform(near, cv2.DIST_L2, 5) > GAP_CELLS) & (seen == 0)
    rims = cv2.dilate(paint * (1 - found), BESIDE)  # of dashes and stop lines, which are brighter than road
    free, barred = (part == ROAD) & (found == 0), ((part == OTHER) & (rims == 0)) | (found > 0)
    to_free, to_barred = (cv2.distanceTransform(1 - kind.astype(np.uint8), cv2.DIST_L2, 5) for kind in (free, barred))
    behind = (seen == 0) & (to_barred < to_free)
    return np.asarray(found | closed.astype(np.uint8) | behind.astype(np.uint8), dtype=np.uint8)


def without_islands(part: UInt8Array) -> UInt8Array:
    """Cells (n, m) with road where there were only specks of what is no road.

    The end of a dash that is seen askew has the level of a kerbstone, and lies in the middle of the road: in a sharp bend, or at
    a junction, where a line along the borders would lead round it on the side of the oncoming lane.
    """
    other = (part == OTHER).astype(np.uint8)
    _, label, stats, _ = cv2.connectedComponentsWithStats(cv2.morphologyEx(other, cv2.MORPH_CLOSE, STRIPES), connectivity=8)
    island = np.hypot(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]) * CELL_M < ISLAND_M
    island[0] = False
    if not island.any():
        return part
    return np.where(island[label] & (part == OTHER), np.uint8(ROAD), part)


def room_fields(part: UInt8Array) -> tuple[FloatArray, FloatArray]:
    """Of cells (n, m), the distance to the nearest border, and the room that the car has there.

    A line at the edge is painted beside the kerb, so that the car has more room than up to the line.
    """
    found = borders(part)
    line_m, kerb_m = (
        CELL_M * cv2.distanceTransform((free > 0).astype(np.uint8), cv2.DIST_L2, 5).astype(np.float64)
        for free in (found == 0, (found == 0) | (part == PAINT))
    )
    return line_m, np.minimum(kerb_m, line_m + LINE_INSIDE_M)


def seen_ground(part: UInt8Array) -> UInt8Array:
    """1 where cells (n, m) have been seen, or lie between the rows of pixels of a frame."""
    return np.asarray(cv2.morphologyEx((part != UNKNOWN).astype(np.uint8), cv2.MORPH_CLOSE, STRIPES), dtype=np.uint8)


@njit(cache=True)
def along_border(
    field: FloatArray,
    corner: FloatArray,
    pose: FloatArray,
    bend: float,
    side: float,
    beside_m: float,
    straight_on: bool,
    count: int,
) -> FloatArray:
    """The line of equal distance from the border: rows (count, 4) of place, heading, and whether the border was seen.

    A law of steering (Samson) acts on it: round a sharp corner it is an arc, and where the road bends away the border comes
    nearer ahead.
    """
    rows = np.zeros((count, 4))
    x, y, heading = pose[0], pose[1], pose[2]
    for k in range(count):
        cos, sin = math.cos(heading), math.sin(heading)
        px, py = x + AHEAD_M * cos, y + AHEAD_M * sin
        d = distance_at(field, corner, CELL_M, px, py)
        gx = distance_at(field, corner, CELL_M, px + SLOPE_M, py) - distance_at(field, corner, CELL_M, px - SLOPE_M, py)
        gy = distance_at(field, corner, CELL_M, px, py + SLOPE_M) - distance_at(field, corner, CELL_M, px, py - SLOPE_M)
        seen = d < beside_m + LANE_M and gx * gx + gy * gy > 1e-6
        wanted = 0.0 if straight_on else side * UNSEEN_1PM
        if seen:
            along = math.atan2(gy, gx) + side * 0.5 * math.pi  # the border's direction, with the border on the own side
            turn = (heading - along + math.pi) % (2.0 * math.pi) - math.pi
            seen = d < REACH_M or abs(turn) >= MOST_TURN_RAD
        if seen:
            off = side * (beside_m - min(d, beside_m + 1.0))  # of the vehicle to the left of its line
            if abs(turn) >= MOST_TURN_RAD:  # that of the other side: the lane beside it is for who comes towards the vehicle
                off, turn = side * (d - beside_m - LANE_M), turn % (2.0 * math.pi) - math.pi
                wanted = -off / DECAY_M**2 - 2.0 * turn / DECAY_M
            elif straight_on and side * turn < -RECEDES_RAD and d > beside_m - STRAIGHT_ON_M:
                wanted = 0.0  # the border leads into a side street
            else:
                wanted = -off / DECAY_M**2 - 2.0 * turn / DECAY_M
        wanted = min(max(wanted, -TIGHTEST_1PM), TIGHTEST_1PM)
        bend += min(max(wanted - bend, -BEND_PER_STEP), BEND_PER_STEP)
        rows[k, 0], rows[k, 1], rows[k, 2] = x, y, heading
        rows[k, 3] = 1.0 if seen else 0.0
        x, y = x + STEP_M * cos, y + STEP_M * sin
        heading += STEP_M * bend
    return rows
