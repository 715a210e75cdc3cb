"""Directions in space: the way of a drive in pieces, the angle between two ways, the turn that lays one of them upright."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from hippodrome.core.types import FloatArray

CHORDS: Final = 200  # directions of motion are told over this share of the drive: single steps are noise


def chords(positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """First and second numbers of samples that lie a share of the drive's length apart."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=1))])
    if along[-1] <= 0.0:
        return np.zeros(0, int), np.zeros(0, int)
    marks = np.unique(np.searchsorted(along, np.linspace(0.0, along[-1], CHORDS + 1)).clip(0, len(along) - 1))
    first, second = marks[:-1], marks[1:]
    moved = np.linalg.norm(positions[second] - positions[first], axis=1) > 0.0
    return first[moved], second[moved]


def turn_up(up: FloatArray) -> FloatArray:
    """The smallest rotation (3, 3) that takes the unit vector ``up`` to z."""
    axis = np.cross(up, [0.0, 0.0, 1.0])
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12:
        return np.eye(3) if up[2] > 0.0 else np.diag([1.0, -1.0, -1.0])
    turn: FloatArray = Rotation.from_rotvec(axis / sine * np.arctan2(sine, up[2])).as_matrix()
    return turn


def angle_deg(a: FloatArray, b: FloatArray) -> float:
    """The angle between two vectors (3,), degrees."""
    cosine = float(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)))
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
