import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.se2 import wrap
from hippodrome.sim.ego import LIMIT_LATERAL_MPS2, MAX_STEERING_RAD, EgoCar, follow, wander_m
from hippodrome.sim.ego_spec import EgoSpec
from hippodrome.sim.ego_speed import comfortable_speed_mps
from hippodrome.sim.path import MAX_CURVATURE_1PM, STEP_M, Path, Piece, sample_count, smooth_path


def network_of(*lines, right=None):
    """Unconnected lanes along the given polylines; ``right`` lists each lane's neighbour."""
    lines = [np.array(line, dtype=float) for line in lines]
    count = len(lines)
    return RoadNetwork(
        lane_ids=tuple(f"l{i}" for i in range(count)),
        edge_ids=("e",),
        lane_edge=np.zeros(count, np.int32),
        is_internal=np.zeros(count, bool),
        width_m=np.full(count, 3.2),
        speed_limit_mps=np.full(count, 20.0),
        points_m=np.concatenate(lines),
        point_start=np.cumsum([0, *map(len, lines)]).astype(np.int32),
        successor=np.empty(0, np.int32),
        successor_start=np.zeros(count + 1, np.int32),
        left_lane=np.full(count, -1, np.int32),
        right_lane=np.full(count, -1, np.int32),
    )


def path_of(*lines):
    network = network_of(*lines)
    pieces = [Piece(i, 0.0, float(length), False, 5.0) for i, length in enumerate(network.lane_lengths_m())]
    return smooth_path(network, pieces)


def circle(radius, turns=1.0, points=400):
    angle = np.linspace(0.0, 2 * np.pi * turns, points)
    return np.stack([radius * np.sin(angle), radius * (1.0 - np.cos(angle))], axis=1)


def test_rear_axle_of_the_bicycle_moves_along_its_heading():
    """No side slip at the rear axle, and yaw rate v tan(delta) / wheelbase: what the textbook's bicycle does."""
    car = EgoCar(None, (0.0, 0.0), 0.3, 4.0)
    steering, dt = 0.4, 1e-4
    before = np.array(car.rear_axle_m)
    car.act({"steering": steering, "acceleration": 0.0})
    car.step(dt)
    moved = (np.array(car.rear_axle_m) - before) / dt
    speed = np.hypot(*moved)
    assert np.arctan2(moved[1], moved[0]) == pytest.approx(0.3, abs=1e-3)
    assert (car.heading - 0.3) / dt == pytest.approx(speed * np.tan(steering) / 2.7, rel=1e-3)


@pytest.mark.parametrize("radius", [8.0, 20.0, 60.0])
def test_path_on_a_circle_has_its_curvature(radius):
    path = path_of(circle(radius))
    inner = slice(40, -40)
    np.testing.assert_allclose(path.curvature_1pm[inner], 1.0 / radius, rtol=0.06)
    offset = np.linalg.norm(path.points_m - [0.0, radius], axis=1) - radius
    assert np.abs(offset[inner]).max() < 0.25


def test_comfortable_speed_by_hand():
    n = 400
    curvature = np.zeros(n)
    curvature[300:] = 0.1
    path = Path(np.zeros((n, 2)), np.zeros(n), curvature, np.ones(n))
    speed = comfortable_speed_mps(path, np.full(n, 12.0), EgoSpec(lateral_accel_mps2=2.5, decel_mps2=2.0))
    assert speed[0] == pytest.approx(12.0)  # 75 m before the bend: 5^2 + 4 * 75 > 12^2
    assert speed[350] == pytest.approx(5.0)  # sqrt(2.5 / 0.1)
    assert speed[260] == pytest.approx(np.sqrt(25.0 + 4.0 * 40 * STEP_M))


