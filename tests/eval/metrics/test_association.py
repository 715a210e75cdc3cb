import numpy as np
import pytest

from hippodrome.core.types import Trajectory
from hippodrome.eval.metrics.association import (
    CoverageError,
    TrajectoryError,
    associate,
)


def trajectory(t_s, x=None, heading=None):
    t_s = np.asarray(t_s, dtype=np.float64)
    x = 10.0 * t_s if x is None else np.asarray(x, dtype=np.float64)
    return Trajectory(t_s, np.column_stack([x, np.zeros(len(t_s)), np.zeros(len(t_s)) if heading is None else heading]))


def test_reference_is_interpolated_at_the_estimates_times():
    found = associate(trajectory([0.05, 0.1, 0.17]), trajectory(np.arange(0.0, 1.0, 0.1)))
    assert np.allclose(found.reference[:, 0], [0.5, 1.0, 1.7])
    assert found.index.tolist() == [0, 1, 2]


def test_heading_takes_the_shortest_arc():
    reference = trajectory([0.0, 0.2], heading=np.deg2rad([179.0, -179.0]))
    found = associate(trajectory([0.05]), reference).reference
    assert np.rad2deg(found[0, 2]) == pytest.approx(179.5)


def test_samples_in_a_gap_or_outside_are_unmatched_those_on_its_edges_are_matched():
    reference = trajectory([0.0, 0.2, 0.4, 1.4, 1.6])
    found = associate(trajectory([-0.1, 0.0, 0.3, 0.4, 0.9, 1.4, 1.5, 1.6, 1.7]), reference, min_coverage=0.5)
    assert found.index.tolist() == [1, 2, 3, 5, 6, 7]
    assert found.segment.tolist() == [0, 0, 0, 1, 1, 1]
    assert found.total == 9


def test_too_little_coverage_is_an_error_that_tells_how_much():
    with pytest.raises(CoverageError, match=r"2 of 4 .* \(50.0%\), the floor is 95%"):
        associate(trajectory([0.0, 0.1, 5.0, 6.0]), trajectory([0.0, 0.1, 0.2]))


def test_nothing_in_common_is_an_error_whatever_the_floor():
    with pytest.raises(CoverageError, match="0 of 2"):
        associate(trajectory([5.0, 6.0]), trajectory([0.0, 0.1]), min_coverage=0.0)


def test_a_reference_of_one_sample_matches_its_own_instant_only():
    assert associate(trajectory([1.0, 2.0]), trajectory([1.0]), min_coverage=0.5).index.tolist() == [0]


@pytest.mark.parametrize(
    ("bad", "complaint"),
    [
        (trajectory([0.0, 0.2, 0.2]), r"estimate: time 0.2 of sample 2 does not increase"),
        (trajectory([0.0, 0.1], x=[0.0, np.nan]), "estimate: sample 1 is not finite"),
        (trajectory([]), "estimate: no samples"),
        (Trajectory(np.zeros(2), np.zeros((2, 2))), "do not fit"),
    ],
)
def test_malformed_trajectories_are_named(bad, complaint):
    with pytest.raises(TrajectoryError, match=complaint):
        associate(bad, trajectory([0.0, 0.1]))
