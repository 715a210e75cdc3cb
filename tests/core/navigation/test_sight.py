"""In search: what counts as a border of the road, and the way that a car can drive along it."""

import math

import cv2
import numpy as np
import pytest

from hippodrome.core.navigation.border import (
    LANE_M,
    LINE_INSIDE_M,
    OTHER,
    PAINT,
    ROAD,
    UNKNOWN,
    along_border,
    borders,
    room_fields,
)
from hippodrome.core.navigation.rounding import bends_of, rounded
from hippodrome.core.navigation.sight import Ground
from hippodrome.core.navigation.sweep import STEP_M, STEPS, drivable
from hippodrome.core.views.config import CameraGeometry

CELL_M = 0.2
CORNER = np.zeros(2)


def cells():
    return np.full((160, 160), ROAD, dtype=np.uint8)


def field_of(barrier):
    return CELL_M * cv2.distanceTransform(1 - barrier.astype(np.uint8), cv2.DIST_L2, 5).astype(np.float64)


def driven(rows, pose):
    """Poses of the rear axle along rows of curvatures."""
    x, y, heading = pose
    poses = []
    for bend in rows[:, 0]:
        chord = heading + 0.5 * bend * STEP_M
        x, y, heading = x + STEP_M * math.cos(chord), y + STEP_M * math.sin(chord), heading + bend * STEP_M
        poses.append((x, y, heading))
    return np.array(poses)


def straight_line(y=8.0):
    return np.stack([np.arange(60) * 0.25 + 4.0, np.full(60, y), np.zeros(60)], axis=1)


def test_edge_lines_are_borders_and_dashes_and_stop_lines_are_none():
    part = cells()
    part[:, 20] = PAINT  # along the whole road
    part[10:25, 36] = PAINT  # a dash of 3 m
    part[100:104, 21:36] = PAINT  # a stop line
    part[40:50, 52] = PAINT  # a short piece beside ..
    part[:, 53:] = OTHER  # .. what is no road
    found = borders(part)
    assert found[:, 20].all() and found[40:50, 52].all() and found[:, 60].all()
    assert not found[:, 30:50].any() and not found[101, 25:35].any()


def test_specks_in_the_road_are_no_borders_and_what_bars_it_is_one():
    part = cells()
    part[:, 41:] = OTHER
    part[60:63, 20:25] = OTHER  # the end of a dash that is seen askew: .6 m by 1 m
    part[100:110, 18:24] = OTHER  # 2 m long
    found = borders(part)
    assert not found[55:70, 15:30].any() and found[102:108, 20:22].all() and found[:, 45].all()
    rows = cells()
    for k in range(60, 120, 6):  # a kerb far ahead, of which each row of a frame shows a piece
        rows[k : k + 3, 10:15] = OTHER
    assert borders(rows)[62:114, 12].all()
    line_m, room_m = room_fields(part)
    assert line_m[61, 22] > 3.0 and room_m[61, 22] > 3.0


def test_beside_a_painted_edge_there_is_more_room_than_beside_a_kerb():
    part = cells()
    part[:, 40] = PAINT
    part[:, 42:] = OTHER
    line_m, room_m = room_fields(part)
    assert room_m[80, 30] == pytest.approx(line_m[80, 30] + LINE_INSIDE_M)
    part[:, 40] = ROAD
    line_m, room_m = room_fields(part)
    assert np.array_equal(line_m, room_m)


def test_a_border_goes_on_where_it_was_hidden():
    part = cells()
    part[:, 40] = PAINT
    part[:, 41:] = OTHER
    part[66:74, 38:] = UNKNOWN
    assert borders(part)[70, 41:44].any()


