"""A street of smooth textures that is ray-cast by hand: a flat road between two walls, seen by any pinhole camera."""

from dataclasses import dataclass

import numpy as np

ASIDE_M, HIGH_M, SKY = 9.0, 7.0, 200.0
RNG = np.random.default_rng(5)
WAVES = RNG.normal(0.0, 1.0, (16, 2)) * np.geomspace(0.5, 9.0, 16)[:, None]
PHASES = RNG.uniform(0.0, 2.0 * np.pi, 16)


@dataclass(frozen=True)
class Camera:
    """Where it sits and what it sees; ``pitch_rad`` is positive where it looks up."""

    columns: int = 414
    rows: int = 125
    focal_px: float = 240.0
    height_m: float = 1.65
    forward_m: float = 1.6
    pitch_rad: float = 0.0

    @property
    def matrix(self):
        return np.array(
            [
                [self.focal_px, 0.0, 0.5 * (self.columns - 1)],
                [0.0, self.focal_px, 0.5 * (self.rows - 1)],
                [0.0, 0.0, 1.0],
            ]
        )


def texture(a_m, b_m):
    """Grey levels of a plane: waves of some decimetres to metres."""
    return 128.0 + 12.0 * np.cos(a_m[..., None] * WAVES[:, 0] + b_m[..., None] * WAVES[:, 1] + PHASES).sum(axis=-1)


def picture(camera, pose, bonnet_px=0, noise=0.0, rng=None):
    """What the camera sees from the pose (x, y, heading): the road along x, walls at +-9 m; the lowest rows may be a bonnet."""
    x_m = pose[0] + camera.forward_m * np.cos(pose[2])
    y_m = pose[1] + camera.forward_m * np.sin(pose[2])
    right = (np.arange(camera.columns) - 0.5 * (camera.columns - 1)) / camera.focal_px
    down = ((np.arange(camera.rows) - 0.5 * (camera.rows - 1)) / camera.focal_px)[:, None]
    cos, sin = np.cos(camera.pitch_rad), np.sin(camera.pitch_rad)
    ahead, up = cos + sin * down + 0.0 * right, sin - cos * down + 0.0 * right
    east = np.cos(pose[2]) * ahead + np.sin(pose[2]) * right
    north = np.sin(pose[2]) * ahead - np.cos(pose[2]) * right
    to_wall = (np.sign(north) * ASIDE_M - y_m) / np.where(np.abs(north) < 1e-9, 1e-9, north)
    to_road = np.where(up < -1e-9, camera.height_m / np.maximum(-up, 1e-9), np.inf)
    depth = np.minimum(np.minimum(to_wall, to_road), 1e4)
    point_x, point_y, height = x_m + depth * east, y_m + depth * north, camera.height_m + depth * up
    seen = np.where(to_road < to_wall, texture(point_x, point_y), np.where(height < HIGH_M, texture(point_x, 2.0 * height), SKY))
    seen = np.where(depth > 120.0, SKY, seen) + (0.0 if rng is None else noise * rng.standard_normal(seen.shape))
    if bonnet_px:
        seen[-bonnet_px:] = 90.0 + 40.0 * np.sin(np.arange(camera.columns) / 3.0) * np.sin(np.arange(bonnet_px)[:, None] / 2.0)
    return np.clip(seen, 0, 255).astype(np.uint8)
