"""The road's plane under the pixels of a frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from hippodrome.core.types import Float32Array, FloatArray
from hippodrome.core.views.egomotion.camera import RoadCamera

NEAREST_M: Final = 0.5  # ahead of the camera: nearer lies the bonnet


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """Where the pixels of the rows that show the road lie, in the vehicle's axes; rows go from the nearest to the farthest."""

    rows: FloatArray  # (R,) int64, the rows of the frame
    x_m: Float32Array  # (R, W) ahead of the rear axle
    y_m: Float32Array  # (R, W) to the left


def ground_of(camera: RoadCamera, size_px: tuple[int, int], far_m: float, raised_m: float) -> Ground:
    """The plane ``raised_m`` above the road as frames of ``size_px`` (width, height) show it, up to ``far_m``."""
    width, height = size_px
    ahead = np.array([camera.heading[0], camera.heading[1], 1.0])
    ahead /= np.linalg.norm(ahead)
    right = np.cross([0.0, 1.0, 0.0], ahead)
    right /= np.linalg.norm(right)
    down = np.cross(ahead, right)
    column, row = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    pixels = np.stack([column, row, np.ones_like(row)], axis=-1)
    rays = pixels @ np.linalg.inv(camera.matrix).T
    falls = rays @ down
    scale = (camera.height_m - raised_m) / np.where(falls > 1e-6, falls, np.nan)
    x_m, y_m = scale * (rays @ ahead) + camera.forward_m, -scale * (rays @ right)
    farthest, nearest = np.max(x_m, axis=1), np.min(x_m, axis=1)
    seen = np.isfinite(farthest) & (farthest < far_m) & (nearest > camera.forward_m + NEAREST_M)
    rows = np.flatnonzero(seen)[::-1]
    return Ground(rows.astype(np.int64), x_m[rows].astype(np.float32), y_m[rows].astype(np.float32))