def test_the_way_keeps_to_the_line():
    rows = drivable(field_of(cells() == OTHER), cells(), CORNER, CELL_M, np.array([4.0, 8.5, 0.0]), 0.0, straight_line(), 0.95)
    poses = driven(rows, (4.0, 8.5, 0.0))
    assert len(rows) == STEPS and abs(poses[-1, 1] - 8.0) < 0.15 and abs(poses[-1, 2]) < 0.1


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_round_a_corner_without_a_radius_no_wheel_leaves_the_road(side):
    barrier = np.zeros((160, 160), dtype=np.uint8)
    corner, border = 60, 80  # the road leads along x, beside a border from which on another one leads aside
    lower = slice(0, border) if side < 0.0 else slice(border, None)
    barrier[:corner, lower] = 1
    middle = border * CELL_M - side * 1.4
    before = [(x, middle, 0.0) for x in np.arange(4.0, corner * CELL_M, 0.25)]
    turns = side * np.arange(0.0, 0.5 * math.pi, 0.25 / 1.4)
    arc = [(corner * CELL_M + 1.4 * abs(math.sin(a)), middle + side * 1.4 * (1.0 - math.cos(a)), a) for a in turns]
    after = [(corner * CELL_M + 1.4, border * CELL_M + side * s, side * 0.5 * math.pi) for s in np.arange(0.0, 10.0, 0.25)]
    line, field = np.array(before + arc + after), field_of(barrier)
    pose, bend = np.array([6.0, middle, 0.0]), 0.0
    for _ in range(26):
        rows = drivable(field, cells(), CORNER, CELL_M, pose, bend, line, 0.95)
        assert len(rows) == STEPS
        bend = rows[0, 0]
        pose = driven(rows[:1], pose)[0]
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        for ahead, left in ((0.0, 0.8), (0.0, -0.8), (2.7, 0.8), (2.7, -0.8)):
            x, y = pose[0] + ahead * cos - left * sin, pose[1] + ahead * sin + left * cos
            assert not barrier[int(x / CELL_M), int(y / CELL_M)]
        near = np.argmin(np.hypot(*(line[:, :2] - pose[:2]).T))
        line = line[near:]
    assert abs(pose[2] - side * 0.5 * math.pi) < 0.35


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(("far_m", "straight_on"), [(1.6, False), (2.8, False), (3.6, False), (2.8, True)])
def test_where_only_the_border_of_the_other_side_is_seen_the_line_leads_to_the_own_lane(side, far_m, straight_on):
    barrier = np.zeros((160, 160), dtype=np.uint8)
    border = 80
    barrier[:, slice(border, None) if side < 0.0 else slice(0, border)] = 1
    pose = np.array([4.0, border * CELL_M + side * far_m, 0.0])
    rows = along_border(field_of(barrier), CORNER, pose, 0.0, side, 1.35, straight_on, 56)
    apart_m = side * (rows[:, 1] - border * CELL_M)
    assert rows[0, 3] == 1.0 and np.all(np.diff(apart_m) > -1e-6)
    assert apart_m[-1] == pytest.approx(LANE_M + 1.35, abs=0.4)


def test_before_a_wall_the_way_ends():
    barrier = np.zeros((160, 160), dtype=np.uint8)
    barrier[50:, :] = 1
    rows = drivable(field_of(barrier), cells(), CORNER, CELL_M, np.array([4.0, 8.0, 0.0]), 0.0, straight_line(), 0.95)
    assert 0 < len(rows) < STEPS


def test_the_ground_below_the_car_is_road_from_the_first_frame_on():
    ground = Ground(CameraGeometry())
    ground.see(np.full((120, 160, 3), 100, dtype=np.uint8), math.inf)
    way = ground.way(0.0, -1.0, 1.35, False, 14.0, 0.95)
    assert way.free_m == math.inf and way.seen_m > 3.0


def test_beside_the_road_what_lies_ahead_is_not_taken_for_asphalt():
    after = []
    for on_road in (True, False):
        ground = Ground(CameraGeometry())
        ground.see(np.full((120, 160, 3), 100, dtype=np.uint8), math.inf)
        for _ in range(20):
            ground.see(np.full((120, 160, 3), 130, dtype=np.uint8), math.inf, on_road)
        after.append(ground._level)
    assert after[0] > 125.0 and after[1] == 100.0


