import numpy as np
import pytest

from hippodrome.core.types import LocalizationEstimate, Trajectory
from hippodrome.eval.metrics.calibration import mean_nees, nees, pose_errors
from hippodrome.eval.metrics.localization import score_localization
from hippodrome.eval.metrics.trajectory import MetricError


def truth(count=20):
    """Ten metres a second along x, ten steps a second."""
    t_s = 0.1 * np.arange(count)
    return Trajectory(t_s, np.column_stack([10.0 * t_s, np.zeros(count), np.zeros(count)]))


def estimates(errors_m, localized, sigma_m=1.0):
    true = truth(len(errors_m))
    covariance = np.diag([sigma_m**2, sigma_m**2, 0.01])
    unused = (np.zeros(2), np.zeros(2), np.zeros((1, 2, 2)), np.zeros((1, 2, 2)))
    return [
        LocalizationEstimate(float(t_s), pose + np.array([0.0, error_m, 0.0]), covariance, bool(known), 0.0, -1, *unused)
        for t_s, pose, error_m, known in zip(true.t_s, true.poses, errors_m, localized, strict=True)
    ]


def score(errors_m, localized, **options):
    count = len(errors_m)
    return score_localization(estimates(errors_m, localized, **options), truth(count), np.full(count, 2e-3))


def test_a_drive_by_hand():
    found = score([100.0] * 5 + [1.0, 2.0, 3.0, 4.0, 30.0], [False] * 5 + [True, True, True, False, True])
    assert found.success
    assert found.initial_time_ms == pytest.approx(12.0)  # six steps of 2 ms
    assert found.initial_drive_s == pytest.approx(0.5)
    assert found.initial_distance_m == pytest.approx(5.0)
    assert found.initial_frames == 6
    assert found.error_mean_m == pytest.approx((1 + 2 + 3 + 30) / 4)
    assert found.error_median_m == pytest.approx(2.5)
    assert found.error_max_m == pytest.approx(30.0)
    assert found.drive_error_mean_m == pytest.approx(8.0)
    assert (found.false_fixes, found.false_fix_share) == (1, 0.25)
    assert found.localized_share == pytest.approx(0.4)


def test_false_fixes_are_counted_by_stretch():
    found = score([50, 50, 1, 50, 50, 50, 1, 50], [True, True, True, True, False, True, True, False])
    assert found.false_fixes == 3
    assert found.success
    assert found.initial_frames == 3  # the confident wrong answer before it is no initial localization


def test_never_localized_is_a_failure_without_figures():
    found = score([1.0] * 6, [False] * 6)
    assert not found.success
    figures = (found.initial_time_ms, found.initial_distance_m, found.error_mean_m, found.error_p95_m, found.mean_nees)
    assert figures == (None,) * 5
    assert (found.false_fixes, found.localized_share) == (0, 0.0)


def test_only_false_fixes_are_a_failure():
    found = score([30.0] * 6, [True] * 6)
    assert (found.success, found.false_fixes, found.false_fix_share, found.error_mean_m) == (False, 1, 1.0, None)


def test_covariance_twice_too_small_shows_as_nees_of_four():
    rng = np.random.default_rng(0)
    true = truth(4000)
    offsets = rng.normal(size=(4000, 3)) * np.array([2.0, 2.0, 0.2])
    assert mean_nees(offsets, np.tile(np.diag([1.0, 1.0, 0.01]), (4000, 1, 1))) == pytest.approx(4.0, rel=0.05)
    assert mean_nees(offsets, np.tile(np.diag([4.0, 4.0, 0.04]), (4000, 1, 1))) == pytest.approx(1.0, rel=0.05)
    assert len(true.t_s) == 4000


def test_nees_by_hand_with_correlation():
    covariance = np.array([[[2.0, 1.0], [1.0, 2.0]]])
    assert nees(np.array([[1.0, 0.0]]), covariance)[0] == pytest.approx(2.0 / 3.0)


def test_nees_refuses_a_covariance_that_is_none():
    with pytest.raises(MetricError, match="positive definite"):
        nees(np.ones((2, 2)), np.zeros((2, 2, 2)))


def test_a_declared_singular_covariance_leaves_the_score_without_nees():
    assert score([1.0] * 4, [True] * 4, sigma_m=0.0).mean_nees is None
    assert score([3.0] * 4, [True] * 4).mean_nees == pytest.approx(3.0)


def test_heading_error_wraps():
    assert pose_errors(np.array([[0.0, 0.0, 3.1]]), np.array([[0.0, 0.0, -3.1]]))[0, 2] == pytest.approx(6.2 - 2.0 * np.pi)


def test_step_times_must_match():
    with pytest.raises(MetricError, match="3 estimates but 2 step times"):
        score_localization(estimates([1.0] * 3, [True] * 3), truth(3), np.zeros(2))
    with pytest.raises(MetricError, match="no localization estimates"):
        score_localization([], truth(3), np.zeros(0))
