"""Gauss-Newton against hand-computed answers, SciPy and GTSAM."""

import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.sparse import csc_array, csr_array

from hippodrome.core import se2
from hippodrome.core.solvers.gauss_newton import block_jacobian, factorise, gauss_newton
from hippodrome.core.solvers.pose_costs import global_residual, local_residual, total_residual


def _problem(seed, count=12):
    """Edges of a noisy loop, matched positions of some vertices, and a rough first guess."""
    rng = np.random.default_rng(seed)
    truth = se2.integrate(np.array([3.0, -2.0, 0.3]), np.tile([5.0, 0.0, 2 * np.pi / count], (count, 1)))
    source, target = np.arange(count, dtype=np.int32), np.roll(np.arange(count, dtype=np.int32), -1)
    sigma = np.tile([0.5, 0.2, 0.05], (count, 1))
    motion = se2.between(truth[source], truth[target]) + 0.3 * sigma * rng.standard_normal((count, 3))
    vertex = np.array([0, 4, 5, 9], dtype=np.int32)
    matched = truth[vertex, :2] + 0.5 * rng.standard_normal((4, 2))
    guess = truth + np.array([0.8, 0.8, 0.1]) * rng.standard_normal(truth.shape)

    def linearise(state):
        poses = state.reshape(-1, 3)
        local = local_residual(poses, source, target, motion, sigma)
        return total_residual(local, global_residual(poses, vertex, matched), 1.5, 0.16)

    return linearise, guess, (source, target, motion, sigma, vertex, matched)


def test_a_line_through_points_in_one_step():
    x, y = np.array([0.0, 1.0, 2.0]), np.array([1.0, 3.0, 5.0])
    jacobian = csr_array(np.column_stack([x, np.ones(3)]))
    solution = gauss_newton(lambda state: (jacobian @ state - y, jacobian), np.zeros(2))
    assert solution.state == pytest.approx([2.0, 1.0])
    assert solution.converged


def test_a_step_that_overshoots_is_halved():
    """Minimum of arctan(x)^2: the full Gauss-Newton step from 3 diverges."""

    def linearise(state):
        return np.arctan(state), csr_array(np.array([[1.0 / (1.0 + state[0] ** 2)]]))

    assert gauss_newton(linearise, np.array([3.0]), max_iterations=30).state == pytest.approx([0.0], abs=1e-6)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_equals_scipy_least_squares(seed):
    linearise, guess, _ = _problem(seed)
    ours = gauss_newton(linearise, guess.ravel(), max_iterations=50, tolerance=1e-10)
    theirs = least_squares(lambda state: linearise(state)[0], guess.ravel(), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert ours.cost == pytest.approx(theirs.cost, rel=1e-8)
    assert ours.state == pytest.approx(theirs.x, abs=1e-5)


def test_equals_gtsam():
    linearise, guess, (source, target, motion, sigma, vertex, matched) = _problem(7)
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for a, b, step, deviation in zip(source, target, motion, sigma, strict=True):
        noise = gtsam.noiseModel.Diagonal.Sigmas(deviation / np.sqrt(1.5))
        graph.add(gtsam.BetweenFactorPose2(int(a), int(b), gtsam.Pose2(*step), noise))
    for t, z in zip(vertex, matched, strict=True):
        graph.add(gtsam.PoseTranslationPrior2D(int(t), gtsam.Pose2(*z, 0.0), gtsam.noiseModel.Isotropic.Sigma(2, 2.5)))
    for t, pose in enumerate(guess):
        values.insert(t, gtsam.Pose2(*pose))
    theirs = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    expected = np.array([[theirs.atPose2(t).x(), theirs.atPose2(t).y(), theirs.atPose2(t).theta()] for t in range(len(guess))])
    ours = gauss_newton(linearise, guess.ravel(), tolerance=1e-10).state.reshape(-1, 3)
    # GTSAM measures Eq. (11)'s bracket in the measured frame and on the manifold: equal to second order in the residual
    assert np.abs(ours[:, :2] - expected[:, :2]).max() < 0.02
    assert np.abs(se2.wrap(ours[:, 2] - expected[:, 2])).max() < 0.004


def test_jacobians_equal_finite_differences():
    linearise, guess, _ = _problem(3)
    state = guess.ravel()
    _, jacobian = linearise(state)
    steps = 1e-6 * np.eye(len(state))
    numeric = np.column_stack([(linearise(state + h)[0] - linearise(state - h)[0]) / 2e-6 for h in steps])
    assert jacobian.toarray() == pytest.approx(numeric, abs=1e-6)


def test_blocks_land_where_their_variables_are():
    derivative = np.arange(12.0).reshape(2, 2, 3)
    jacobian = block_jacobian([(derivative, np.array([3, 0]))], 6).toarray()
    expected = np.zeros((4, 6))
    expected[:2, 3:], expected[2:, :3] = derivative[0], derivative[1]
    assert np.array_equal(jacobian, expected)


def test_factorise_solves():
    matrix = csc_array(np.array([[4.0, 1.0], [1.0, 3.0]]))
    assert factorise(matrix).solve(np.array([1.0, 2.0])) == pytest.approx([1 / 11, 7 / 11])
