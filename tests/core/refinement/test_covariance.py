import numpy as np
import pytest

from hippodrome.core.refinement.covariance import covariance_under_map_error, posterior_covariance, with_systematic_errors
from hippodrome.core.refinement.factors import State
from hippodrome.core.refinement.map_error import MapErrorModel
from hippodrome.core.refinement.noise import Noise
from hippodrome.core.refinement.residuals import (
    RoadTargets,
    all_factors,
    normal_equations,
)
from hippodrome.core.refinement.solver import _all_told
from hippodrome.core.solvers.chain import factorise, marginals
from hippodrome.core.types import EdgeKind, Edges, Visits

COUNT = 40


@pytest.fixture
def problem():
    """A straight drive on a road that is known lengthwise to metres; one closure, far surer than that."""
    poses = np.column_stack([5.0 * np.arange(COUNT), np.zeros((COUNT, 2))])
    motion = np.tile([5.0, 0.0, 0.0], (COUNT, 1))
    motion[0] = 0.0
    visits = Visits(np.arange(COUNT) * 0.5, np.arange(COUNT, dtype=np.int32), motion)
    state, noise = State(poses, np.zeros(COUNT), np.zeros(2)), Noise(scale_inverse_freedom=0.0)
    edges = Edges(
        np.array([30], np.int32),
        np.array([10], np.int32),
        np.array([[-100.0, 0.0, 0.0]]),
        np.array([[0.1, 0.1, 0.1]]),
        np.array([EdgeKind.CLOSURE], np.uint8),
        np.ones(1, np.float32),
    )
    held = RoadTargets(poses[:, :2], np.zeros(COUNT), np.zeros(COUNT), np.zeros(COUNT), np.ones(COUNT), 2.0)
    return state, all_factors(state, visits, edges, held, noise, np.zeros(COUNT - 1)), edges


def full_inverse(state, factors, edges):
    """The covariance (S, 4, 4) from the whole matrix, gyro and the coupling through closures included."""
    system = normal_equations(state, factors, edges)
    size = 4 * COUNT
    matrix = np.zeros((size + 2, size + 2))
    for i in range(COUNT):
        matrix[4 * i : 4 * i + 4, 4 * i : 4 * i + 4] = system.diagonal[i]
        matrix[4 * i : 4 * i + 4, size:] = system.border[i]
        if i + 1 < COUNT:
            matrix[4 * i : 4 * i + 4, 4 * i + 4 : 4 * i + 8] = system.upper[i]
    for e, (a, b) in enumerate(zip(edges.source, edges.target, strict=True)):
        matrix[4 * b : 4 * b + 4, 4 * a : 4 * a + 4] += factors.closures.target[e].T @ factors.closures.source[e]
    matrix = np.triu(matrix) + np.triu(matrix, 1).T
    matrix[size:, size:] = system.corner
    inverse = np.linalg.inv(matrix)
    return np.stack([inverse[4 * i : 4 * i + 4, 4 * i : 4 * i + 4] for i in range(COUNT)])


def test_the_far_end_of_a_closure_is_not_taken_known(problem):
    state, factors, edges = problem
    exact = full_inverse(state, factors, edges)[:, 0, 0]
    ours = posterior_covariance(state, factors, edges)[:, 0, 0]
    as_known = marginals(factorise(normal_equations(state, factors, edges)))[0][:, 0, 0]
    assert np.abs(ours / exact - 1.0).max() < 0.25
    assert (as_known / exact).min() < 0.1


def passes(survey_sigma_m, count=4, keyframes=20):
    """One straight road that was driven ``count`` times, with exact closures; each pass begins where the last one began."""
    along = np.tile(5.0 * np.arange(keyframes), count)
    poses = np.column_stack([along, np.zeros((len(along), 2))])
    motion = np.column_stack([np.diff(along, prepend=0.0), np.zeros((len(along), 2))])
    visits = Visits(np.arange(len(along)) * 0.5, np.arange(len(along), dtype=np.int32), motion)
    target = np.arange(keyframes, len(along), dtype=np.int32)
    source, closed = (target % keyframes).astype(np.int32), len(target)
    kind, margin = np.full(closed, EdgeKind.CLOSURE, np.uint8), np.ones(closed, np.float32)
    edges = Edges(source, target, np.zeros((closed, 3)), np.full((closed, 3), 0.1), kind, margin)
    error = None if survey_sigma_m is None else np.zeros((len(along), 2))
    model = None if survey_sigma_m is None else MapErrorModel(survey_sigma_m, 60.0)
    state = State(poses, np.zeros(len(along)), np.zeros(2), error)
    flat = np.zeros(len(along))
    held = RoadTargets(poses[:, :2], flat, flat, flat, np.ones(len(along)), 2.0, model)
    noise = Noise(heading=0.03, across=0.3, scale_inverse_freedom=0.0)
    return state, all_factors(state, visits, edges, held, noise, np.zeros(len(along) - 1)), edges


def test_who_comes_by_again_learns_nothing_of_the_error_of_the_map():
    survey_m = 0.5
    state, factors, edges = passes(survey_m)
    across = np.sqrt(covariance_under_map_error(state, factors, edges)[:, 1, 1])
    as_witnesses = np.sqrt(posterior_covariance(state, factors, edges)[:, 1, 1])
    assert 0.8 * survey_m < across.min() < across.max() < 1.2 * survey_m
    assert as_witnesses.min() < 0.6 * survey_m


def test_an_exact_map_and_one_that_hardly_errs_have_the_same_covariance():
    exact, hardly = (covariance_under_map_error(*passes(sigma_m)) for sigma_m in (None, 1e-4))
    np.testing.assert_allclose(hardly[:, :4, :4], exact, rtol=1e-3, atol=1e-9)
    np.testing.assert_array_equal(exact, posterior_covariance(*passes(None)))


def test_what_never_averages_out_is_added_to_both_axes():
    added = with_systematic_errors(np.zeros((2, 6, 6)))
    np.testing.assert_allclose(added[1], np.diag([0.01, 0.01, 1e-4, 0.0, 0.0, 0.0]))


def test_of_what_is_not_finite_nothing_is_known():
    covariance = np.tile(0.1 * np.eye(4), (3, 1, 1))
    covariance[1, 2, 0] = np.nan
    told = _all_told(covariance)
    np.testing.assert_array_equal(told[[0, 2]], covariance[[0, 2]])
    np.testing.assert_array_equal(told[1], 1e6 * np.eye(4))
