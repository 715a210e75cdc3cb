"""From the tracker's camera poses in space to body poses in the plane, and samples as far apart as a map's vertices."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hippodrome.core import se2
from hippodrome.core.types import FloatArray, HippodromeError, Trajectory
from hippodrome.eval.metrics.association import check_trajectory

COLUMNS = 8


def read_camera_tum(path: Path, forward_m: float) -> Trajectory:
    """Body poses from a TUM file of camera poses; the camera sits ``forward_m`` ahead of the body and looks ahead.

    For frames that it lost, the tracker writes the line before once more, old time stamp included: such lines are dropped.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        table = np.array([[float(word) for word in line.split()] for line in lines if line.strip()], dtype=np.float64)
    except (OSError, ValueError) as error:
        raise HippodromeError(f"{path}: not a trajectory: {error}") from None
    if table.ndim != 2 or table.shape[1] != COLUMNS:
        raise HippodromeError(f"{path}: no poses, or not {COLUMNS} columns a line (t x y z qx qy qz qw)")
    table = table[np.concatenate([[True], np.diff(table[:, 0]) > 0.0])]
    body = body_poses(table[:, 1:4], table[:, 4:8], forward_m)
    trajectory = Trajectory(table[:, 0], body)
    check_trajectory(trajectory, str(path))
    return trajectory


def body_poses(positions_m: FloatArray, quaternions: FloatArray, forward_m: float) -> FloatArray:
    """Planar poses (N, 3) of the body, of camera positions (N, 3) and orientations (N, 4) in x, y, z, w order.

    The tracker's world is its first camera: x to the right, y down, z ahead. Its plane is ours: x ahead, y to the left.
    """
    x, y, z, w = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    ahead, right = 1.0 - 2.0 * (x * x + y * y), 2.0 * (x * z + w * y)  # the viewing direction: third column of the rotation
    camera = np.column_stack([positions_m[:, 2], -positions_m[:, 0], np.arctan2(-right, ahead)])
    return se2.compose(camera, np.array([-forward_m, 0.0, 0.0]))


def thinned(trajectory: Trajectory, spacing_m: float) -> Trajectory:
    """The samples at which another ``spacing_m`` has been travelled, the first included."""
    steps = np.hypot(*np.diff(trajectory.poses[:, :2], axis=0).T)
    stretch = np.floor(np.concatenate([[0.0], np.cumsum(steps)]) / spacing_m)
    kept = np.concatenate([[True], np.diff(stretch) > 0])
    return Trajectory(trajectory.t_s[kept], trajectory.poses[kept])
