"""Alignment of an estimated trajectory to a reference: functions that find a transform, and functions that apply one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np

from hippodrome.core import se2
from hippodrome.core.types import FloatArray, HippodromeError, Trajectory

AlignmentName: TypeAlias = Literal["none", "start", "se2", "sim2", "se3", "sim3"]

LABELS: Final = {  # in the definitions of scores
    "none": "none",
    "start": "start (first pose, no scale)",
    "se2": "SE(2)",
    "sim2": "Sim(2)",
    "se3": "SE(3)",
    "sim3": "Sim(3)",
}

DEGENERATE_RATIO = 1e-12  # singular values below this share of the points' spread come from rounding


class DegenerateAlignment(HippodromeError):
    """The points do not determine the transform."""


@dataclass(frozen=True, slots=True, eq=False)
class Transform:
    """``y = scale * rotation @ x + translation`` in m = 2 or 3 dimensions."""

    rotation: FloatArray  # (m, m)
    translation_m: FloatArray  # (m,)
    scale: float

    @property
    def dimension(self) -> int:
        return len(self.translation_m)


def identity() -> Transform:
    """The planar transform that changes nothing."""
    return Transform(np.eye(2), np.zeros(2), 1.0)


def start_alignment(estimate_pose: FloatArray, reference_pose: FloatArray) -> Transform:
    """The rigid transform that lays the first pose (3,) of the estimate on that of the reference."""
    x_m, y_m, turn_rad = se2.compose(reference_pose, se2.inverse(estimate_pose))
    return Transform(_rotation(turn_rad), np.array([x_m, y_m]), 1.0)


def umeyama(source: FloatArray, target: FloatArray, *, with_scale: bool) -> Transform:
    """Eqs. (34)-(43), Umeyama 1991: the least-squares rigid or similarity transform of points onto points.

    Args:
        source: Points (N, m) that are moved.
        target: Points (N, m) that they are moved to.
        with_scale: Whether the transform may scale.

    Raises:
        DegenerateAlignment: The points do not determine the transform.
    """
    count, dimension = source.shape
    source_mean, target_mean = source.mean(axis=0), target.mean(axis=0)
    source_centred, target_centred = source - source_mean, target - target_mean
    source_variance = float(np.sum(source_centred**2)) / count
    target_variance = float(np.sum(target_centred**2)) / count
    u, singular, v = np.linalg.svd(target_centred.T @ source_centred / count)
    _reject_degenerate(singular, np.sqrt(source_variance * target_variance), count, dimension)
    signs = np.ones(dimension)
    if np.linalg.det(u) * np.linalg.det(v) < 0.0:
        signs[-1] = -1.0  # a rotation, not a reflection
    rotation = (u * signs) @ v
    scale = float(singular @ signs) / source_variance if with_scale else 1.0
    if scale <= 0.0:
        raise DegenerateAlignment("the similarity alignment has no positive scale: the trajectories do not resemble each other")
    return Transform(rotation, target_mean - scale * (rotation @ source_mean), scale)


def find_alignment(name: AlignmentName, estimate_poses: FloatArray, reference_poses: FloatArray) -> Transform:
    """The transform that takes estimated poses to the reference poses of the same instants.

    The fits in space put the plane at z = 0, as evo does. A rotation in space may turn the plane over, so that SE(3) fits a
    mirrored estimate better than SE(2).

    Args:
        name: ``none``; ``start``, which lays the first pose on the first pose without scaling; or the best fit of a group.
        estimate_poses: Poses (N, 3).
        reference_poses: Poses (N, 3).

    Raises:
        DegenerateAlignment: The poses do not determine the fit.
    """
    if name == "none":
        return identity()
    if name == "start":
        return start_alignment(estimate_poses[0], reference_poses[0])
    if name not in LABELS:
        raise ValueError(f"alignment {name!r} is unknown, use one of {', '.join(LABELS)}")
    dimension = 3 if name.endswith("3") else 2
    source, target = _lift(estimate_poses[:, :2], dimension), _lift(reference_poses[:, :2], dimension)
    return umeyama(source, target, with_scale=name.startswith("sim"))


def apply_to_positions(transform: Transform, positions: FloatArray) -> FloatArray:
    """Transformed positions (N, m) of planar positions (N, 2)."""
    lifted = _lift(positions, transform.dimension)
    moved: FloatArray = transform.scale * lifted @ transform.rotation.T + transform.translation_m
    return moved


def apply_to_trajectory(transform: Transform, trajectory: Trajectory) -> Trajectory:
    """The trajectory moved by a planar transform. Raises ValueError if the transform is one in space."""
    if transform.dimension != 2:
        raise ValueError("poses of the plane take a planar transform: use SE(2) or Sim(2)")
    turn_rad = np.arctan2(transform.rotation[1, 0], transform.rotation[0, 0])
    positions = apply_to_positions(transform, trajectory.poses[:, :2])
    heading = se2.wrap(trajectory.poses[:, 2] + turn_rad)
    return Trajectory(trajectory.t_s, np.column_stack([positions, heading]))


def _rotation(angle_rad: float) -> FloatArray:
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[cos, -sin], [sin, cos]])


def _lift(positions: FloatArray, dimension: int) -> FloatArray:
    """Planar positions (N, 2) as (N, dimension), z = 0."""
    return np.pad(positions, ((0, 0), (0, dimension - 2)))


def _reject_degenerate(singular: FloatArray, spread_sq_m: float, count: int, dimension: int) -> None:
    needed = dimension - 1
    rank = int(np.count_nonzero(singular > DEGENERATE_RATIO * spread_sq_m)) if spread_sq_m > 0.0 else 0
    if rank < needed:
        shape = "coincide" if rank == 0 else "lie on a line"
        raise DegenerateAlignment(
            f"the {dimension}-D alignment of {count} points is degenerate: they {shape} (rank {rank}, needed {needed}); "
            "use alignment none or start"
        )
