"""Positions and projections on networks known by hand, and against shapely."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from shapely.geometry import LineString, Point

from hippodrome.core.roads import geometry
from hippodrome.core.roads.geometry import (
    chord_headings,
    entry_position_m,
    number_pieces,
    points_between_vertices,
    poses_on_segments,
    project,
    road_geometry,
)
from tests.core.synthetic import grid_network, lanes_of

GRID = grid_network(np.random.default_rng(0))
GEOMETRY = road_geometry(GRID)


def test_positions_on_a_bent_lane():
    geometry = road_geometry(lanes_of([(0, 0), (10, 0), (10, 5)]))
    poses = poses_on_segments(geometry, np.zeros(5, dtype=int), np.array([-1.0, 4.0, 12.0, 15.0, 99.0]))
    half_pi = np.pi / 2
    assert_allclose(poses, [(0, 0, 0), (4, 0, 0), (10, 2, half_pi), (10, 5, half_pi), (10, 5, half_pi)], atol=1e-12)
    assert geometry.lane_length_m == pytest.approx([15.0])


def test_points_between_the_vertices_of_two_lanes():
    network = lanes_of([(0, 0), (10, 0), (10, 5)], [(50, 7), (50, 9)])
    points = points_between_vertices(network, np.array([0, 0, 0, 1, 1]), np.array([0.0, 4.0, 12.0, 0.5, 2.0]))
    assert_allclose(points, [(0, 0), (4, 0), (10, 2), (50, 7.5), (50, 9)], atol=1e-12)


def test_both_ways_to_a_point_agree_up_to_rounding():
    lane = np.repeat(np.arange(GRID.lane_count), 7)
    position = np.tile(np.linspace(0.0, 1.0, 7), GRID.lane_count) * GRID.lane_lengths_m()[lane]
    assert_allclose(poses_on_segments(GEOMETRY, lane, position)[:, :2], points_between_vertices(GRID, lane, position), atol=1e-8)
    assert_allclose(GEOMETRY.lane_length_m, GRID.lane_lengths_m(), atol=1e-8)


def test_a_chord_cuts_the_corner_and_ends_with_the_lane():
    """Around the corner from (10, 0) the chord of 2 m either way runs from (8, 0) to (10, 2); at the ends it is one-sided."""
    network = lanes_of([(0, 0), (10, 0), (10, 5)], [(50, 7), (50, 9)])
    headings = chord_headings(network, np.array([0, 0, 0]), np.array([0.0, 10.0, 15.0]), 2.0)
    assert headings == pytest.approx([0.0, 0.25 * np.pi, 0.5 * np.pi])


def test_headings_do_not_depend_on_how_many_are_taken_together(monkeypatch):
    lane = np.repeat(np.arange(GRID.lane_count), 7)
    position = np.tile(np.linspace(0.0, 1.0, 7), GRID.lane_count) * GRID.lane_lengths_m()[lane]
    whole = chord_headings(GRID, lane, position, 2.0)
    monkeypatch.setattr(geometry, "_AT_ONCE", 5)
    assert np.array_equal(chord_headings(GRID, lane, position, 2.0), whole)


def test_positions_scale_with_the_length_of_the_lane_that_is_entered():
    assert entry_position_m(30.0, 60.0, 50.0) == pytest.approx(25.0)
    assert entry_position_m(60.0, 60.0, 50.0) == pytest.approx(50.0)  # from end to end
    assert entry_position_m(0.0, 0.0, 50.0) == 0.0  # a lane that is a point


def test_pieces_are_numbered_within_their_owner():
    owner, number = number_pieces(np.array([2, 1, 0, 3], np.int32))
    assert owner.tolist() == [0, 0, 1, 3, 3, 3]
    assert number.tolist() == [0, 1, 0, 0, 1, 2]


def test_projection_on_two_lanes_nearest_first():
    geometry = road_geometry(lanes_of([(0, 0), (100, 0)], [(100, 8), (0, 8)]))
    found = project(geometry, np.array([[30.0, 3.0], [30.0, 500.0], [-4.0, 0.0]]), 6.0)
    assert found.start.tolist() == [0, 2, 2, 3]
    assert found.lane.tolist() == [0, 1, 0]
    assert found.position_m == pytest.approx([30.0, 70.0, 0.0])
    assert found.distance_m == pytest.approx([3.0, 5.0, 4.0])
    assert found.heading_rad == pytest.approx([0.0, np.pi, 0.0])
    assert_allclose(found.foot_m, [(30, 0), (30, 8), (0, 0)], atol=1e-12)


def test_a_very_short_lane_and_coincident_points_are_harmless():
    geometry = road_geometry(lanes_of([(0, 0), (0.01, 0)], [(0.01, 0), (0.01, 0), (0.01, 9)]))
    found = project(geometry, np.array([[1.0, 4.0]]), 5.0)
    assert found.lane.tolist() == [1, 0]
    assert found.position_m == pytest.approx([4.0, 0.01])
    assert found.heading_rad == pytest.approx([np.pi / 2, 0.0])
    pose = poses_on_segments(geometry, np.array([1, 0]), np.array([0.0, 0.005]))
    assert pose[1] == pytest.approx([0.005, 0.0, 0.0])
    assert np.isfinite(pose).all()


@settings(max_examples=40, deadline=None)
@given(x=st.floats(-50, 650), y=st.floats(-50, 530), radius=st.floats(1.0, 120.0))
def test_projection_equals_shapely(x, y, radius):
    found = project(GEOMETRY, np.array([[x, y]]), radius)
    lines = [LineString(GRID.lane_points_m(lane)) for lane in range(GRID.lane_count)]
    expected = {lane: line.distance(Point(x, y)) for lane, line in enumerate(lines) if line.distance(Point(x, y)) <= radius}
    assert dict(zip(found.lane.tolist(), found.distance_m, strict=True)) == pytest.approx(expected, abs=1e-9)
    assert np.all(np.diff(found.distance_m) >= 0.0)


@settings(max_examples=40, deadline=None)
@given(lane=st.integers(0, GRID.lane_count - 1), share=st.floats(0.0, 1.0))
def test_a_point_on_a_lane_is_found_there(lane, share):
    position = share * GEOMETRY.lane_length_m[lane]
    pose = poses_on_segments(GEOMETRY, np.array([lane]), np.array([position]))
    expected = LineString(GRID.lane_points_m(lane)).interpolate(position)
    assert_allclose(pose[0, :2], [expected.x, expected.y], atol=1e-9)
    found = project(GEOMETRY, pose[:, :2], 1.0)
    row = found.lane.tolist().index(lane)
    assert found.distance_m[row] == pytest.approx(0.0, abs=1e-9)
    assert_allclose(found.foot_m[row], pose[0, :2], atol=1e-9)
