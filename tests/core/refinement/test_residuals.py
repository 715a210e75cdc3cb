from dataclasses import replace

import gtsam
import numpy as np
import pytest

from hippodrome.core import se2
from hippodrome.core.refinement.edges import edges_where
from hippodrome.core.refinement.factors import State
from hippodrome.core.refinement.map_error import MapErrorModel, map_error_factors
from hippodrome.core.refinement.noise import Noise
from hippodrome.core.refinement.residuals import (
    BIAS_SIGMA_RADPS,
    GAIN_SIGMA,
    GEMAN_MCCLURE,
    RoadTargets,
    all_factors,
    closure_factors,
    normal_equations,
    odometry_factors,
    road_factors,
    stepped,
)
from hippodrome.core.refinement.solver import gauss_newton_step
from hippodrome.core.solvers.chain import factorise, marginals
from hippodrome.core.types import EdgeKind, Edges, Visits

COUNT = 30
NOTHING_OPEN = np.zeros(COUNT - 1)  # what the data leave open of the scale's steps


@pytest.fixture
def problem():
    """An S-shaped drive, its noisy motions, three closures of which one is false, and a state near the optimum."""
    rng = np.random.default_rng(0)
    truth = se2.integrate(
        np.array([3.0, -2.0, 0.4]), np.column_stack([np.full(COUNT, 5.0), np.zeros(COUNT), 0.15 * np.sin(np.arange(COUNT) / 3.0)])
    )
    motion = np.concatenate([np.zeros((1, 3)), se2.between(truth[:-1], truth[1:])])
    motion[1:] = (motion[1:] + [0.1, 0.02, 0.005] * rng.standard_normal((COUNT - 1, 3))) * [0.5, 0.5, 1.02]
    visits = Visits(np.arange(COUNT) * 0.6, np.arange(COUNT, dtype=np.int32), motion)
    source, target = np.array([20, 25, 29], np.int32), np.array([2, 5, 9], np.int32)
    seen = se2.between(truth[source], truth[target]) * [0.5, 0.5, 1.0]
    seen[2] += [15.0, -8.0, 1.0]
    edges = Edges(
        source, target, seen, np.tile([0.5, 0.25, 0.08], (3, 1)), np.full(3, EdgeKind.CLOSURE, np.uint8), np.ones(3, np.float32)
    )
    points = truth[:, :2] + 0.1 * rng.standard_normal((COUNT, 2))
    targets = RoadTargets(points, truth[:, 2], np.full(COUNT, 0.02), np.full(COUNT, 0.1), np.ones(COUNT), 3.0)
    start = State(truth + 0.1 * rng.standard_normal((COUNT, 3)) * [1.0, 1.0, 0.1], np.full(COUNT, 0.6), np.zeros(2))
    return visits, edges, targets, start


def numeric(factors_of, state, visit):
    """Derivative (N, M, 4 or 6) of the factors' residuals by one keyframe's unknowns."""
    columns = []
    for axis in range(state.width):
        step = np.zeros((COUNT, state.width))
        step[visit, axis] = 1e-6
        high, low = (factors_of(stepped(state, sign * step, np.zeros(2))).residual for sign in (1.0, -1.0))
        columns.append((high - low) / 2e-6)
    return np.stack(columns, axis=-1)


def test_only_the_scale_may_jump(problem):
    visits, _, _, state = problem
    state = stepped(state, np.outer(np.arange(COUNT) % 7 == 0, [0.0, 0.0, 0.0, 0.05]), np.zeros(2))
    normal, heavy = (odometry_factors(state, visits, Noise(scale_inverse_freedom=tail), NOTHING_OPEN) for tail in (0.0, 0.25))
    expected = 1.25 / (1.0 + 0.25 * normal.residual[:, 3] ** 2)
    assert expected.min() < 0.5
    np.testing.assert_allclose(heavy.weight, np.column_stack([np.ones((COUNT - 1, 3)), expected]))
    np.testing.assert_allclose(heavy.residual[:, 3], normal.residual[:, 3] * np.sqrt(expected))


