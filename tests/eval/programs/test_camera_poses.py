"""Camera poses in space as poses of the rear axle in the plane."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hippodrome.core import se2
from hippodrome.core.types import HippodromeError
from hippodrome.eval.programs.camera_poses import body_poses, read_camera_tum


def test_body_poses_by_hand():
    """The camera turns left by 90 deg while it moves 5 m ahead and 2 m to the left; y of the camera points down."""
    half = np.sqrt(0.5)
    turned = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, -half, 0.0, half]])
    assert_allclose(body_poses(np.array([[0.0, 0, 0], [-2.0, 0, 5.0]]), turned, 0.0), [[0, 0, 0], [5, 2, np.pi / 2]], atol=1e-12)


def test_the_body_is_behind_the_camera():
    rng = np.random.default_rng(0)
    body = np.column_stack([rng.normal(size=(20, 2)), rng.uniform(-3, 3, 20)])
    camera = se2.compose(body, np.array([1.6, 0.0, 0.0]))
    positions = np.column_stack([-camera[:, 1], np.zeros(20), camera[:, 0]])
    quaternions = np.column_stack([np.zeros(20), -np.sin(camera[:, 2] / 2), np.zeros(20), np.cos(camera[:, 2] / 2)])
    assert_allclose(body_poses(positions, quaternions, 1.6), body, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no poses; a line for each is expected"),
        ("# t\n", "no poses"),
        ("0 1 2\n", "line 1: 3 columns, expected 8"),
        ("0 0 0 0 0 0 0 1\n1 2\n", "line 2: 2 columns, expected 8"),
        ("0,0,0,0,0,0,0,1\n", "line 1: 1 columns, expected 8 .*; write spaces in place of commas"),
        ("zero 0 0 0 0 0 0 1\n", "line 1: 'zero' is no number"),
        ("0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 nan\n", "sample 1 is not finite"),
    ],
)
def test_a_broken_trajectory_is_refused(tmp_path, text, words):
    path = tmp_path / "live.tum"
    path.write_text(text)
    with pytest.raises(HippodromeError, match=rf"live\.tum: .*{words}|live\.tum: {words}"):
        read_camera_tum(path, 1.6)


def test_comments_are_passed_over(tmp_path):
    (tmp_path / "live.tum").write_text("# t x y z qx qy qz qw\n0.1 0 0 0 0 0 0 1\n  # lost\n0.2 0 0 1 0 0 0 1\n")
    assert_allclose(read_camera_tum(tmp_path / "live.tum", 0.0).t_s, [0.1, 0.2])


def test_lines_repeated_for_lost_frames_are_dropped(tmp_path):
    path = tmp_path / "final.tum"
    path.write_text("0.1 0 0 0 0 0 0 1\n0.2 0 0 1 0 0 0 1\n0.2 0 0 1 0 0 0 1\n0.4 0 0 3 0 0 0 1\n")
    assert_allclose(read_camera_tum(path, 0.0).t_s, [0.1, 0.2, 0.4])
