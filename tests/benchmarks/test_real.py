"""The benchmark of real drives, on a drive that is made here: the real ones may not be at hand."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.real import main, rpe_m, told_scale
from benchmarks.real_bounds import best_rpe_m, expected_nees, nees_after_fit, told_sigmas_m
from benchmarks.real_drives import RealDrive
from hippodrome.core.mapping.motion_mapper import MotionMapper
from hippodrome.core.refinement.config import RouteRefineConfig
from hippodrome.core.refinement.route import keyframe_closures, solve_route
from hippodrome.core.types import MatchStatus, Observation
from tests.core.synthetic import grid_network, semi_metric_drive


@pytest.fixture(scope="module")
def wandering():
    """A drive east along a straight road, whose odometry sees steps that are up to 10 % too long or too short."""
    mapper, seen = MotionMapper(), 8.0 * np.exp(0.1 * np.sin(np.arange(1200) / 60.0))
    for i in range(1200):
        mapper.step(Observation(0.1 * i + 0.1, 0.1, float(seen[i]), 0.0, None))
    made = mapper.finish()
    true = np.column_stack([8.0 * made.t_s, np.zeros((len(made.t_s), 2))])
    return RealDrive("made", "00", made, true)


def test_without_the_drives_it_says_so_and_that_is_no_fault(tmp_path, capsys):
    assert main([str(tmp_path)]) == 0
    assert "nothing is measured" in capsys.readouterr().out


def test_the_true_motion_has_no_error(wandering):
    assert rpe_m(wandering.true_poses, wandering) == 0.0
    stretched = wandering.true_poses * [1.05, 1.0, 1.0]
    assert rpe_m(stretched, wandering) == pytest.approx(0.05 * 20.0, rel=0.25)  # 20 m or a keyframe more


def test_a_told_scale_is_the_finer_the_better(wandering):
    def spread(drive):
        return np.std(np.log(drive.true_steps_m / np.hypot(drive.visits.motion[1:, 0], drive.visits.motion[1:, 1])))

    finely, coarsely = spread(told_scale(wandering, 5.0)), spread(told_scale(wandering, 160.0))
    assert finely < 1e-9 < coarsely < spread(wandering)


@pytest.fixture(scope="module")
def winding():
    """A drive of 1.2 km along a street whose direction swings by 40 degrees either way."""
    arc = 5.0 * np.arange(240)
    heading = 0.7 * np.sin(arc / 40.0)
    steps = 5.0 * np.column_stack([np.cos(heading), np.sin(heading)])
    true = np.column_stack([np.cumsum(steps, axis=0), heading])
    return RealDrive("made", "00", None, true)


def test_the_worse_the_map_the_less_a_road_tells_of_the_scale(winding):
    wrong = 0.1 * np.sin(np.arange(239) / 6.0) + 0.02 * np.random.default_rng(0).standard_normal(239)
    least = [best_rpe_m(winding, wrong, sigma_m, 60.0, 20.0) for sigma_m in (0.01, 0.3, 3.0, 1000.0)]
    assert np.all(np.diff(least) > 0.0)
    assert least[0] < 0.1
    assert least[-1] == pytest.approx(np.mean(np.abs(np.convolve(5.0 * wrong, np.ones(4), "valid"))), rel=0.3)  # nothing is told


def test_a_place_along_a_road_is_told_where_it_bends(winding):
    told = told_sigmas_m(winding, 1.0, 60.0)
    turned = np.abs(winding.true_poses[10:-10, 2])  # away from the ends
    bend, straight = 10 + np.argmin(turned), 10 + np.argmax(turned)
    assert told[bend] < 3.0 < 30.0 < told[straight]


def test_a_right_covariance_has_the_nees_that_is_expected_of_it():
    network = grid_network(np.random.default_rng(3), columns=5, rows=5)
    drive = semi_metric_drive(network, np.random.default_rng(4), length_m=1500.0, closures=0)
    _, solution, status = solve_route(drive.cognitive_map, replace(network, survey_sigma_m=1.0), RouteRefineConfig())
    closures, vouched = keyframe_closures(drive.cognitive_map), status == MatchStatus.MATCHED
    mean, low, high = expected_nees(solution, closures, drive.true_poses[:, :2], vouched, np.random.default_rng(0))
    assert 0.2 < low < mean < high
    assert mean < 1.0  # the fit takes what the errors have in common
    points_m, covariance = solution.state.poses[:, :2], solution.covariance[:, :2, :2]
    assert nees_after_fit(points_m, 4.0 * covariance, drive.true_poses[:, :2], vouched) == pytest.approx(
        nees_after_fit(points_m, covariance, drive.true_poses[:, :2], vouched) / 4.0
    )
