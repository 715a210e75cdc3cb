"""From the camera poses in space that visual SLAM leaves to body poses in the plane."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hippodrome.core import se2
from hippodrome.core.types import FloatArray, HippodromeError, Trajectory
from hippodrome.eval.files.number_words import with_commas
from hippodrome.eval.files.rows import row_of_numbers
from hippodrome.eval.files.trajectories import read_lines
from hippodrome.eval.metrics.association import check_trajectory

COLUMNS = 8  # t x y z qx qy qz qw


def read_camera_tum(path: Path, forward_m: float) -> Trajectory:
    """Body poses in the plane from a TUM file of camera poses in space.

    For a frame in which they lost tracking, some trackers repeat the line before with its old time stamp: it is dropped.

    Args:
        path: The file.
        forward_m: How far ahead of the body the camera sits; it looks straight ahead.

    Raises:
        HippodromeError: The file is no trajectory.
    """
    rows = [(number, line.split()) for number, line in enumerate(read_lines(path), start=1) if line.strip()]
    rows = [(number, words) for number, words in rows if not words[0].startswith("#")]
    if not rows:
        raise HippodromeError(f"{path}: no poses; a line for each is expected, t x y z qx qy qz qw")
    for number, words in rows:
        if len(words) != COLUMNS:
            cure = with_commas(" ".join(words), COLUMNS)
            raise HippodromeError(f"{path}: line {number}: {len(words)} columns, expected {COLUMNS} (t x y z qx qy qz qw){cure}")
    table = np.array([row_of_numbers(path, number, words, COLUMNS) for number, words in rows], dtype=np.float64)
    table = table[np.concatenate([[True], np.diff(table[:, 0]) > 0.0])]
    body = body_poses(table[:, 1:4], table[:, 4:8], forward_m)
    trajectory = Trajectory(table[:, 0], body)
    check_trajectory(trajectory, str(path))
    return trajectory


def body_poses(positions_m: FloatArray, quaternions: FloatArray, forward_m: float) -> FloatArray:
    """Planar poses (N, 3) of the body.

    The world is the frame of the first camera: x to the right, y down, z ahead. The plane has x ahead, y to the left.

    Args:
        positions_m: Positions (N, 3) of the camera.
        quaternions: Orientations (N, 4) of the camera, in the order x, y, z, w.
        forward_m: How far ahead of the body the camera sits.
    """
    x, y, z, w = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    ahead, right = 1.0 - 2.0 * (x * x + y * y), 2.0 * (x * z + w * y)  # the viewing direction: third column of the rotation
    camera = np.column_stack([positions_m[:, 2], -positions_m[:, 0], np.arctan2(-right, ahead)])
    return se2.compose(camera, np.array([-forward_m, 0.0, 0.0]))