def test_a_step_that_nothing_tells_has_the_weight_of_a_usual_one(problem):
    visits, _, _, state = problem
    noise = Noise()
    metres = np.hypot(*visits.motion[1:, :2].T) * np.exp(state.log_scale[:-1])
    steps = odometry_factors(state, visits, noise, noise.step_sigmas(metres)[:, 3] ** 2)  # as open as before any data, residual 0
    np.testing.assert_allclose(steps.weight[:, 3], 1.0)


def test_a_turn_drawn_otherwise_than_driven_loses_weight(problem):
    _, _, targets, state = problem
    normal, heavy = (road_factors(state, targets, Noise(road_inverse_freedom=tail)) for tail in (0.0, 1.0))
    np.testing.assert_allclose(heavy.weight, 2.0 / (1.0 + normal.residual**2) * [1.0, 1.0, 0.0] + [0.0, 0.0, 1.0])


def test_jacobians_agree_with_differences(problem):
    visits, edges, targets, state = problem
    # sigmas so wide that the robust weights hardly change
    quiet = Noise(lateral_m=50.0, lane_heading_rad=50.0, closure_factor=1e3, scale_inverse_freedom=0.0)
    steps, roads, closing, *_ = all_factors(state, visits, edges, targets, quiet, NOTHING_OPEN)
    for visit in (0, 7, 20):
        by_steps = numeric(lambda s: odometry_factors(s, visits, quiet, NOTHING_OPEN), state, visit)
        np.testing.assert_allclose(by_steps[visit, :, :3], steps.source[visit, :, :3], atol=1e-4)
        if visit:
            np.testing.assert_allclose(by_steps[visit - 1], steps.target[visit - 1], atol=1e-4)
        by_road = numeric(lambda s: road_factors(s, targets, quiet), state, visit)
        np.testing.assert_allclose(by_road[visit], roads.jacobian[visit], atol=1e-6)
    by_closure = numeric(lambda s: closure_factors(s, edges, quiet), state, 20)
    np.testing.assert_allclose(by_closure[0, :, :3], closing.source[0, :, :3], atol=1e-4)


@pytest.mark.parametrize("to_a_point", [False, True])
def test_a_vehicle_may_slide_along_a_bend_and_is_held_back_by_the_heading_of_one_point(problem, to_a_point):
    """It is 2 m off its target along a bend of 0.02 rad/m, with the heading that the road has there."""
    _, _, targets, state = problem
    bends = replace(targets, bend_1pm=None if to_a_point else np.full(COUNT, 0.02), along_sigma_m=1e9)
    tangent = np.column_stack([np.cos(targets.heading_rad), np.sin(targets.heading_rad)])
    slid = np.column_stack([targets.points_m + 2.0 * tangent, targets.heading_rad + 0.04])
    turned = road_factors(replace(state, poses=slid), bends, Noise()).residual[:, 1]
    assert np.all(np.abs(turned) > 0.5) if to_a_point else np.allclose(turned, 0.0, atol=1e-9)
    quiet = Noise(lateral_m=50.0, lane_heading_rad=50.0)
    by_road = numeric(lambda s: road_factors(s, bends, quiet), state, 7)
    np.testing.assert_allclose(by_road[7], road_factors(state, bends, quiet).jacobian[7], atol=1e-6)


MODEL = MapErrorModel(sigma_m=2.0, length_m=50.0)


def with_map_error(targets, state):
    """The same problem where the map may be wrong."""
    error = 0.5 * np.random.default_rng(8).standard_normal((COUNT, 2))
    return replace(targets, map_error=MODEL), replace(state, map_error_m=error)


def test_jacobians_by_the_error_of_the_map_agree_with_differences(problem):
    visits, edges, targets, state = problem
    quiet = Noise(lateral_m=50.0, lane_heading_rad=50.0)
    targets, state = with_map_error(targets, state)
    factors = all_factors(state, visits, edges, targets, quiet, NOTHING_OPEN)
    for keyframe in (0, 7, 20):
        by_road = numeric(lambda s: road_factors(s, targets, quiet), state, keyframe)
        np.testing.assert_allclose(by_road[keyframe], factors.road.jacobian[keyframe], atol=1e-5)
        by_steps = numeric(lambda s: map_error_factors(s, visits, edges, MODEL).steps, state, keyframe)
        np.testing.assert_allclose(by_steps[keyframe, :, 4:], factors.map_error.steps.source[keyframe, :, 4:], atol=1e-6)
        if keyframe:
            np.testing.assert_allclose(by_steps[keyframe - 1], factors.map_error.steps.target[keyframe - 1], atol=1e-6)


