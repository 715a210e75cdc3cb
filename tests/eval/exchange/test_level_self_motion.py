"""Self-motion from files of poses: turned level, and refused where it contradicts itself."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hippodrome.core.types import HippodromeError
from hippodrome.eval.exchange.drives.foreign import level_trajectory
from hippodrome.eval.exchange.readers.self_motion import read_self_motion
from hippodrome.eval.exchange.readers.tables import kitti_poses, read_tum_poses


def test_poses_of_a_camera_are_turned_level_before_they_are_differentiated(tmp_path):
    """A camera's poses in the frame of its first one: x right, y down, z forward; a circle to the left at 5 m/s and 0.3 rad/s."""
    t_s = 0.1 * np.arange(100)
    turned = 0.3 * t_s
    x, z = -5.0 / 0.3 * (1.0 - np.cos(turned)), 5.0 / 0.3 * np.sin(turned)
    zero = np.zeros(len(t_s))
    rows = np.column_stack([t_s, x, zero, z, zero, -np.sin(turned / 2.0), zero, np.cos(turned / 2.0)])
    np.savetxt(tmp_path / "cam.tum", rows, fmt="%.12g")
    motion, _ = read_self_motion(tmp_path / "cam.tum", "camera", None, None)
    assert motion.speed[1:] == pytest.approx(5.0, abs=0.01)
    assert motion.yaw_rate_radps[1:] == pytest.approx(0.3, abs=1e-6)
    with pytest.raises(HippodromeError, match="camera"):
        read_self_motion(tmp_path / "cam.tum", "body", None, None)
    wxyz = np.column_stack([rows[:, :4], rows[:, 7], rows[:, 4:7]])
    np.savetxt(tmp_path / "wxyz.tum", wxyz, fmt="%.12g")
    with pytest.raises(HippodromeError):
        read_self_motion(tmp_path / "wxyz.tum", "camera", None, None)


def pitched_drive():
    """Poses of a vehicle whose world is that of a camera pitched by 10 degrees, and the same in the plane."""
    t_s = 0.1 * np.arange(300)
    turned = 0.4 * np.sin(0.2 * t_s).cumsum() * 0.1
    xy = np.cumsum(0.5 * np.column_stack([np.cos(turned), np.sin(turned)]), axis=0)
    tilt = Rotation.from_euler("y", 10.0, degrees=True)
    positions = tilt.apply(np.column_stack([xy, np.zeros(len(xy))]))
    return t_s, xy, positions, (tilt * Rotation.from_euler("z", turned[:, None]))


def test_the_truth_that_a_layout_has_is_turned_level(tmp_path):
    t_s, xy, positions, attitudes = pitched_drive()
    found = [level_trajectory(t_s, positions, attitudes.as_matrix(), "body", "layout")]
    tum = np.column_stack([t_s, positions, attitudes.as_quat()])
    np.savetxt(tmp_path / "groundtruth.txt", np.repeat(tum, [1, 2] + [1] * 298, axis=0), fmt="%.12g")  # one row twice
    found.append(read_tum_poses(tmp_path / "groundtruth.txt", "body"))
    optical = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    rotation = optical.T @ attitudes.as_matrix() @ optical
    rows = np.concatenate([rotation, (positions @ optical)[:, :, None]], axis=2).reshape(-1, 12)
    np.savetxt(tmp_path / "kitti.txt", rows, fmt="%.12g")
    found.append(kitti_poses(tmp_path / "kitti.txt", t_s, None, "camera"))
    for one in found:
        lengths = np.linalg.norm(one.poses[:, :2] - one.poses[0, :2], axis=1)
        assert lengths == pytest.approx(np.linalg.norm(xy - xy[0], axis=1), abs=1e-6)


def test_an_attitude_that_is_no_rotation_is_refused():
    t_s, _, positions, attitudes = pitched_drive()
    for broken in (np.zeros((3, 3)), np.diag([1.0, 1.0, -1.0]), np.full((3, 3), 1e300)):
        rotations = attitudes.as_matrix()
        rotations[7] = broken
        with pytest.raises(HippodromeError, match="sample 7: its attitude"):
            level_trajectory(t_s, positions, rotations, "body", "layout")
    positions[5, 0] = 1e300
    with pytest.raises(HippodromeError, match="sample 5: a position"):
        level_trajectory(t_s, positions, attitudes.as_matrix(), "body", "layout")
