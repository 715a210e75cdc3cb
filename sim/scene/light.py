"""From conditions to colours: the sun and the sky, the seasons' tints, the baked shading, the haze and the sky dome."""

from __future__ import annotations

from typing import Final

import numpy as np

from hippodrome.core.types import Float32Array, FloatArray, UInt8Array
from hippodrome.sim.scene.conditions_spec import Conditions
from hippodrome.sim.scene.mesh import Mesh, Surface
from hippodrome.sim.scene.types import Light, Tile

KOSCHMIEDER: Final = 3.912  # -ln(0.02): the visibility is where 2 % of the contrast is left
CLEAR_VISIBILITY_M: Final = 3000.0  # a hazy fine day; it also hides that the drawn world ends at the far plane
FOG_DEPTH_M: Final = 500.0  # fog lies a few hundred metres thick: a longer visibility lets the sky through
DOME_RADIUS_M: Final = 100.0  # any value between the near and the far plane: the sky is drawn at infinite depth
LAMP: Final = np.array([1.0, 0.78, 0.42])  # sRGB of a lit window

# Season -> surface -> (share of the tint, tint sRGB). Summer is the albedo as modelled.
TINTS: Final[dict[str, dict[Surface, tuple[float, tuple[float, float, float]]]]] = {
    "summer": {},
    "autumn": {
        Surface.GRASS: (0.35, (0.52, 0.47, 0.26)),
        Surface.CROP: (0.60, (0.45, 0.36, 0.25)),
        Surface.LEAF: (0.75, (0.66, 0.40, 0.13)),
    },
    "winter": {
        Surface.GRASS: (0.65, (0.62, 0.61, 0.54)),
        Surface.CROP: (0.75, (0.55, 0.50, 0.45)),
        Surface.LEAF: (0.80, (0.42, 0.37, 0.33)),
        Surface.NEEDLE: (0.30, (0.45, 0.50, 0.48)),
    },
}

# Grain of each surface as a share of its colour: asphalt's stones, plaster and brick, blades, leaves; glass has none.
GRAIN: Final[dict[Surface, float]] = {
    Surface.MINERAL: 0.16,
    Surface.GRASS: 0.24,
    Surface.CROP: 0.24,
    Surface.LEAF: 0.40,
    Surface.NEEDLE: 0.40,
    Surface.WINDOW: 0.0,
}


def light_of(conditions: Conditions) -> Light:
    """Sun and sky radiance; clouds and dusk take from the sun first."""
    azimuth, elevation = np.radians(conditions.sun_azimuth_deg), np.radians(conditions.sun_elevation_deg)
    direction: FloatArray = np.array(
        [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)]
    )
    grey = _greyness(conditions)
    low = np.exp(-np.sin(elevation) / 0.15)  # the low sun's light is reddened and dimmed on its long way through the air
    colour: FloatArray = np.array([1.0, 0.96 - 0.25 * low, 0.88 - 0.5 * low])
    sun: FloatArray = 0.95 * (1.0 - 0.4 * low) * (1.0 - grey) * (1.0 - 0.95 * conditions.dusk) * colour
    day = 1.0 - 0.72 * conditions.dusk
    clear, cloudy = np.array([0.34, 0.39, 0.47]), np.array([0.60, 0.61, 0.62])
    sky = day * ((1.0 - grey) * clear + grey * cloudy)
    ground = 0.45 * sky + 0.12 * direction[2] * sun
    return Light(sun_direction=direction, sun=sun, sky=sky, ground=ground)


def shade(albedo: FloatArray | Float32Array, normals: FloatArray | Float32Array, light: Light) -> UInt8Array:
    """Lambert's law under the sun and a hemisphere of sky over ground; albedo (n, 3) in sRGB, normals (n, 3)."""
    lit = np.clip(normals @ light.sun_direction, 0.0, None)[:, None] * light.sun
    up = 0.5 + 0.5 * np.asarray(normals, dtype=np.float64)[:, 2:]
    radiance = np.asarray(albedo, dtype=np.float64) ** 2.2 * (lit + up * light.sky + (1.0 - up) * light.ground)
    return to_levels(np.clip(radiance, 0.0, 1.0) ** (1.0 / 2.2))


def to_levels(srgb: FloatArray) -> UInt8Array:
    return np.clip(np.rint(255.0 * srgb), 0, 255).astype(np.uint8)


