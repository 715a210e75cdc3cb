"""The peak of a parabola through three samples: by hand, for every kind of input, and the two formulas against each other."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from hippodrome.core.views.peaks import peak_in_row, peak_of_drops, peak_of_values, peak_shift

DISTANCES, DROPS = st.floats(0.5, 20.0), st.floats(-1.0, 1.0)


@given(st.floats(-2.0, 2.0), st.floats(0.01, 3.0), st.floats(-10.0, -4.1), st.floats(4.1, 10.0))
def test_the_parabola_finds_the_peak_of_a_quadratic_on_an_uneven_grid(peak, curvature, before, after):
    def value(x):
        return 1.0 - curvature * (x - peak) ** 2

    assert peak_of_values(before, value(before), value(0.0), after, value(after)) == pytest.approx(peak, abs=1e-6)


def test_the_parabola_stays_with_its_sample():
    assert peak_of_values(-5.0, 0.1, 0.5, 5.0, 0.9) == 0.0  # a straight line has no peak
    assert peak_of_values(-5.0, 0.0, 0.6, 5.0, 0.9) == 2.5  # it would peak beyond half way to the next sample


def test_drops_peak_where_they_should():
    def drop(x, peak):
        return (x - peak) ** 2 - peak**2

    for peak in (-1.5, 0.0, 0.8):
        assert_allclose(peak_of_drops(4.0, 6.0, drop(-4.0, peak), drop(6.0, peak)), peak, atol=1e-12)
    assert peak_of_drops(4.0, 6.0, 0.1, -5.0) == 0.0  # no peak: the sample itself
    assert peak_of_drops(4.0, 6.0, 2.0, -1.0) == 3.0  # no farther than half way


@given(DISTANCES, DISTANCES, DROPS, DROPS)
def test_both_formulas_find_the_same_peak(back, ahead, drop_back, drop_ahead):
    assume(abs(drop_back / back + drop_ahead / ahead) > 1e-3)  # nearly straight, the peak hangs on the last bits
    by_drops = peak_of_drops(back, ahead, drop_back, drop_ahead)
    assert peak_of_values(-back, -drop_back, 0.0, ahead, -drop_ahead) == pytest.approx(by_drops, abs=1e-9)


@given(st.lists(st.floats(0.0, 1.0, width=32), min_size=3, max_size=3))
def test_a_row_peaks_as_by_the_textbook_formula_for_even_samples(values):
    before, middle, after = values
    assume(abs(before - 2.0 * middle + after) > 1e-3)
    curvature = before - 2.0 * middle + after
    expected = 0.0 if curvature >= 0.0 else min(0.5, max(-0.5, 0.5 * (before - after) / curvature))
    assert peak_in_row(np.array(values, dtype=np.float32), 1) == pytest.approx(expected, abs=1e-9)


def test_a_peak_at_the_edge_is_taken_as_it_is():
    assert peak_in_row(np.array([0.9, 0.5, 0.1], dtype=np.float32), 0) == 0.0
    assert peak_shift(np.array([0.9, 0.5, 0.1], dtype=np.float32)) == -1.0
    assert peak_shift(np.array([0.5, 0.9, 0.5], dtype=np.float32)) == 0.0
