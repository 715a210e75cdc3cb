"""Road that the map shows, and scores told apart by it."""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from hippodrome.core.types import LocalizationEstimate, Trajectory
from hippodrome.eval.metrics.localization import score_localization
from hippodrome.eval.metrics.mapped_road import mapped_way_m, on_mapped_road, split_by_map
from tests.core.looped_world import Pictures, topometric_map

NOTHING = np.zeros(2), np.zeros(2), np.zeros((0, 2, 2)), np.zeros((0, 2, 2))
LOOP = topometric_map(Pictures(seed=3), np.random.default_rng(3))
PLACES = len(LOOP.poses)
MAP = replace(LOOP, poses=np.column_stack([5.0 * np.arange(PLACES), np.zeros(PLACES), np.zeros(PLACES)]))  # a street, eastward


def straight(count, back_m=0.0, turn_rad=0.0):
    """Poses every metre, from ``back_m`` before the street on."""
    return np.column_stack([np.arange(count) - back_m, np.zeros(count), np.full(count, turn_rad)])


def test_road_is_mapped_near_a_vertex_that_faces_the_same_way():
    assert list(on_mapped_road(straight(30, back_m=29.0), MAP)[[0, 10, 16, 29]]) == [False, False, True, True]
    assert not on_mapped_road(straight(3, turn_rad=np.pi), MAP).any()


def test_metres_count_on_mapped_road_only():
    assert_allclose(mapped_way_m(straight(5), np.array([False, False, True, True, True])), [0.0, 0.0, 1.0, 2.0, 3.0])


def test_errors_off_the_map_are_kept_apart_by_hand():
    poses = straight(40, back_m=39.0)  # 24 steps before the map, 16 on it
    mapped = on_mapped_road(poses, MAP)
    offset_m = np.where(mapped, 1.0, 5.0)
    offset_m[20] = 25.0  # a false fix, off the map
    estimates = [
        LocalizationEstimate(float(i), pose + np.array([offset, 0.0, 0.0]), np.eye(3), i >= 20, 1.0, 0, *NOTHING)
        for i, (pose, offset) in enumerate(zip(poses, offset_m, strict=True))
    ]
    score = score_localization(estimates, Trajectory(np.arange(40.0), poses), np.zeros(40), max_gap_s=2.0)
    found = split_by_map(score, poses, MAP)
    assert found.localized_after_m == 0.0  # all of what was driven until then was unmapped
    assert_allclose(found.errors_m, np.ones(int(mapped.sum())))
    assert_allclose(found.off_map_errors_m, np.full(int((~mapped[21:]).sum()), 5.0))
    assert found.steps == 19
    assert found.way_m == mapped.sum()