def test_without_data_the_error_of_the_map_is_the_stationary_process(problem):
    """Marginals sigma^2 everywhere, and correlations that fall with the driven length: the definition of the model."""
    visits, edges, targets, state = problem
    none = edges_where(edges, np.zeros(len(edges.kind), dtype=bool))
    targets, state = with_map_error(replace(targets, weight=np.full(COUNT, 1e-12)), state)
    own, next_ = marginals(
        factorise(normal_equations(state, all_factors(state, visits, none, targets, Noise(), NOTHING_OPEN), none))
    )
    np.testing.assert_allclose(own[:, 4:, 4:], np.broadcast_to(4.0 * np.eye(2), (COUNT, 2, 2)), atol=1e-6)
    driven = np.exp(state.log_scale[:-1]) * np.hypot(visits.motion[1:, 0], visits.motion[1:, 1])
    np.testing.assert_allclose(next_[:, 4, 4], 4.0 * np.exp(-driven / 50.0), rtol=1e-6)


def test_gyro_jacobian_agrees_with_differences(problem):
    visits, _, _, state = problem
    step, noise = 1e-6, Noise(scale_inverse_freedom=0.0)
    for column in range(2):
        gyro = np.eye(2)[column] * step
        high, low = (
            odometry_factors(stepped(state, np.zeros((COUNT, 4)), sign * gyro), visits, noise, NOTHING_OPEN).residual
            for sign in (1.0, -1.0)
        )
        np.testing.assert_allclose(
            (high - low) / (2 * step),
            odometry_factors(state, visits, noise, NOTHING_OPEN).gyro[:, :, column],
            atol=1e-4,
        )


def test_the_optimum_is_gtsams(problem):
    """The same problem in GTSAM, with residuals written anew and differentiated numerically by it."""
    visits, edges, targets, state = problem
    noise = Noise()
    ours = state
    for _ in range(60):
        ours, _ = gauss_newton_step(ours, visits, edges, targets, noise, NOTHING_OPEN, tolerance=1e-10)
    theirs = _gtsam_optimum(visits, edges, targets, state, noise, np.exp(ours.log_scale))
    np.testing.assert_allclose(ours.poses[:, :2], theirs.poses[:, :2], atol=2e-3)
    np.testing.assert_allclose(ours.poses[:, 2], theirs.poses[:, 2], atol=2e-4)
    np.testing.assert_allclose(ours.log_scale, theirs.log_scale, atol=1e-3)
    np.testing.assert_allclose(ours.gyro, theirs.gyro, atol=1e-4)


