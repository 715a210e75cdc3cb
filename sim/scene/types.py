"""What travels from ``sim.scene`` to ``sim.render``."""

from __future__ import annotations

from dataclasses import dataclass

from hippodrome.core.types import Float32Array, FloatArray, IntArray, UInt8Array


@dataclass(frozen=True, slots=True, eq=False)
class Tile:
    """A patch of the town as indexed triangles, counter-clockwise seen from outside, light baked into the colours."""

    vertices_m: Float32Array  # (n, 3) relative to the scene's origin, z up from the road
    faces: IntArray  # (m, 3)
    rgb: UInt8Array  # (n, 3)
    grain: UInt8Array  # (n,) how far the surface's fine grain strays from its colour, as a share of it, 255 being all
    bold_faces: int  # the first this many faces are worth drawing at any distance; the rest is fine detail


@dataclass(frozen=True, slots=True, eq=False)
class Light:
    """Sun and sky over the scene. Radiances are linear, 1 being full sunlight on a white surface."""

    sun_direction: FloatArray  # (3,) unit, towards the sun
    sun: FloatArray  # (3,) linear RGB
    sky: FloatArray  # (3,) linear RGB from above
    ground: FloatArray  # (3,) linear RGB bounced from below


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A town ready to draw."""

    tiles: tuple[Tile, ...]
    sky: Tile  # a dome around the camera
    origin_m: FloatArray  # (2,) network coordinates of the tiles' zero: keeps 32-bit vertices exact far from the network's zero
    haze_rgb: UInt8Array  # (3,) what distant things fade to
    extinction_per_m: float  # Koschmieder's law
    light: Light  # for what moves and therefore cannot be baked
