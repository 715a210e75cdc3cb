"""The path follower: which way to hold the wheel."""

from __future__ import annotations

import math

from hippodrome.core.navigation.config import DriveConfig, VehicleShape
from hippodrome.core.navigation.course import Course, at, offset_and_turn
from hippodrome.core.types import FloatArray


def path_curvature_1pm(course: Course, u_m: float, pose_m: FloatArray, speed_mps: float, config: DriveConfig) -> float:
    """The curvature to drive: kappa = kappa_path - e / l^2 - 2 psi / l, critically damped over the length l.

    Samson, "Control of chained systems" (IEEE Transactions on Automatic Control, 1995), linearised about the path. ``e`` is the
    offset to the left of the path, ``psi`` the heading against it. The path's curvature is taken a little ahead, as the wheels
    take their time to turn.
    """
    offset_m, turn_rad = offset_and_turn(course, pose_m, u_m)
    ahead_m = u_m + config.preview_s * speed_mps
    return lane_curvature_1pm(at(course.path.curvature_1pm, ahead_m), offset_m, turn_rad, speed_mps, config)


def lane_curvature_1pm(curvature_1pm: float, offset_m: float, turn_rad: float, speed_mps: float, config: DriveConfig) -> float:
    """The same law where only offset, heading and curvature of a lane are known. Large offsets are closed at a mild angle."""
    decay_m = max(config.error_decay_m, config.error_decay_s * speed_mps)
    offset_m = min(max(offset_m, -1.0), 1.0)
    return curvature_1pm - offset_m / decay_m**2 - 2.0 * turn_rad / decay_m


def steering_rad(curvature_1pm: float, speed_mps: float, config: DriveConfig, vehicle: VehicleShape) -> float:
    """The angle of the road wheels that drives a curvature, within the turning circle and what passengers accept sideways."""
    most = 1.5 * config.lateral_mps2 / max(speed_mps, 1.0) ** 2
    bounded = min(max(curvature_1pm, -most), most)
    angle = math.atan(vehicle.wheelbase_m * bounded)
    return min(max(angle, -vehicle.max_steering_rad), vehicle.max_steering_rad)
