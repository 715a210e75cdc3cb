"""The camera: its specification, where it sits on the vehicle, and its projection."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from hippodrome.core.types import FloatArray
from hippodrome.sim.spec import Spec

NEAR_M = 0.3  # nothing of the scene comes closer than a vehicle alongside
FAR_M = 450.0  # beyond this the haze of a clear day hides most of the contrast


class CameraSpec(Spec):
    """A forward-looking pinhole camera, mounted level. ``stereo_baseline_m`` adds a second camera to the right of it."""

    width: int = Field(default=160, ge=16, le=4096)
    height: int = Field(default=120, ge=16, le=4096)
    fov_deg: float = Field(default=90.0, ge=20.0, le=150.0)  # horizontal
    rate_hz: float = Field(default=10.0, ge=0.01, le=200.0)
    height_m: float = Field(default=1.4, ge=0.3, le=5.0)  # above the road
    forward_m: float = Field(default=1.6, ge=-5.0, le=10.0)  # from the rear axle to the windscreen
    yaw_offset_deg: float = Field(default=0.0, ge=-180.0, le=180.0)  # counter-clockwise, a camera mounted askew
    supersample: int = Field(default=2, ge=1, le=8)  # rendered at this multiple, averaged down: thin lane lines need it
    grain: bool = False  # draw the grain of asphalt, plaster, grass, leaves: corners for trackers that live on them
    stereo_baseline_m: float | None = Field(default=None, gt=0.0, le=2.0)

    def focal_px(self) -> float:
        """Focal length in pixels of the delivered frame."""
        return 0.5 * self.width / float(np.tan(0.5 * np.radians(self.fov_deg)))


def camera_position_m(spec: CameraSpec, body_pose_m: FloatArray, right_m: float = 0.0) -> tuple[FloatArray, float]:
    """Optical centre (3,) and viewing direction [rad] for a body pose (3,); ``right_m`` shifts along the image's x axis.

    A pose (5,) has the height [m] and the pitch [rad, nose up] of the car too.
    """
    heading = float(body_pose_m[2])
    yaw = heading + float(np.radians(spec.yaw_offset_deg))
    x = body_pose_m[0] + spec.forward_m * np.cos(heading) + right_m * np.sin(yaw)
    y = body_pose_m[1] + spec.forward_m * np.sin(heading) - right_m * np.cos(yaw)
    if len(body_pose_m) == 3:
        return np.array([x, y, spec.height_m]), yaw
    sin, cos = np.sin(body_pose_m[4]), np.cos(body_pose_m[4])
    back_m = spec.forward_m * (1.0 - cos) + spec.height_m * sin  # seen from above, the camera of a pitched car stands back
    z = body_pose_m[3] + spec.forward_m * sin + spec.height_m * cos
    return np.array([x - back_m * np.cos(heading), y - back_m * np.sin(heading), z]), yaw


def camera_to_world(position_m: FloatArray, yaw_rad: float, pitch_rad: float = 0.0) -> FloatArray:
    """(4, 4) pose in OpenGL's convention: the camera's x to the right, y up, z backwards; pitch lifts the view."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    pose = np.eye(4)
    pose[:3, 0] = sin, -cos, 0.0
    pose[:3, 1] = 0.0, 0.0, 1.0
    pose[:3, 2] = -cos, -sin, 0.0
    pose[:3, 3] = position_m
    if pitch_rad != 0.0:
        up, back = pose[:3, 1].copy(), pose[:3, 2].copy()
        pose[:3, 1] = np.cos(pitch_rad) * up + np.sin(pitch_rad) * back
        pose[:3, 2] = np.cos(pitch_rad) * back - np.sin(pitch_rad) * up
    return pose


def projection(spec: CameraSpec) -> FloatArray:
    """(4, 4) perspective projection to OpenGL clip space, square pixels."""
    aspect = spec.width / spec.height
    scale = 1.0 / np.tan(0.5 * np.radians(spec.fov_deg))
    matrix = np.zeros((4, 4))
    matrix[0, 0], matrix[1, 1] = scale, scale * aspect
    matrix[2, 2] = -(FAR_M + NEAR_M) / (FAR_M - NEAR_M)
    matrix[2, 3] = -2.0 * FAR_M * NEAR_M / (FAR_M - NEAR_M)
    matrix[3, 2] = -1.0
    return matrix


def camera_divider(camera: CameraSpec, odometry_rate_hz: float) -> int:
    """How many odometry steps pass per frame. Raises ValueError unless it is a whole number."""
    every = round(odometry_rate_hz / camera.rate_hz)
    if every < 1 or abs(every * camera.rate_hz - odometry_rate_hz) > 1e-6 * odometry_rate_hz:
        raise ValueError(f"odometry_rate_hz {odometry_rate_hz:g} is not a whole multiple of camera.rate_hz {camera.rate_hz:g}")
    return every
