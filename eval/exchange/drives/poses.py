"""Planar poses as the formats of the field want them: quaternions, matrices, nanoseconds; and back to the plane."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from hippodrome.core.types import FloatArray

Axes: TypeAlias = Literal["body", "camera"]  # body: x forward, y left, z up; camera: x right, y down, z forward
Nanoseconds: TypeAlias = NDArray[np.int64]


def quaternions(poses: FloatArray) -> FloatArray:
    """Quaternions (N, 4), x y z w, of planar poses (N, 3)."""
    half = poses[:, 2] / 2.0
    zeros = np.zeros(len(poses))
    return np.column_stack([zeros, zeros, np.sin(half), np.cos(half)])


def matrices(poses: FloatArray) -> FloatArray:
    """Homogeneous matrices (N, 4, 4) of planar poses (N, 3), at z = 0."""
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    found = np.tile(np.eye(4), (len(poses), 1, 1))
    found[:, 0, 0], found[:, 0, 1], found[:, 1, 0], found[:, 1, 1] = cos, -sin, sin, cos
    found[:, :2, 3] = poses[:, :2]
    return found


def nanoseconds(t_s: FloatArray) -> Nanoseconds:
    """Whole nanoseconds (N,), the clock of EuRoC, ROS and MCAP."""
    return np.round(t_s * 1e9).astype(np.int64)


def rotations(quaternions_xyzw: FloatArray) -> FloatArray:
    """Rotation matrices (N, 3, 3) of quaternions (N, 4), x y z w, of any norm but zero."""
    found: FloatArray = Rotation.from_quat(quaternions_xyzw).as_matrix()
    return found


def planar(positions: FloatArray, rotation: FloatArray, axes: Axes, world: Axes = "body") -> FloatArray:
    """Poses (N, 3) on the ground; height, roll and pitch are dropped.

    Args:
        positions: Positions (N, 3).
        rotation: Attitudes (N, 3, 3), from the moving frame to the world's.
        axes: Axes of the moving frame.
        world: Axes of the world: "body" has z up; "camera" is KITTI's, with y down.
    """
    forward = rotation[:, :, 0 if axes == "body" else 2]
    east, north = (positions[:, 0], positions[:, 1]) if world == "body" else (positions[:, 2], -positions[:, 0])
    ahead, left = (forward[:, 0], forward[:, 1]) if world == "body" else (forward[:, 2], -forward[:, 0])
    return np.column_stack([east, north, np.arctan2(left, ahead)])
