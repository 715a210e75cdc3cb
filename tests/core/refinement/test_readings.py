"""What the camera read of the road, as factors: it puts a map in its place, and a wrong reading does not."""

from dataclasses import replace

import numpy as np
import pytest

from hippodrome.core.matching.route_line import RouteLine
from hippodrome.core.reading.types import STOP_LINE_BEFORE_END_M, LaneEnd
from hippodrome.core.refinement.factors import State
from hippodrome.core.refinement.readings import ReadTargets, reading_factors
from hippodrome.core.refinement.residuals import stepped
from hippodrome.core.refinement.route import RouteRefineConfig, refine_route
from hippodrome.core.refinement.solver import SolverConfig, refine_along_route
from hippodrome.core.roads.geometry import project, road_geometry
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.se2 import wrap
from hippodrome.core.types import Edges, LaneReadings, Visits
from tests.core.synthetic import grid_network, semi_metric_drive

LANE_M, STEP_M = 200.0, 5.0


def unread(count):
    """Readings of ``count`` frames that saw nothing."""
    nothing, open_ = np.full(count, np.nan, np.float32), np.full(count, np.inf, np.float32)
    return LaneReadings(nothing, open_, nothing, open_, nothing, nothing, nothing, open_, np.zeros(count, np.uint8))


def with_rows(readings, rows, **values):
    """The readings with other values in some rows."""
    changed = {name: getattr(readings, name).copy() for name in values}
    for name, value in values.items():
        changed[name][rows] = value
    return replace(readings, **changed)


def one_lane():
    return RoadNetwork(
        lane_ids=("lane",),
        edge_ids=("edge",),
        lane_edge=np.zeros(1, np.int32),
        is_internal=np.zeros(1, np.bool_),
        width_m=np.full(1, 3.2),
        speed_limit_mps=np.full(1, 8.0),
        points_m=np.array([[0.0, 0.0], [LANE_M, 0.0]]),
        point_start=np.array([0, 2], np.int32),
        successor=np.zeros(0, np.int32),
        successor_start=np.zeros(2, np.int32),
        left_lane=np.full(1, -1, np.int32),
        right_lane=np.full(1, -1, np.int32),
    )


def straight(readings, guessed_m, network=None):
    """Keyframes on a straight lane, first guessed to be at arc lengths that are wrong: where they come to lie, (S, 3)."""
    count = len(guessed_m)
    arc = np.arange(0.25, LANE_M, 0.5)
    zeros = np.zeros_like(arc)
    line = RouteLine(arc, np.column_stack([arc, zeros]), zeros, np.zeros(len(arc), np.int32), arc)
    motion = np.concatenate([np.zeros((1, 3)), np.tile([STEP_M, 0.0, 0.0], (count - 1, 1))])
    visits = Visits(0.6 * np.arange(count), np.arange(count, dtype=np.int32), motion, readings)
    none = np.zeros(0, np.int32)
    closures = Edges(none, none, np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.uint8), np.zeros(0, np.float32))
    free = np.zeros(len(arc), np.bool_)
    return refine_along_route(
        visits, closures, line, guessed_m, np.zeros(count), np.ones(count), free, SolverConfig(), network
    ).state.poses


TRUE_M = 90.0 + STEP_M * np.arange(20)  # the last one stands 15 m before the end of the lane


@pytest.mark.parametrize("end", [LaneEnd.STOP_LINE, LaneEnd.MOUTH])
def test_the_end_of_a_lane_puts_a_straight_into_place(end):
    seen_m = LANE_M - TRUE_M[-2:] - (STOP_LINE_BEFORE_END_M if end is LaneEnd.STOP_LINE else 0.0)
    read = with_rows(unread(20), slice(-2, None), end_m=seen_m, end_variance_m2=0.05**2, end=int(end))
    guessed = TRUE_M - 2.0
    assert abs(straight(read, guessed)[-1, 0] - TRUE_M[-1]) > 1.5  # nothing but the guess
    assert straight(read, guessed, one_lane())[-1, 0] == pytest.approx(TRUE_M[-1], abs=0.1)


def test_the_end_of_another_lane_is_not_believed():
    seen_m = LANE_M - TRUE_M[-4:] - STOP_LINE_BEFORE_END_M
    read = with_rows(unread(20), slice(-4, None), end_m=seen_m, end_variance_m2=0.05**2, end=int(LaneEnd.STOP_LINE))
    wrong = with_rows(read, -2, end_m=seen_m[-2] + 7.0)
    guessed = TRUE_M - 1.0
    np.testing.assert_allclose(straight(wrong, guessed, one_lane()), straight(read, guessed, one_lane()), atol=0.06)