@settings(max_examples=12, deadline=None)
@given(turn_deg=st.floats(-150.0, 150.0), seed=st.integers(0, 99))
def test_car_keeps_its_turning_circle_and_limits_at_any_corner(turn_deg, seed):
    turn = np.deg2rad(turn_deg)
    end = np.array([60.0, 0.0]) + 60.0 * np.array([np.cos(turn), np.sin(turn)])
    path = path_of([[0.0, 0.0], [60.0, 0.0], end])
    assert np.abs(path.curvature_1pm).max() <= MAX_CURVATURE_1PM + 1e-9
    limit = np.random.default_rng(seed).uniform(4.0, 14.0)
    cap = comfortable_speed_mps(path, np.full(len(path.stretch), limit), EgoSpec())
    u, speed = [2.0], limit
    while u[-1] < 110.0:
        speed = min(cap[int(u[-1] / STEP_M)], speed + 0.05 * 1.8)
        u.append(u[-1] + 0.05 * speed)
    track = follow(path, np.array(u), 0.05)
    turned, moved = np.diff(track.poses_m[:, 2]), np.linalg.norm(np.diff(track.poses_m[:, :2], axis=0), axis=1)
    assert np.abs(turned).max() <= (np.tan(MAX_STEERING_RAD) / 2.7) * moved[np.argmax(np.abs(turned))] * 1.05
    yaw_rate = turned / 0.05
    assert np.abs(yaw_rate).max() < 0.9
    assert np.abs(yaw_rate * track.speed_mps[1:]).max() < LIMIT_LATERAL_MPS2 + 0.3
    assert np.abs(track.u_m - u).max() < 1.5  # 0.3 m on real junctions; a hairpin without width costs more
    assert wrap(track.poses_m[-1, 2] - path.heading_rad[-1]) == pytest.approx(0.0, abs=0.05)


def test_self_crossing_path_is_followed_without_jumping_to_the_other_pass():
    angle = np.linspace(0.0, 4 * np.pi, 900)
    eight = np.stack([40.0 * np.sin(angle), 25.0 * np.sin(2 * angle)], axis=1)
    path = path_of(eight)
    goal = np.arange(0.0, 0.99 * STEP_M * len(path.points_m), 0.2)
    track = follow(path, goal, 0.05)
    reference = np.stack([np.interp(goal, STEP_M * np.arange(len(path.points_m)), axis) for axis in path.points_m.T], axis=1)
    assert np.linalg.norm(track.poses_m[:, :2] - reference, axis=1).max() < 1.0


def test_progress_never_goes_backwards_and_standing_still_is_still():
    path = path_of([[0.0, 0.0], [200.0, 0.0]])
    goal = np.concatenate([np.linspace(1.0, 31.0, 120), np.full(100, 31.0), np.linspace(31.0, 61.0, 120)])
    track = follow(path, goal, 0.05)
    assert np.diff(track.u_m).min() >= 0.0
    assert np.diff(track.poses_m[:, 0]).min() >= 0.0
    assert np.abs(np.diff(track.poses_m[200:215, 0])).max() < 0.01


def test_lane_change_is_spread_and_gentle():
    network = network_of([[0.0, 0.0], [300.0, 0.0]], [[0.0, 3.2], [300.0, 3.2]])
    speed = 12.0
    path = smooth_path(network, [Piece(0, 0.0, 150.0, False, speed), Piece(1, 150.0, 300.0, True, speed)])
    y = path.points_m[:, 1]
    assert y[int(120 / STEP_M)] == pytest.approx(0.0, abs=0.02) and y[int(180 / STEP_M)] == pytest.approx(3.2, abs=0.02)
    assert y[int(150 / STEP_M)] == pytest.approx(1.6, abs=0.1)
    assert np.abs(path.curvature_1pm).max() * speed**2 < 2.0


def test_wander_has_the_deviation_and_correlation_asked_for():
    drift = wander_m(400_000, 0.3, np.random.default_rng(0))
    assert drift.std() == pytest.approx(0.3, rel=0.12)
    lag = int(50.0 / STEP_M)
    assert np.corrcoef(drift[:-lag], drift[lag:])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.1)
    assert np.abs(np.diff(drift) / STEP_M).max() < 0.2  # smooth: a slope of a few degrees
    assert len(wander_m(7, 0.3, np.random.default_rng(1))) == 7


def test_sample_count_covers_the_pieces():
    pieces = [Piece(0, 2.0, 7.1, False, 1.0), Piece(1, 0.0, 3.0, False, 1.0)]
    assert (sample_count(pieces) - 1) * STEP_M >= 8.1
