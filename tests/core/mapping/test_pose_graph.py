"""The optimiser against GTSAM on the same problem, and against false closures."""

import time

import gtsam
import numpy as np
import pytest
from numpy.testing import assert_allclose

from hippodrome.core import se2
from hippodrome.core.mapping.config import PoseGraphConfig
from hippodrome.core.mapping.pose_graph import edge_weights, relax_pose_graph
from hippodrome.core.types import EdgeKind, Edges

SIGMA_ODOMETRY = np.array([0.1, 0.1, 0.02])  # alike along and across: GTSAM's error turns with the measured heading
SIGMA_CLOSURE = np.array([0.3, 0.3, 0.06])


def loops(count, laps, rng, false_share=0.0):
    """Ground truth on a circle driven ``laps`` times, noisy odometry, closures between the laps."""
    per_lap = count // laps
    angle = 2 * np.pi * np.arange(count) / per_lap
    radius = per_lap / (2 * np.pi) * 5.0
    truth = np.stack([radius * np.sin(angle), radius * (1 - np.cos(angle)), se2.wrap(angle)], axis=1)
    source = np.arange(count - 1)
    odometry = se2.between(truth[:-1], truth[1:]) + rng.normal(size=(count - 1, 3)) * SIGMA_ODOMETRY
    later = np.arange(per_lap, count, 3)
    earlier = later - per_lap
    closing = se2.between(truth[earlier], truth[later]) + rng.normal(size=(len(later), 3)) * SIGMA_CLOSURE
    wrong = rng.random(len(later)) < false_share
    earlier = np.where(wrong, rng.integers(0, per_lap, len(later)), earlier)
    edges = Edges(
        source=np.concatenate([source, earlier]).astype(np.int32),
        target=np.concatenate([source + 1, later]).astype(np.int32),
        motion=np.concatenate([odometry, closing]),
        sigma=np.concatenate([np.tile(SIGMA_ODOMETRY, (count - 1, 1)), np.tile(SIGMA_CLOSURE, (len(later), 1))]),
        kind=np.repeat(np.array([EdgeKind.ODOMETRY, EdgeKind.CLOSURE], dtype=np.uint8), [count - 1, len(later)]),
        margin=np.zeros(count - 1 + len(later), dtype=np.float32),
    )
    reckoned = se2.integrate(np.zeros(3), np.concatenate([np.zeros((1, 3)), odometry]))
    return truth, reckoned, edges, wrong


def gtsam_optimum(start, edges, robust_scale):
    """The same robust cost, minimised by GTSAM."""
    graph, initial = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for i, pose in enumerate(start):
        initial.insert(i, gtsam.Pose2(*pose))
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*start[0]), gtsam.noiseModel.Isotropic.Sigma(3, 1e-6)))
    for a, b, motion, sigma, kind in zip(edges.source, edges.target, edges.motion, edges.sigma, edges.kind, strict=True):
        noise = gtsam.noiseModel.Diagonal.Sigmas(sigma)
        if kind == EdgeKind.CLOSURE:
            noise = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.GemanMcClure.Create(robust_scale), noise)
        graph.add(gtsam.BetweenFactorPose2(int(a), int(b), gtsam.Pose2(*motion), noise))
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(1e-12)
    parameters.setMaxIterations(200)
    result = gtsam.LevenbergMarquardtOptimizer(graph, initial, parameters).optimize()
    return np.array([[result.atPose2(i).x(), result.atPose2(i).y(), result.atPose2(i).theta()] for i in range(len(start))])


@pytest.mark.parametrize("false_share", [0.0, 0.1])
def test_it_agrees_with_gtsam(false_share):
    config = PoseGraphConfig(rounds=40)
    _, reckoned, edges, _ = loops(90, 3, np.random.default_rng(5), false_share)
    ours = relax_pose_graph(reckoned, edges, config)
    theirs = gtsam_optimum(ours + 1e-3, edges, config.robust_scale)  # started beside ours: the same basin
    offset = se2.between(se2.between(theirs[:1], theirs), ours)
    assert_allclose(offset, 0.0, atol=1e-3)  # GTSAM bends each error with its turn: a difference of second order


def rmse(poses, truth):
    return np.sqrt(np.mean(np.sum((poses[:, :2] - truth[:, :2]) ** 2, axis=1)))


def test_closures_pull_the_map_together():
    truth, reckoned, edges, _ = loops(300, 3, np.random.default_rng(0))
    assert rmse(relax_pose_graph(reckoned, edges, PoseGraphConfig()), truth) < 0.5 * rmse(reckoned, truth)


def test_false_closures_lose_their_say():
    rng = np.random.default_rng(1)
    truth, reckoned, edges, wrong = loops(300, 3, rng, false_share=0.2)
    poses = relax_pose_graph(reckoned, edges, PoseGraphConfig())
    clean = relax_pose_graph(reckoned, kept(edges, np.concatenate([np.ones(299, bool), ~wrong])), PoseGraphConfig())
    assert rmse(poses, truth) < 1.3 * rmse(clean, truth) + 0.1
    weight = edge_weights(poses, edges, PoseGraphConfig().robust_scale ** 2)[299:]
    assert np.median(weight[wrong]) < 0.05
    assert np.median(weight[~wrong]) > 0.5  # 0.56 is the weight of a typical error, three sigmas squared in three dimensions


def kept(edges, mask):
    names = ("source", "target", "motion", "sigma", "kind", "margin")
    return Edges(**{name: getattr(edges, name)[mask] for name in names})


def test_without_closures_dead_reckoning_is_the_answer():
    _, reckoned, edges, _ = loops(60, 1, np.random.default_rng(2))
    odometry = kept(edges, edges.kind == EdgeKind.ODOMETRY)
    assert_allclose(relax_pose_graph(reckoned, odometry, PoseGraphConfig()), reckoned, atol=1e-9)


def test_the_first_vertex_stays_and_the_arguments_too():
    _, reckoned, edges, _ = loops(60, 2, np.random.default_rng(3))
    before = reckoned.copy()
    assert_allclose(relax_pose_graph(reckoned, edges, PoseGraphConfig())[0], reckoned[0])
    assert_allclose(reckoned, before, atol=0.0)


def test_a_map_of_one_vertex_has_nothing_to_optimise():
    empty = kept(loops(60, 2, np.random.default_rng(4))[2], np.zeros(59 + 10, dtype=bool))
    assert_allclose(relax_pose_graph(np.zeros((1, 3)), empty, PoseGraphConfig()), np.zeros((1, 3)))


def test_work_grows_nearly_linearly_with_the_map():
    def best_of_three(count):
        _, reckoned, edges, _ = loops(count, 4, np.random.default_rng(6))
        taken = []
        for _ in range(3):
            began = time.process_time()
            relax_pose_graph(reckoned, edges, PoseGraphConfig())
            taken.append(time.process_time() - began)
        return min(taken)

    assert best_of_three(2000) < 25 * best_of_three(200)
