"""How accurate a drive shows the map to be, where the error of the map along it is known because it was made here."""

from dataclasses import replace

import numpy as np
import pytest

from hippodrome.core.refinement.factors import State
from hippodrome.core.refinement.map_error import MapErrorModel, drift_variance_m2, shown_sigma_m
from hippodrome.core.refinement.noise import Noise
from hippodrome.core.refinement.refine import RefineConfig, refine
from hippodrome.core.refinement.route import RouteRefineConfig
from hippodrome.core.refinement.solver import SolverConfig
from hippodrome.core.types import Visits
from tests.core.synthetic import grid_network, semi_metric_drive

STEP_M, LENGTH_M, ASSUMED_M, KNOWN = 5.0, 60.0, 2.5, 5.0
GOOD = Noise(along=0.001, across=0.001, heading=0.0001, log_scale=0.0001)
POOR = Noise(along=0.1, across=0.1, heading=0.015, log_scale=0.005)


def shown(sigma_m, keyframes=4_000, left=0.01, noise=GOOD, seed=0, unit=1.0):
    """What a straight drive shows whose map errs by a field of ``sigma_m``, all but the share ``left`` of which it determines."""
    rng, keep = np.random.default_rng(seed), np.exp(-STEP_M / LENGTH_M)
    error = rng.standard_normal((keyframes, 2))
    for i in range(1, keyframes):
        error[i] = keep * error[i - 1] + np.sqrt(1.0 - keep**2) * error[i]
    motion = np.tile([STEP_M / unit, 0.0, 0.0], (keyframes, 1))
    visits = Visits(np.arange(keyframes) * 0.5, np.arange(keyframes, dtype=np.int32), motion)
    state = State(np.zeros((keyframes, 3)), np.full(keyframes, np.log(unit)), np.zeros(2), sigma_m * error)
    covariance = np.tile(left * ASSUMED_M**2 * np.eye(6), (keyframes, 1, 1))
    return shown_sigma_m(MapErrorModel(ASSUMED_M, LENGTH_M), KNOWN, state, covariance, noise, visits)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("true_m", [0.5, 1.0, 2.0])
def test_a_long_drive_with_a_good_odometry_shows_how_accurate_the_map_is(true_m, seed):
    errors = 4_000 * STEP_M / LENGTH_M
    expected = np.sqrt((KNOWN * ASSUMED_M**2 + errors * true_m**2) / (KNOWN + errors))
    assert shown(true_m, seed=seed) == pytest.approx(expected, rel=3.0 / np.sqrt(2.0 * errors))


def test_a_short_drive_leaves_it_at_what_maps_of_the_kind_have():
    assert shown(0.5, keyframes=10) == pytest.approx(ASSUMED_M, rel=0.1)


def test_a_drive_that_determines_nothing_leaves_it_exactly():
    assert shown(0.0, left=1.0) == ASSUMED_M


def test_a_poor_odometry_may_be_what_differs_and_shows_nothing():
    assert drift_variance_m2(POOR, 2.0 * LENGTH_M) > ASSUMED_M**2
    assert shown(0.5, noise=POOR) == pytest.approx(ASSUMED_M)


def test_a_worse_map_looks_like_a_poor_odometry_and_is_not_told():
    assert shown(6.0) == pytest.approx(ASSUMED_M)


def test_the_unit_of_the_odometry_does_not_matter():
    assert shown(1.0, unit=0.3) == pytest.approx(shown(1.0))


def test_odometry_gathers_its_errors_as_random_walks_do():
    """Heading alone moves the place across by the integral of a random walk, whose variance is h^2 L^3 / 3."""
    rng, only = np.random.default_rng(0), Noise(along=0.0, across=0.0, heading=0.01, log_scale=0.0)
    headings = np.cumsum(0.01 * rng.standard_normal((20_000, 60)), axis=1)
    assert drift_variance_m2(only, 60.0) == pytest.approx(0.5 * np.var(headings.sum(axis=1)), rel=0.05)


def test_only_the_covariance_takes_the_map_to_be_as_it_was_shown():
    """Poses, and what is vouched for, are those of the assumed accuracy; an exact map gets smaller covariances by the drive."""
    network = replace(grid_network(np.random.default_rng(1), columns=4, rows=3), survey_sigma_m=ASSUMED_M)
    driven = semi_metric_drive(network, np.random.default_rng(1), length_m=1500.0, relaxed=False).cognitive_map

    def refined(**solver):
        return refine(driven, network, RefineConfig(route=RouteRefineConfig(solver=SolverConfig(**solver))))

    asked, told = refined(), refined(survey_freedom=None)
    assert np.array_equal(asked.cognitive_map.poses, told.cognitive_map.poses)
    assert np.array_equal(asked.cognitive_map.road_match.status, told.cognitive_map.road_match.status)
    assert 0.3 < asked.estimates["survey_sigma_m"] < ASSUMED_M
    assert "survey_sigma_m" not in told.estimates
    sigmas = [np.sqrt(np.linalg.eigvalsh(one.cognitive_map.covariance[:, :2, :2])[:, -1]) for one in (asked, told)]
    assert np.all(sigmas[0] < sigmas[1])
