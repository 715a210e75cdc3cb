"""Visual odometry in a room of smooth textures that is ray-cast by hand."""

import numpy as np
import pytest

from hippodrome.core import se2
from hippodrome.core.types import Observation
from hippodrome.core.views.config import CameraGeometry
from hippodrome.core.views.odometry import VisualOdometry

CAMERA = CameraGeometry()
ROWS, COLUMNS, ROOM_M, HIGH_M = 120, 160, 40.0, 12.0
WAVES = np.random.default_rng(5).normal(0.0, 1.0, (14, 2)) * np.geomspace(0.4, 4.0, 14)[:, None]
PHASES = np.random.default_rng(6).uniform(0.0, 2.0 * np.pi, 14)


def texture(a_m, b_m):
    """Grey levels of a plane: waves of 1.5 to 15 m."""
    return 128.0 + 20.0 * np.cos(a_m[..., None] * WAVES[:, 0] + b_m[..., None] * WAVES[:, 1] + PHASES).sum(axis=-1)


def frame(pose, noise=0.0, rng=None):
    """What the camera sees from the body pose (3,): ground, four walls at +-40 m and a plain sky."""
    x_m, y_m = pose[:2] + CAMERA.forward_m * np.array([np.cos(pose[2]), np.sin(pose[2])])
    focal = 0.5 * COLUMNS / np.tan(0.5 * np.radians(CAMERA.fov_deg))
    left = (0.5 * (COLUMNS - 1) - np.arange(COLUMNS)) / focal
    up = ((0.5 * (ROWS - 1) - np.arange(ROWS)) / focal)[:, None]
    east, north = np.cos(pose[2]) - np.sin(pose[2]) * left, np.sin(pose[2]) + np.cos(pose[2]) * left
    to_wall = np.minimum((np.sign(east) * ROOM_M - x_m) / east, (np.sign(north) * ROOM_M - y_m) / north)[None]
    depth = np.where(up < 0.0, np.minimum(CAMERA.height_m / np.maximum(-up, 1e-9), to_wall), to_wall)
    point_x, point_y, height = x_m + depth * east, y_m + depth * north, CAMERA.height_m + depth * up
    wall = texture(point_x + point_y, 3.0 * height)
    seen = np.where(depth < to_wall, texture(point_x, point_y), np.where(height < HIGH_M, wall, 200.0))
    seen = seen + (0.0 if rng is None else noise * rng.standard_normal(seen.shape))
    return np.clip(seen, 0, 255).astype(np.uint8)


def driven(steps, noise=0.0):
    """True motions (N, 2) and those told, at 10 Hz with a frame for every second step."""
    rng, odometry, pose, told = np.random.default_rng(1), VisualOdometry(CAMERA), np.zeros(3), []
    for k, (step_m, turn_rad) in enumerate(steps):
        half = 0.5 * turn_rad
        pose = se2.compose(pose, np.array([step_m * np.cos(half), step_m * np.sin(half), turn_rad]))
        seen = frame(pose, noise, rng) if k % 2 == 0 else None
        sensed = odometry.step(Observation(0.1 * (k + 1), 0.1, 99.0, 9.0, seen))  # the wheels lie
        told.append((0.1 * sensed.speed, 0.1 * sensed.yaw_rate_radps))
    return np.array(steps), np.array(told)


def test_a_straight_gives_the_distance_and_no_turn():
    true, told = driven([(0.7, 0.0)] * 41, noise=3.0)
    assert told[5:, 0].sum() == pytest.approx(true[5:, 0].sum(), rel=0.05)
    assert abs(np.degrees(told[:, 1].sum())) < 1.0


@pytest.mark.parametrize("turn_deg", [-3.0, 2.0])
def test_a_bend_is_told_to_its_side(turn_deg):
    true, told = driven([(0.6, np.radians(turn_deg))] * 31)
    assert np.degrees(told[1:, 1].sum()) == pytest.approx(np.degrees(true[1:, 1].sum()), rel=0.04)
    assert told[5:, 0].sum() == pytest.approx(true[5:, 0].sum(), rel=0.08)


def test_standing_is_no_motion_and_a_change_of_speed_is_followed():
    true, told = driven([(0.6, 0.0)] * 11 + [(0.0, 0.0)] * 10 + [(0.5, 0.0)] * 20)
    assert np.abs(told[13:20]).max() < 1e-3
    assert told[25:, 0].sum() == pytest.approx(true[25:, 0].sum(), rel=0.08)


def test_frames_correct_what_was_told_between_them():
    _, told = driven([(0.5, 0.0)] * 11 + [(0.6, 0.0)] * 10)
    assert told[11, 0] == pytest.approx(0.5, abs=0.05)  # goes on as before
    assert told[11:13, 0].sum() == pytest.approx(1.2, abs=0.1)  # and is put right by the frame


def test_a_plain_scene_keeps_the_motion_expected():
    odometry, plain = VisualOdometry(CAMERA), np.full((ROWS, COLUMNS), 90, dtype=np.uint8)
    told = [odometry.step(Observation(0.2 * (k + 1), 0.2, 0.0, 0.0, plain)) for k in range(3)]
    assert told[-1].speed == pytest.approx(5.0)
    assert told[-1].yaw_rate_radps == 0.0


def test_impossible_cameras_are_refused():
    with pytest.raises(ValueError, match="height_m"):
        CameraGeometry(height_m=0.0)
