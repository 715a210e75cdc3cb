"""Self-motion from files of poses: turned level, and refused where it contradicts itself."""

import numpy as np
import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.exchange.readers.self_motion import read_self_motion


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
