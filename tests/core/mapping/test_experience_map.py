"""Edges carry scale-free sigmas and raw motions; RatSLAM's relaxation contracts errors; offsets are smoothed along a road."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from hippodrome.core import se2
from hippodrome.core.mapping.config import ExperienceMapConfig
from hippodrome.core.mapping.experience_map import (
    Closure,
    closure_edges,
    concatenated,
    odometry_edges,
    relax_ratslam,
    relaxed_poses,
    with_median_offsets,
)
from hippodrome.core.types import EdgeKind

CONFIG = ExperienceMapConfig()


def square_motions(laps, rng, turn_bias=0.0):
    motions = np.tile([5.0, 0.0, 0.0], (40 * laps, 1))
    motions[9::10, 2] = np.pi / 2
    motions[:, 2] += turn_bias + 0.003 * rng.normal(size=len(motions))
    motions[0] = 0.0
    return motions


def closures_of(count, per_lap, every=4):
    return [Closure(i - per_lap, i, (0.0, 0.0, 0.0), 5.0, 3.0) for i in range(per_lap, count, every)]


def test_odometry_edges_join_consecutive_visits_with_their_raw_motion():
    motions = square_motions(1, np.random.default_rng(0))
    edges = odometry_edges(motions, CONFIG)
    assert_array_equal(edges.source, np.arange(39))
    assert_array_equal(edges.target, np.arange(1, 40))
    assert_allclose(edges.motion, motions[1:])
    assert (edges.kind == EdgeKind.ODOMETRY).all()


def test_standard_deviations_scale_with_the_unit_of_length():
    motions = square_motions(1, np.random.default_rng(0))
    unit = np.array([3.0, 3.0, 1.0])
    assert_allclose(odometry_edges(motions * unit, CONFIG).sigma, odometry_edges(motions, CONFIG).sigma * unit)
    small = closure_edges([Closure(0, 9, (0.1, 0.0, 0.0), 5.0, 3.0)], CONFIG)
    large = closure_edges([Closure(0, 9, (0.3, 0.0, 0.0), 15.0, 3.0)], CONFIG)
    assert_allclose(large.sigma, small.sigma * unit)


def test_no_closures_make_an_empty_set_of_edges():
    none = closure_edges([], CONFIG)
    assert none.motion.shape == none.sigma.shape == (0, 3)
    assert len(concatenated(odometry_edges(np.zeros((1, 3)), CONFIG), none).source) == 0


@pytest.mark.parametrize("relaxation", ["robust", "ratslam"])
def test_closures_mend_a_biased_drive(relaxation):
    motions = square_motions(3, np.random.default_rng(1), turn_bias=0.01)
    config = ExperienceMapConfig(relaxation=relaxation, ratslam_sweeps=500)
    edges = concatenated(odometry_edges(motions, config), closure_edges(closures_of(120, 40), config))
    poses, reckoned = relaxed_poses(motions, edges, config), se2.integrate(np.zeros(3), motions)

    def gap(some):
        return np.mean(np.linalg.norm(some[40:, :2] - some[:-40, :2], axis=1))

    assert gap(poses) < 0.25 * gap(reckoned)
    assert_allclose(poses[0], 0.0, atol=1e-12)


def test_one_ratslam_sweep_by_hand():
    edges = odometry_edges(np.array([[0.0, 0, 0], [2.0, 0, 0]]), CONFIG)
    relaxed = relax_ratslam(np.array([[0.0, 0, 0], [3.0, 0, 0]]), edges, correction=0.5, sweeps=1)
    assert_allclose(relaxed, [[0.0, 0, 0], [2.5, 0, 0]])  # an error of 1: each end moves by a quarter


def test_ratslam_leaves_a_consistent_map_alone():
    motions = square_motions(1, np.random.default_rng(2))
    reckoned = se2.integrate(np.zeros(3), motions)
    assert_allclose(
        relax_ratslam(reckoned, odometry_edges(motions, CONFIG), 0.5, 20), se2.between(reckoned[:1], reckoned), atol=1e-9
    )


def test_steadying_halves_the_noise_of_the_offsets_and_mends_an_outlier():
    rng = np.random.default_rng(3)
    motions = np.tile([5.0, 0.0, 0.0], (200, 1))
    noise = rng.normal(size=80)
    noise[40] = 8.0
    closures = [Closure(10 + i, 110 + i, (1.2 + float(e), 0.0, 0.1), 5.0, 3.0) for i, e in enumerate(noise)]
    steady = np.array([c.motion[0] for c in with_median_offsets(closures, motions, CONFIG)])
    assert np.std(steady - 1.2) < 0.6 * np.std(np.delete(noise, 40))
    assert abs(steady[40] - 1.2) < 1.5
    assert all(c.motion[1:] == (0.0, 0.1) for c in with_median_offsets(closures, motions, CONFIG))


def test_steadying_keeps_stretches_apart():
    motions = np.tile([5.0, 0.0, 0.0], (200, 1))
    on_one_road = [Closure(10 + i, 110 + i, (0.5, 0.0, 0.0), 5.0, 3.0) for i in range(4)]
    on_another = [Closure(60 + i, 114 + i, (-2.0, 0.0, 0.0), 5.0, 3.0) for i in range(4)]
    steady = with_median_offsets(on_another + on_one_road, motions, CONFIG)
    assert_allclose([c.motion[0] for c in steady], [0.5] * 4 + [-2.0] * 4)


def test_impossible_settings_are_rejected():
    with pytest.raises(ValueError, match="experience map"):
        ExperienceMapConfig(closure_along=0.0)
