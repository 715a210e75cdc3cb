"""Self-motion from the frames of cameras of many kinds, in a street that is ray-cast by hand."""

import numpy as np
import pytest

from hippodrome.core import se2
from hippodrome.core.types import Observation
from hippodrome.core.views.config import CameraGeometry
from hippodrome.core.views.egomotion import focal
from hippodrome.core.views.egomotion.camera import RoadCamera, working_image, working_matrix
from hippodrome.core.views.egomotion.odometry import RoadOdometry
from hippodrome.core.views.egomotion.static import StaticMap
from hippodrome.core.views.odometry import VisualOdometry
from tests.core.views.egomotion.street import Camera, picture

LOW_AND_WIDE = Camera()  # the shape of a camera that looks over the road next to the vehicle
TALL = Camera(columns=320, rows=240, focal_px=200.0, height_m=1.3)


def poses_of(steps):
    pose = np.zeros(3)
    found = [pose]
    for step_m, turn_rad in steps:
        pose = se2.compose(pose, np.array([step_m * np.cos(0.5 * turn_rad), step_m * np.sin(0.5 * turn_rad), turn_rad]))
        found.append(pose)
    return found


def told(camera, steps, dt_s=0.1, odometry=None, **looks):
    """Motions (N, 2) that the frames tell for each of the steps."""
    odometry = odometry or RoadOdometry(RoadCamera(camera.matrix, camera.height_m, camera.forward_m))
    found = []
    for number, pose in enumerate(poses_of(steps)):
        seen = odometry.step(Observation(dt_s * (number + 1), dt_s, 99.0, 9.0, picture(camera, pose, **looks)))
        found.append((seen.speed * dt_s, seen.yaw_rate_radps * dt_s))
    return np.array(found[1:])


def test_a_camera_that_sees_no_road_close_by_tells_the_way_nevertheless():
    found = told(LOW_AND_WIDE, [(0.8, 0.0)] * 30)
    assert found[:, 0].sum() == pytest.approx(24.0, rel=0.06)
    assert abs(np.degrees(found[:, 1].sum())) < 2.5


def test_the_horizon_of_a_pitched_camera_is_learned():
    camera = Camera(pitch_rad=np.radians(4.0))
    odometry = RoadOdometry(RoadCamera(camera.matrix, camera.height_m))
    found = told(camera, [(0.8, 0.0)] * 45, odometry=odometry)
    known, _ = odometry.learned()
    assert known.heading[1] == pytest.approx(np.tan(np.radians(4.0)), abs=0.015)
    assert found[25:, 0].sum() == pytest.approx(16.0, rel=0.1)


def test_a_bonnet_tells_nothing():
    odometry = RoadOdometry(RoadCamera(TALL.matrix, TALL.height_m))
    found = told(TALL, [(0.6, 0.0)] * 30, odometry=odometry, bonnet_px=40)
    assert found[10:, 0].sum() == pytest.approx(12.0, rel=0.1)
    _, static = odometry.learned()
    assert (static.mask[-36:] > 0).mean() > 0.9
    assert (static.mask[:-50] > 0).mean() < 0.2  # the far end of the street hardly moves, either


def test_bends_are_told_to_their_sides():
    steps = [(0.6, 0.03 * np.sin(number / 6.0)) for number in range(38)]
    found, true = told(TALL, steps), np.array(steps)
    assert np.abs(found[:, 1] - true[:, 1]).max() < np.radians(0.3)
    assert np.abs(found[:, 1]).sum() == pytest.approx(np.abs(true[:, 1]).sum(), rel=0.06)


def test_standing_is_no_motion_and_creeping_is_one():
    found = told(TALL, [(0.5, 0.0)] * 10 + [(0.0, 0.0)] * 10 + [(0.01, 0.0)] * 40, dt_s=0.05)
    assert np.abs(found[12:20]).max() == 0.0
    assert found[20:, 0].sum() == pytest.approx(0.4, abs=0.1)


def test_steps_without_a_frame_are_put_right_by_the_next_one():
    odometry, sums = RoadOdometry(RoadCamera(TALL.matrix, TALL.height_m)), []
    for number, pose in enumerate(poses_of([(0.3, 0.0)] * 40)):
        frame = picture(TALL, pose) if number % 2 == 0 else None
        sums.append(odometry.step(Observation(0.05 * (number + 1), 0.05, 0.0, 0.0, frame)).speed * 0.05)
    assert sum(sums[1:]) == pytest.approx(12.0, rel=0.08)
    assert np.abs(np.array(sums[20:]) - 0.3).max() < 0.1


def test_a_plain_scene_keeps_the_last_motion_and_another_size_starts_afresh():
    odometry = RoadOdometry(RoadCamera(TALL.matrix, TALL.height_m))
    told(TALL, [(0.5, 0.0)] * 10, odometry=odometry)
    plain = np.full((TALL.rows, TALL.columns), 90, np.uint8)
    assert odometry.step(Observation(9.0, 0.1, 0.0, 0.0, plain)).speed == pytest.approx(5.0, rel=0.15)
    assert np.isfinite(odometry.step(Observation(9.1, 0.1, 0.0, 0.0, plain[:100, :120])).speed)


def test_large_colour_frames_are_made_smaller_about_the_same_rays():
    frame = np.zeros((720, 1280, 3), np.uint8)
    assert working_image(frame).shape == (360, 640)
    matrix = working_matrix(np.array([[800.0, 0.0, 639.5], [0.0, 800.0, 359.5], [0.0, 0.0, 1.0]]), 1280)
    assert matrix[:2] == pytest.approx(np.array([[400.0, 0.0, 319.5], [0.0, 400.0, 179.5]]))


def test_the_focal_length_is_told_by_turns_and_by_nothing_else():
    poses = poses_of([(0.3, 0.04)] * 24)
    frames = [picture(TALL, pose) for pose in poses]
    pairs = [focal.corner_pair(*frames[number : number + 2]) for number in range(24)]
    found = focal.focal_px(pairs, (TALL.columns, TALL.rows))
    assert found is None or found == pytest.approx(TALL.focal_px, rel=0.15)
    assert focal.focal_px(pairs[:5], (TALL.columns, TALL.rows)) is None
    plain = np.full((64, 64), 90, np.uint8)
    assert focal.focal_px([focal.corner_pair(plain, plain)] * 30, (64, 64)) is None


def test_nothing_stands_before_enough_was_seen():
    noise = np.random.default_rng(0).integers(0, 255, (60, 80)).astype(np.uint8)
    static = StaticMap(noise)
    static.learn(noise, noise)
    assert not static.mask.any()
    for _ in range(5):
        static.learn(noise, noise)
    assert static.mask.all()


def test_a_scenario_s_camera_that_does_not_see_the_road_right_ahead_is_taken_over():
    geometry = CameraGeometry(fov_deg=81.5, height_m=1.65)
    assert CameraGeometry().sees_road_ahead(160, 120)
    assert not geometry.sees_road_ahead(414, 125)
    found = told(LOW_AND_WIDE, [(0.8, 0.0)] * 20, odometry=VisualOdometry(geometry))
    assert found[5:, 0].sum() == pytest.approx(12.0, rel=0.06)
