"""Self-motion carries exactly the errors that its level names."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray
from hippodrome.sim.self_motion import NOISE_LEVELS, SelfMotionNoise, sense_self_motion
from hippodrome.sim.survey import with_survey_error
from hippodrome.sim.types import Drive, TrafficLog


def circle_drive(duration_s: float = 400.0, speed_mps: float = 8.0, radius_m: float = 40.0) -> Drive:
    t_s = np.arange(0.0, duration_s + 1e-9, 0.1)
    heading = speed_mps * t_s / radius_m
    poses: FloatArray = np.stack([radius_m * np.sin(heading), radius_m * (1 - np.cos(heading)), heading], axis=1)
    nothing = TrafficLog(t_s, np.zeros(len(t_s) + 1, np.int32), np.zeros(0, np.int32), np.zeros((0, 3)), np.zeros(0, np.uint8))
    ones = np.ones(len(t_s))
    return Drive(
        t_s, poses, speed_mps * ones, speed_mps / radius_m * ones, np.zeros(len(t_s), np.int32), 0 * ones, nothing, 1.0, 0.0
    )


def straight_network(length_m: float, spacing_m: float) -> RoadNetwork:
    x = np.arange(0.0, length_m + 1e-9, spacing_m)
    none = np.array([-1], np.int32)
    return RoadNetwork(
        lane_ids=("e_0",),
        edge_ids=("e",),
        lane_edge=np.zeros(1, np.int32),
        is_internal=np.zeros(1, np.bool_),
        width_m=np.array([3.2]),
        speed_limit_mps=np.array([13.9]),
        points_m=np.stack([x, 0 * x], axis=1),
        point_start=np.array([0, len(x)], np.int32),
        successor=np.zeros(0, np.int32),
        successor_start=np.zeros(2, np.int32),
        left_lane=none,
        right_lane=none,
    )


def test_without_noise_only_the_unit_is_unknown():
    motion = sense_self_motion(circle_drive(), 10.0, SelfMotionNoise(units_per_metre_spread=0.0), np.random.default_rng(0))
    assert_allclose(motion.speed, 4.0, rtol=1e-4)
    assert_allclose(motion.yaw_rate_radps, 0.2, rtol=1e-9)
    assert len(motion.t_s) == 4000
    assert_allclose(motion.t_s[-1], 400.0)


def test_the_unit_differs_between_drives():
    units = [
        sense_self_motion(circle_drive(20), 10.0, NOISE_LEVELS["clean"], np.random.default_rng(seed)).speed[0]
        for seed in range(8)
    ]
    assert np.std(np.log(units)) > 0.05


@pytest.mark.parametrize(("level", "sigma_deg"), [("paper", 0.1), ("realistic", 0.5), ("harsh", 1.0)])
def test_heading_noise_grows_as_the_level_says(level, sigma_deg):
    quiet = NOISE_LEVELS[level].model_copy(update={"gyro_bias_degps": 0.0, "gyro_gain": 0.0})
    ends = []
    for seed in range(200):
        motion = sense_self_motion(circle_drive(50), 10.0, quiet, np.random.default_rng(seed))
        ends.append(np.sum(motion.yaw_rate_radps - 0.2) * motion.dt_s)
    assert_allclose(np.std(np.rad2deg(ends)), sigma_deg * np.sqrt(50.0), rtol=0.2)


def test_same_seed_same_bytes():
    first, second = (
        sense_self_motion(circle_drive(), 11.2, NOISE_LEVELS["harsh"], np.random.default_rng(3)).speed for _ in range(2)
    )
    assert first.tobytes() == second.tobytes()


def test_survey_error_is_smooth_and_of_the_stated_size():
    network = straight_network(length_m=20000.0, spacing_m=5.0)
    moved = with_survey_error(network, 0.5, np.random.default_rng(1)).points_m - network.points_m
    assert_allclose(moved.std(), 0.5, rtol=0.25)
    assert np.abs(np.diff(moved, axis=0)).max() < 0.3
    assert with_survey_error(network, 0.0, np.random.default_rng(1)) is network
