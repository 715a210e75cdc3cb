"""The similarity between map and network: exact on undistorted maps, right on bent ones, whatever the scale."""

import numpy as np
import pytest

from hippodrome.core import se2
from hippodrome.core.refinement.alignment import Similarity, align, apply
from hippodrome.core.refinement.config import AlignmentConfig
from hippodrome.core.roads.geometry import road_geometry
from hippodrome.core.types import StartPose
from tests.core.synthetic import grid_network, random_route, semi_metric_drive, true_path


def test_apply_by_hand():
    """Scale 2, a quarter turn to the left, then (10, 20)."""
    moved = apply(Similarity(2.0, np.pi / 2, np.array([10.0, 20.0])), np.array([[1.0, 3.0, 0.25]]))
    assert moved == pytest.approx(np.array([[4.0, 22.0, np.pi / 2 + 0.25]]))


@pytest.mark.parametrize("metres_per_unit", [0.25, 0.9, 2.1, 4.5])
def test_an_undistorted_map_is_laid_on_its_roads(metres_per_unit):
    rng = np.random.default_rng(11)
    network = grid_network(rng)
    truth, _ = true_path(network, random_route(network, rng, 4000.0), rng)
    poses = se2.between(truth[0], truth)
    poses[:, :2] /= metres_per_unit
    found = align(poses, StartPose(*truth[0]), road_geometry(network), AlignmentConfig())
    assert found.similarity.scale_m == pytest.approx(metres_per_unit, rel=5e-3)
    assert np.linalg.norm(apply(found.similarity, poses) - truth, axis=1).mean() < 1.5
    assert found.cost < found.runner_up_cost


@pytest.mark.parametrize("seed", range(4))
def test_a_bent_map_comes_close_to_its_best_similarity(seed):
    rng = np.random.default_rng(seed)
    network = grid_network(rng)
    drive = semi_metric_drive(network, rng, length_m=4000.0, units_per_metre=rng.uniform(0.3, 3.0))
    poses, truth = drive.cognitive_map.poses, drive.true_poses
    found = align(poses, StartPose(*truth[0]), road_geometry(network), AlignmentConfig())
    error_m = np.linalg.norm((apply(found.similarity, poses) - truth)[:, :2], axis=1).mean()
    assert error_m < 1.3 * _best_error_m(poses[:, :2], truth[:, :2]) + 2.0


def test_a_wrong_start_heading_is_turned_back():
    rng = np.random.default_rng(2)
    network = grid_network(rng)
    truth, _ = true_path(network, random_route(network, rng, 4000.0), rng)
    start = StartPose(truth[0, 0] + 3.0, truth[0, 1] - 3.0, truth[0, 2] + 0.3)
    found = align(se2.between(truth[0], truth), start, road_geometry(network), AlignmentConfig())
    assert found.similarity.scale_m == pytest.approx(1.0, rel=5e-3)
    assert abs(se2.wrap(found.similarity.rotation_rad - truth[0, 2])) < 0.01


def _best_error_m(points, truth):
    """Mean error (m) after the similarity of least squares, as complex numbers."""
    p, q = (points - points.mean(axis=0)) @ [1, 1j], (truth - truth.mean(axis=0)) @ [1, 1j]
    return np.abs(np.vdot(p, q) / np.vdot(p, p) * p - q).mean()