def _gtsam_optimum(visits, edges, targets, state, noise, scale):
    """``scale`` (S,): at which lengths are taken for the sigmas, which ours also holds fixed within a step."""
    graph, values, gyro = gtsam.NonlinearFactorGraph(), gtsam.Values(), 10_000
    for i in range(COUNT):
        values.insert(i, np.array([*state.poses[i], state.log_scale[i]]))
    values.insert(gyro, np.zeros(2))
    lengths = np.hypot(*(visits.motion[1:, :2]).T)

    def turned_back(pose, vector):
        c, s = np.cos(pose[2]), np.sin(pose[2])
        return np.array([c * vector[0] + s * vector[1], c * vector[1] - s * vector[0]])

    def step_error(i):
        def error(a, b, g):
            metres = np.exp(a[3]) * visits.motion[i + 1, :2]
            place = turned_back(a, b[:2] - a[:2]) - metres
            turn = b[2] - a[2] - (1.0 + g[0]) * visits.motion[i + 1, 2] - g[1] * (visits.t_s[i + 1] - visits.t_s[i])
            root = np.sqrt(max(scale[i] * lengths[i], 0.1))
            return np.array([*place, turn]) / (root * np.array([noise.along, noise.across, noise.heading]))

        return error

    def scale_error(i):
        sigma = noise.log_scale * np.sqrt(max(scale[i] * lengths[i], 0.1))
        return lambda a, b: np.array([b[3] - a[3]]) / sigma * np.sqrt(1.0 + noise.scale_inverse_freedom)

    def road_error(i, component):
        tangent = np.array([np.cos(targets.heading_rad[i]), np.sin(targets.heading_rad[i])])
        lateral = np.sqrt(noise.lateral_m**2 + targets.added_lateral_m[i] ** 2 + (2.0 * targets.curvature_1pm[i]) ** 2)
        heading = np.hypot(noise.lane_heading_rad, targets.curvature_1pm[i])

        def error(a):
            off = a[:2] - targets.points_m[i]
            if component == 0:
                return np.array([tangent[0] * off[1] - tangent[1] * off[0]]) / lateral * np.sqrt(1.0 + noise.road_inverse_freedom)
            if component == 1:
                return np.array([a[2] - targets.heading_rad[i]]) / heading * np.sqrt(1.0 + noise.road_inverse_freedom)
            return np.array([tangent @ off]) / targets.along_sigma_m

        return error

    def closure_error(e):
        def error(a, b):
            metres = np.exp(a[3]) * edges.motion[e, :2]
            sigma = edges.sigma[e] * np.array([scale[edges.source[e]], scale[edges.source[e]], 1.0])
            turn = np.angle(np.exp(1j * (b[2] - a[2] - edges.motion[e, 2])))
            return np.array([*(turned_back(a, b[:2] - a[:2]) - metres), turn]) / sigma

        return error

    def add(keys, error, dimension, robust=None):
        def factor(this, values, jacobians):
            at = [values.atVector(k) for k in this.keys()]  # noqa: SIM118  (a factor, not a dict)
            if jacobians is not None:
                for n, x in enumerate(at):
                    columns = []
                    for axis in range(len(x)):
                        step = 1e-6 * np.eye(len(x))[axis]
                        moved_at = [[*at[:n], x + sign * step, *at[n + 1 :]] for sign in (1.0, -1.0)]
                        columns.append((error(*moved_at[0]) - error(*moved_at[1])) / 2e-6)
                    jacobians[n] = np.asfortranarray(np.stack(columns, axis=1))
            return error(*at)

        model = gtsam.noiseModel.Unit.Create(dimension)
        model = gtsam.noiseModel.Robust.Create(robust, model) if robust is not None else model
        graph.add(gtsam.CustomFactor(model, keys, factor))

    def student(tail):
        """GTSAM's Cauchy loss of sqrt(1 + tail) r is the Student-t's of r."""
        return gtsam.noiseModel.mEstimator.Cauchy.Create(np.sqrt((1.0 + tail) / tail))

    for i in range(COUNT - 1):
        add([i, i + 1, gyro], step_error(i), 3)
        add([i, i + 1], scale_error(i), 1, student(noise.scale_inverse_freedom))
    for i in range(COUNT):
        for component in range(3):
            add([i], road_error(i, component), 1, student(noise.road_inverse_freedom) if component < 2 else None)
    for e in range(len(edges.source)):
        add(
            [int(edges.source[e]), int(edges.target[e])],
            closure_error(e),
            3,
            gtsam.noiseModel.mEstimator.GemanMcClure.Create(GEMAN_MCCLURE),
        )
    prior = gtsam.noiseModel.Diagonal.Sigmas(np.array([GAIN_SIGMA, BIAS_SIGMA_RADPS]))
    graph.add(gtsam.PriorFactorVector(gyro, np.zeros(2), prior))
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(1e-12)
    parameters.setAbsoluteErrorTol(1e-12)
    found = gtsam.LevenbergMarquardtOptimizer(graph, values, parameters).optimize()
    unknowns = np.array([found.atVector(i) for i in range(COUNT)])
    return State(unknowns[:, :3], unknowns[:, 3], found.atVector(gyro))


def test_the_gradient_vanishes_at_the_optimum(problem):
    visits, edges, targets, state = problem
    noise = Noise()
    for _ in range(60):
        state, _ = gauss_newton_step(state, visits, edges, targets, noise, NOTHING_OPEN, tolerance=1e-10)
    system = normal_equations(state, all_factors(state, visits, edges, targets, noise, NOTHING_OPEN), edges)
    assert np.abs(system.rhs).max() < 1e-2 * np.sqrt(np.diagonal(system.diagonal, axis1=1, axis2=2)).max()