def test_the_place_in_the_lane_is_where_the_vehicle_is_and_not_in_the_middle():
    read = with_rows(unread(20), slice(None), offset_m=0.4, offset_variance_m2=0.03**2)
    for row in (3, 11):
        read = with_rows(read, row, offset_m=-1.2)  # two that are wrong
    poses = straight(read, TRUE_M, one_lane())
    np.testing.assert_allclose(poses[:, 1], 0.4, atol=0.05)


def test_jacobians_agree_with_differences():
    rng = np.random.default_rng(0)
    state = State(rng.normal(0.0, 0.1, (4, 3)), np.zeros(4), np.zeros(3), rng.normal(0.0, 0.1, (4, 2)))
    wide = np.full(4, 1e3)  # sigmas so wide that the robust weights do not change
    read = ReadTargets(rng.normal(size=4), wide, 0.1 * rng.normal(size=4), wide, rng.normal(size=4), wide)
    points, heading = rng.normal(0.0, 0.1, (4, 2)), rng.normal(0.0, 0.1, 4)
    found = reading_factors(state, points, heading, read)
    for axis in range(6):
        step = np.zeros((4, 6))
        step[:, axis] = 1e-5
        high, low = (
            reading_factors(stepped(state, sign * step, np.zeros(3)), points, heading, read).residual for sign in (1.0, -1.0)
        )
        np.testing.assert_allclose(found.jacobian[:, :, axis], (high - low) / 2e-5, atol=1e-9)


@pytest.fixture(scope="module")
def driven():
    """A drive in a town of streets, and what a reader would say at its keyframes, with errors."""
    network = grid_network(np.random.default_rng(1), columns=4, rows=3)
    drive = semi_metric_drive(network, np.random.default_rng(1), length_m=2000.0, relaxed=False, closures=60)
    poses, rng = drive.true_poses, np.random.default_rng(2)
    near = project(road_geometry(network), poses[:, :2], 12.0)
    own = {int(p): row for row, p in enumerate(near.point) if near.lane[row] == drive.true_lane[p]}
    rows = np.array([own.get(i, -1) for i in range(len(poses))])
    seen = (rows >= 0) & ~network.is_internal[np.maximum(drive.true_lane, 0)]
    away, heading = poses[:, :2] - near.foot_m[rows], near.heading_rad[rows]
    offset = np.cos(heading) * away[:, 1] - np.sin(heading) * away[:, 0] + 0.03 * rng.standard_normal(len(poses))
    turned = wrap(poses[:, 2] - heading) + 0.01 * rng.standard_normal(len(poses))
    read = with_rows(unread(len(poses)), seen, offset_m=offset[seen], offset_variance_m2=0.03**2)
    return network, drive, with_rows(read, seen, heading_rad=turned[seen], heading_variance_rad2=0.01**2), seen


def refined(driven, readings, **config):
    network, drive, *_ = driven
    there = replace(drive.cognitive_map, visits=replace(drive.cognitive_map.visits, lane=readings))
    return refine_route(there, network, RouteRefineConfig(**config))


def errors_m(driven, refinement):
    off = refinement.cognitive_map.poses[:, :2] - driven[1].true_poses[:, :2]
    return np.hypot(*off.T)


def test_a_town_that_was_read_lies_better_and_wrong_readings_do_not_bend_it(driven):
    *_, read, seen = driven
    plain, better = (errors_m(driven, refined(driven, readings)).mean() for readings in (None, read))
    assert better < 0.9 * plain
    wrong = np.flatnonzero(seen)[::12]
    misread = with_rows(read, wrong, offset_m=read.offset_m[wrong] + 0.9)
    assert errors_m(driven, refined(driven, misread)).mean() < 1.1 * better


def test_readings_that_are_not_wanted_move_no_byte(driven):
    *_, read, _ = driven
    without, ignored = refined(driven, None), refined(driven, read, road_reading=False)
    for name in ("poses", "log_scale", "covariance"):
        assert getattr(without.cognitive_map, name).tobytes() == getattr(ignored.cognitive_map, name).tobytes()
    assert without.estimates == ignored.estimates
    assert "slip_m" not in without.estimates
    assert "slip_m" in refined(driven, read).estimates