def test_behind_a_kerb_there_is_no_road_and_round_its_end_the_border_goes_on_half_way():
    part = cells()
    part[:80, :40] = UNKNOWN
    part[:80, 34:40] = OTHER  # a pavement that ends, seen from beside it ..
    i, j = np.meshgrid(np.arange(160), np.arange(40), indexing="ij")
    part[:, :40][i - 80 < 40 - j] = np.where(part[:, :40][i - 80 < 40 - j] == ROAD, UNKNOWN, part[:, :40][i - 80 < 40 - j])
    found = borders(part)  # .. with the last line of sight past its end at 45 degrees
    assert found[20:70, 5:30].all() and not found[:, 45:].any()
    assert found[66, 5] and not found[92, 20]


def sharp_corner(side, beside_m=1.35):
    """A road along x beside a border, and one that leads aside from its end: the border's cells, and the line along it."""
    barrier = np.zeros((160, 160), dtype=np.uint8)
    corner, border = 60, 80
    barrier[:corner, slice(0, border) if side < 0.0 else slice(border, None)] = 1
    middle, end = border * CELL_M - side * beside_m, corner * CELL_M
    before = [(x, middle, 0.0) for x in np.arange(end - 7.0, end, 0.25)]
    turns = np.arange(0.0, 0.5 * math.pi, 0.25 / beside_m)
    arc = [(end + beside_m * math.sin(a), middle + side * beside_m * (1.0 - math.cos(a)), side * a) for a in turns]
    after = [(end + beside_m, border * CELL_M + side * s, side * 0.5 * math.pi) for s in np.arange(0.0, 6.0, 0.25)]
    return barrier, np.array(before + arc + after)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_line_round_a_sharp_corner_is_one_that_the_car_can_drive_into_its_lane(side):
    barrier, line = sharp_corner(side)
    field = field_of(barrier)
    led = rounded(line, 0.0, side, field, CORNER, CELL_M)
    bends = bends_of(led, field, CORNER, CELL_M, 0.9, 50)
    assert len(bends) == 50 and np.abs(bends[:, 0]).max() < 0.34  # within the turning circle, and clear of the kerb
    assert led[0] == pytest.approx(line[0]) and abs(led[-1, 2] - side * 0.5 * math.pi) < 0.1
    apart_m = led[-12:, 0] - 60 * CELL_M  # from the border of the street that it leads into
    assert np.all(apart_m > 0.9) and np.all(apart_m < 1.9)


def test_who_is_late_for_a_corner_turns_at_once_and_a_line_without_one_stays_as_it_is():
    barrier, line = sharp_corner(-1.0)
    late = line[24:]  # a metre before the corner
    led = rounded(late, 0.0, -1.0, field_of(barrier), CORNER, CELL_M)
    assert led[6, 2] < -0.2 and not np.allclose(led[:, :2], late[:, :2])
    assert len(bends_of(led, np.zeros((160, 160)), CORNER, CELL_M, 0.9, 20)) == 0
    assert np.array_equal(rounded(straight_line(), 0.0, -1.0, field_of(barrier), CORNER, CELL_M), straight_line())


def test_what_lies_behind_no_road_or_beside_the_view_cannot_be_seen():
    ground = Ground(CameraGeometry())
    points = np.array([[4.5, -1.0], [4.5, -4.0], [4.5, 2.0], [2.0, 3.0], [0.5, 0.0]])
    np.testing.assert_array_equal(ground.in_view(points), [True, False, True, False, False])
    ahead_right = np.array([[4.5, -2.5]])
    assert ground.in_view(ahead_right).all()
    ground._fill(-2.3, -1.2, OTHER)  # a pavement to the right, up to 3.9 m ahead
    assert not ground.in_view(ahead_right).any() and ground.in_view(points[:1]).all()
