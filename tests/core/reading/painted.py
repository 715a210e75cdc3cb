"""Frames of painted roads with a known geometry, drawn ray by ray."""

import numpy as np

from hippodrome.core.reading import ReaderConfig
from hippodrome.core.views.egomotion.camera import RoadCamera

ASPHALT, PAINT, GRAVEL, GRASS, SKY = 96.0, 225.0, 140.0, 70.0, 200.0
WIDTH_M = 3.2
FINE = 4  # rays per pixel and axis


def camera(width=160, height=120, fov_deg=90.0, height_m=1.4, forward_m=1.6, pitch=0.0, yaw=0.0):
    """A camera of frames (height, width); ``pitch`` and ``yaw`` are tangents of where it is driven to, down and right."""
    focal = 0.5 * width / np.tan(0.5 * np.radians(fov_deg))
    matrix = np.array([[focal, 0.0, 0.5 * (width - 1)], [0.0, focal, 0.5 * (height - 1)], [0.0, 0.0, 1.0]])
    return RoadCamera(matrix, height_m, forward_m, heading=np.array([yaw, pitch]))


def ground(view, size):
    """Where the rays of a frame (width, height) meet the painted plane: x, y in the vehicle's axes, nan above the horizon."""
    width, height = size
    column, row = np.meshgrid((np.arange(width * FINE) + 0.5) / FINE - 0.5, (np.arange(height * FINE) + 0.5) / FINE - 0.5)
    rays = np.stack([column, row, np.ones_like(row)], axis=-1) @ np.linalg.inv(view.matrix).T
    ahead = np.array([view.heading[0], view.heading[1], 1.0])
    ahead /= np.linalg.norm(ahead)
    right = np.array([ahead[2], 0.0, -ahead[0]]) / np.hypot(ahead[0], ahead[2])
    down = np.cross(ahead, right)
    falls = rays @ down
    scale = (view.height_m - ReaderConfig().paint_m) / np.where(falls > 1e-4, falls, np.nan)
    return scale * (rays @ ahead) + view.forward_m, -scale * (rays @ right)


def in_lane(x, y, offset_m, heading_rad, curvature_1pm):
    """Arc length along the lane from the rear axle on, and place left of its middle, of points in the vehicle's axes."""
    along, left = np.cos(heading_rad) * x - np.sin(heading_rad) * y, np.sin(heading_rad) * x + np.cos(heading_rad) * y
    left = left + offset_m
    if curvature_1pm == 0.0:
        return along, left
    radius = 1.0 / curvature_1pm
    angle = np.arctan2(along * np.sign(radius), (radius - left) * np.sign(radius))
    return abs(radius) * angle, radius - np.sign(radius) * np.hypot(along, radius - left)


def road(
    view, size=(160, 120), offset_m=0.0, heading_rad=0.0, curvature_1pm=0.0, lines=((-1.4, 0), (1.6, 9), (4.6, 0)),
    bars=(), end_m=np.inf, noise=0.0, along_m=0.0, asphalt=ASPHALT, paint=PAINT,
):  # fmt: skip
    """An RGB frame. ``lines`` are places left of the lane's middle with the period of their dashes of 3 m (0: solid).

    ``along_m`` is how far the vehicle has come, which moves the dashes. ``bars`` are (first, last)
    metres along the lane that are painted across it; lines and verges end at ``end_m``.
    """
    x, y = ground(view, size)
    with np.errstate(invalid="ignore"):
        along, left = in_lane(x, y, offset_m, heading_rad, curvature_1pm)
        right, far = min([-1.4, *(place for place, _ in lines)]) - 0.2, max([4.6, *(place for place, _ in lines)]) + 0.2
        level = np.where((left > right) & (left < far) | (along > end_m), asphalt, GRAVEL)
        level = np.where(((left < right - 0.9) | (left > far + 0.9)) & (along < end_m), GRASS, level)
        for place, period in lines:
            shown = (abs(left - place) < 0.07) & (along < end_m)
            level = np.where(shown & (((along + along_m + 5.0) % period < 3.0) if period else True), paint, level)
        for first, last in bars:
            level = np.where((along > first) & (along < last) & (abs(left) < 1.5), paint, level)
    level = np.where(np.isfinite(x), level, SKY)
    frame = level.reshape(size[1], FINE, size[0], FINE).mean(axis=(1, 3))
    if noise > 0.0:
        frame = frame + noise * np.random.default_rng(1).standard_normal(frame.shape)
    return np.repeat(np.clip(np.rint(frame), 0, 255).astype(np.uint8)[:, :, None], 3, axis=2)
