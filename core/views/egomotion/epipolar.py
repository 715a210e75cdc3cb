"""How a camera turned, and which way it went, from corners seen in two frames: least epipolar error under a vehicle's priors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from hippodrome.core.types import FloatArray
from hippodrome.core.views.egomotion.tracks import Bools

ROUNDS_PX: Final = (4.0, 2.0, 1.0, 1.0, 0.5, 0.5, 0.5)  # scale of the errors that count in full, from coarse to fine
INLIER_PX: Final = 1.5  # a corner with a larger error moves by itself, or was taken for another one
TILT_RADPS: Final = 0.1  # usual rate of pitch and roll
TURN_CHANGE_RADPS2: Final = 1.0  # usual change of the yaw rate in a second
SLIDE: Final = (
    0.08  # tangent by which a vehicle's motion strays from the arc: its rear wheels slip, its place of mounting is guessed
)
HEAVE: Final = 0.03  # the same upwards: springs


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """What is expected of the motion between two frames before they are looked at."""

    yaw_rad: float  # to the right, about the camera's y axis
    yaw_sigma_rad: float
    tilt_sigma_rad: float
    heading: FloatArray  # (2,) tangents, rightwards and downwards, of the way that a straight drive takes the camera
    heading_sigma: float  # standard deviation of the heading while the mounting of the camera is not known well
    swing: float  # tangent rightwards that one radian of yaw adds: half an arc, and the arm to the rear axle


@dataclass(frozen=True, slots=True, eq=False)
class Turned:
    """How the second camera lies in the axes of the first (x right, y down, z ahead)."""

    rotation: FloatArray  # (3, 3)
    vector_rad: FloatArray  # (3,) of the rotation
    direction: FloatArray  # (3,) unit vector to the second camera
    tangents: FloatArray  # (2,) rightwards and downwards, of the direction
    told: FloatArray  # (2,) share of each tangent that the corners told rather than the prior, 0 to 1
    level: float  # tangent downwards of the direction if the camera had not pitched at all, to first order
    inlier: Bools  # (N,) corners that agree


def estimate_rotation(before: FloatArray, after: FloatArray, pixel: float, prior: Prior) -> Turned:
    """Rotation and direction of the least robust epipolar error, by Gauss-Newton from what is expected.

    Args:
        before: Bearings (N, 3) of corners in the first frame, 1 ahead.
        after: Bearings (N, 3) of the same corners in the second frame.
        pixel: Length of a pixel in bearings: 1 / focal length.
        prior: What is expected.
    """
    vector = np.array([0.0, prior.yaw_rad, 0.0])
    tangents = prior.heading + np.array([prior.swing * prior.yaw_rad, 0.0])
    information, sigmas = np.eye(5), np.ones(5)
    for scale_px in ROUNDS_PX:
        turned = _matrix(vector)
        error, slopes = _error(before, after, turned, tangents)
        scale = scale_px * pixel
        weight = 1.0 / (1.0 + (error / scale) ** 2) ** 2 / (0.5 * pixel) ** 2
        information = (slopes * weight[:, None]).T @ slopes
        gradient = slopes.T @ (weight * error)
        rows, values, sigmas = _prior_rows(vector, tangents, prior)
        information += (rows / sigmas[:, None] ** 2).T @ rows
        gradient += rows.T @ (values / sigmas**2)
        change = -np.linalg.solve(information, gradient)
        vector = cv2.Rodrigues(_matrix(change[:3]) @ turned)[0].ravel()
        tangents = tangents + change[3:]
    turned = _matrix(vector)
    error, _ = _error(before, after, turned, tangents)
    direction = np.array([tangents[0], tangents[1], 1.0])
    covariance = np.linalg.inv(information)
    told = np.clip(1.0 - np.diag(covariance)[3:] / sigmas[3:] ** 2, 0.0, 1.0)
    level = float(tangents[1] - covariance[4, 0] / covariance[0, 0] * vector[0])
    inlier = np.abs(error) < INLIER_PX * pixel
    return Turned(turned, vector, direction / np.linalg.norm(direction), tangents, told, level, inlier)


def errors(before: FloatArray, after: FloatArray, turned: Turned) -> FloatArray:
    """Sampson's error (N,) of corners, bearings (N, 3), under a motion; in bearings."""
    return _error(before, after, turned.rotation, turned.tangents)[0]


def _error(before: FloatArray, after: FloatArray, rotation: FloatArray, tangents: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sampson's error (N,) and its slopes (N, 5) along a further rotation (3) and the tangents of the direction (2)."""
    way = np.array([tangents[0], tangents[1], 1.0])
    turned = after @ rotation.T
    normal = np.cross(before, way)  # of the plane through both cameras and the corner
    error = (normal * turned).sum(axis=1)
    across = np.cross(way, turned)
    back = normal @ rotation
    length = np.sqrt(across[:, 0] ** 2 + across[:, 1] ** 2 + back[:, 0] ** 2 + back[:, 1] ** 2 + 1e-9)
    along_rotation = np.cross(turned, normal)
    along_way = np.cross(turned, before)[:, :2]
    return error / length, np.hstack([along_rotation, along_way]) / length[:, None]


def _prior_rows(vector: FloatArray, tangents: FloatArray, prior: Prior) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The priors as rows (5, 5), their present errors (5,) and standard deviations (5,)."""
    rows = np.eye(5)
    rows[3, 1] = -prior.swing
    values = np.array([vector[0], vector[1] - prior.yaw_rad, vector[2], *(tangents - prior.heading)])
    values[3] -= prior.swing * vector[1]
    slide = math.hypot(SLIDE, prior.heading_sigma, 0.3 * prior.swing * vector[1])
    heave = math.hypot(HEAVE, prior.heading_sigma)
    return rows, values, np.array([prior.tilt_sigma_rad, prior.yaw_sigma_rad, prior.tilt_sigma_rad, slide, heave])


def _matrix(vector_rad: NDArray[Any]) -> FloatArray:
    """The rotation (3, 3) of a rotation vector (3,)."""
    return np.asarray(cv2.Rodrigues(vector_rad)[0], np.float64)