def colour(mesh: Mesh, conditions: Conditions, light: Light) -> UInt8Array:
    """Vertex colours (n, 3) of a mesh in its season and light."""
    tint = np.zeros((len(Surface), 3))
    share = np.zeros(len(Surface))
    for surface, (amount, target) in TINTS[conditions.season].items():
        share[surface], tint[surface] = amount, target
    weight = share[mesh.surface][:, None]
    rgb = shade((1.0 - weight) * mesh.albedo + weight * tint[mesh.surface], mesh.normals, light)
    return np.where(_lit_windows(mesh, conditions)[:, None], to_levels(LAMP), rgb)


def grain(mesh: Mesh) -> UInt8Array:
    """Grain (n,) of a mesh's vertices, ``Tile.grain``."""
    share = np.array([GRAIN[surface] for surface in Surface])
    return to_levels(share)[mesh.surface]


def _lit_windows(mesh: Mesh, conditions: Conditions) -> np.ndarray:
    """Windows with a light behind them: a share that grows with dusk, told apart by the window's own shade of glass."""
    lottery = np.floor(mesh.albedo[:, 2] * 4096.0).astype(np.int64) * 2654435761 % 1000 / 1000.0
    return np.asarray((mesh.surface == Surface.WINDOW) & (lottery < 0.5 * conditions.dusk))


def extinction_per_m(conditions: Conditions) -> float:
    """Koschmieder's law: contrast falls to 2 % at the meteorological visibility."""
    return KOSCHMIEDER / (conditions.fog_visibility_m or CLEAR_VISIBILITY_M)


def haze_rgb(conditions: Conditions) -> UInt8Array:
    """The horizon's colour."""
    return to_levels(_horizon(conditions))


def _veil(conditions: Conditions) -> float:
    """Share of the sky that fog hides: thick fog all of it, a distant haze nothing."""
    return 0.0 if conditions.fog_visibility_m is None else float(np.exp(-conditions.fog_visibility_m / FOG_DEPTH_M))


def _greyness(conditions: Conditions) -> float:
    """How far clouds or fog scatter the sunlight."""
    return max(conditions.overcast, _veil(conditions))


def _horizon(conditions: Conditions) -> FloatArray:
    clear, cloudy, dusk = np.array([0.80, 0.87, 0.93]), np.array([0.80, 0.81, 0.82]), np.array([0.50, 0.42, 0.45])
    grey = _greyness(conditions)
    day = (1.0 - grey) * clear + grey * cloudy
    horizon: FloatArray = (1.0 - conditions.dusk) * day + conditions.dusk * dusk * day / clear
    return horizon


def sky_dome(conditions: Conditions) -> Tile:
    """Inside of a sphere: haze at and below the horizon, darker above, a glow around the sun. Clouds would serve as a compass."""
    elevation_rad = np.radians([-90.0, 0.0, 4.0, 10.0, 20.0, 38.0, 60.0, 90.0])
    azimuth_rad = np.linspace(0.0, 2.0 * np.pi, 33)
    azimuth, elevation = np.meshgrid(azimuth_rad, elevation_rad)
    ray = np.stack([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)], axis=-1)
    rows, columns = azimuth.shape
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + columns, corner + 1], 1), np.stack([corner + 1, corner + columns, corner + columns + 1], 1)]
    )
    rgb = to_levels(_sky(ray.reshape(-1, 3), conditions))
    vertices = (DOME_RADIUS_M * ray.reshape(-1, 3)).astype(np.float32)
    smooth = np.zeros(len(vertices), dtype=np.uint8)
    return Tile(vertices_m=vertices, faces=faces.astype(np.int32), rgb=rgb, grain=smooth, bold_faces=len(faces))


def _sky(ray: FloatArray, conditions: Conditions) -> FloatArray:
    """sRGB seen along unit rays (n, 3)."""
    horizon = _horizon(conditions)
    grey = _greyness(conditions)
    zenith = (1.0 - grey) * np.array([0.30, 0.52, 0.82]) + grey * np.array([0.66, 0.68, 0.70])
    zenith = (1.0 - conditions.dusk) * zenith + conditions.dusk * np.array([0.13, 0.16, 0.30])
    if conditions.fog_visibility_m is not None:
        veil = _veil(conditions)
        zenith = (1.0 - veil) * zenith + veil * horizon
    height = (np.clip(ray[:, 2:], 0.0, 1.0)) ** 0.6
    glow = np.clip(ray @ light_of(conditions).sun_direction, 0.0, 1.0)[:, None] ** 12 * (1.0 - grey)
    srgb: FloatArray = (1.0 - height) * horizon + height * zenith + 0.25 * glow * np.array([1.0, 0.9, 0.7])
    return np.clip(srgb, 0.0, 1.0)
