"""The pose cells as published: one normalised packet, moved by the commanded displacement, captured by a familiar view."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from hippodrome.eval.rivals.ratslam.pose_cells import (
    PoseCellConfig,
    attract,
    code_distance,
    gaussian,
    inject,
    path_integrate,
    read_out,
    start,
)

CONFIG = PoseCellConfig()
SIZE = np.array([30.0, 30.0, 36.0])


def settled(steps=20):
    cells = start(CONFIG)
    for _ in range(steps):
        cells = attract(cells, CONFIG)
    return cells


def travelled(cells, distance, turn_rad, steps):
    for _ in range(steps):
        cells = path_integrate(attract(cells, CONFIG), distance / steps, turn_rad / steps)
    return cells


def apart(a, b):
    """Signed way from b to a, short way round."""
    return np.mod(a - b + SIZE / 2, SIZE) - SIZE / 2


def test_the_weights_sum_to_one_and_fall_off_as_a_gaussian():
    weights = gaussian(7, 1.0)
    assert_allclose(weights.sum(), 1.0)
    assert_allclose(weights[4] / weights[3], np.exp(-0.5))


def test_one_step_by_hand():
    """A single active cell: its share of the excitation, less the inhibition that the excited cells spread."""
    small = PoseCellConfig(cells_xy=9, cells_heading=9, excitation_width=1, inhibition_width=3, inhibition_sigma=1.0)
    cells = attract(start(small), small)  # width 1: excitation copies; inhibition takes w0^3 of the cell itself
    assert_allclose(cells[0, 4, 4], 1.0)
    assert np.count_nonzero(cells) == 1


def test_the_packet_stays_single_compact_and_normalised():
    cells = settled(200)
    assert_allclose(cells.sum(), 1.0)
    code = read_out(cells, CONFIG)
    assert_allclose(apart(code, np.array([15.0, 15.0, 0.0])), 0.0, atol=1e-9)
    h, y, x = np.nonzero(cells)
    far = code_distance(np.column_stack([x, y, h]).astype(float), code, CONFIG)
    assert far.max() < 8.0


def test_path_integration_alone_moves_a_single_heading_exactly():
    moved = path_integrate(start(CONFIG), 2.25, 0.0)  # heading cell 0: along x
    assert_allclose(moved[0, 15, 17], 0.75)
    assert_allclose(moved[0, 15, 18], 0.25)
    assert_allclose(moved.sum(), 1.0)


@settings(max_examples=10, deadline=None)
@given(turn_deg=st.floats(-170, 170), ticks=st.integers(1, 60), speed=st.floats(0.1, 0.8))
def test_the_packet_goes_where_it_is_sent(turn_deg, ticks, speed):
    """A turn on the spot, then straight ahead, round the torus if need be. Off the lattice it bends and lags (measured)."""
    distance = ticks * speed
    cells = settled()
    at = read_out(cells, CONFIG)
    cells = travelled(cells, 0.0, np.deg2rad(turn_deg), 20)
    turned = apart(read_out(cells, CONFIG), at)
    assert_allclose(turned[2] * 10.0, turn_deg, atol=4.0)  # of 10 deg a cell
    here = read_out(cells, CONFIG)
    cells = travelled(cells, distance, 0.0, ticks)
    way = distance * np.array([np.cos(np.deg2rad(here[2] * 10)), np.sin(np.deg2rad(here[2] * 10)), 0.0])
    moved = apart(read_out(cells, CONFIG), here)
    assert np.linalg.norm(apart(moved, way)[:2]) <= 0.5 + 0.2 * distance
    assert_allclose(cells.sum(), 1.0)


@pytest.mark.parametrize("quarter", [0, 1, 2, 3])
def test_along_the_lattice_the_packet_moves_by_the_commanded_displacement(quarter):
    cells = settled()
    for _ in range(9 * quarter):  # one heading cell a tick
        cells = path_integrate(attract(cells, CONFIG), 0.0, 2 * np.pi / 36)
    here = read_out(cells, CONFIG)
    moved = apart(read_out(travelled(cells, 10.0, 0.0, 25), CONFIG), here)
    way = 10.0 * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]][quarter])
    assert_allclose(apart(here, np.array([0.0, 0.0, 9.0 * quarter]))[2], 0.0, atol=1e-6)
    assert_allclose(moved[:2], way, atol=0.5)


def test_backwards_undoes_forwards():
    cells = settled()
    there = travelled(cells, 5.0, 0.0, 20)
    back = travelled(there, -5.0, 0.0, 20)
    assert_allclose(apart(read_out(back, CONFIG), read_out(cells, CONFIG)), 0.0, atol=0.1)


def test_repeated_injection_captures_the_packet_and_a_single_one_does_not():
    elsewhere = np.array([4.0, 25.0, 18.0])
    once = attract(inject(settled(), elsewhere, 0.09), CONFIG)
    for _ in range(20):
        once = attract(once, CONFIG)
    assert code_distance(read_out(once, CONFIG)[None], np.array([15.0, 15.0, 0.0]), CONFIG)[0] < 0.1
    cells = settled()
    for _ in range(60):
        cells = attract(inject(cells, elsewhere, 0.09), CONFIG)
    for _ in range(40):
        cells = attract(cells, CONFIG)
    assert code_distance(read_out(cells, CONFIG)[None], elsewhere, CONFIG)[0] < 0.1
    h, y, x = np.nonzero(cells)
    assert code_distance(np.column_stack([x, y, h]).astype(float), elsewhere, CONFIG).max() < 8.0


def test_distances_take_the_short_way_round():
    codes = np.array([[29.0, 0.0, 35.0], [0.0, 0.0, 0.0]])
    assert_allclose(code_distance(codes, np.array([1.0, 0.0, 0.0]), CONFIG), [np.sqrt(5.0), 1.0])


@pytest.mark.parametrize("heading", [0.0, 9.0, 20.5])
def test_read_out_averages_across_the_seam(heading):
    cells = inject(np.zeros((36, 30, 30)), np.array([29.0, 0.0, np.floor(heading)]), 1.0)
    cells = inject(cells, np.array([0.0, 0.0, np.floor(heading)]), 1.0)
    assert_allclose(read_out(cells, CONFIG)[:2], [29.5, 0.0])
