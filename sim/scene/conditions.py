"""Light, weather, season and camera effects of a drive. They change colours only: the geometry of a town stays."""

from __future__ import annotations

from typing import Literal

import cv2
import numpy as np
from pydantic import Field

from hippodrome.core.types import Frame
from hippodrome.sim.spec import Spec


class Conditions(Spec):
    """The defaults are a clear summer day and a perfect camera."""

    sun_azimuth_deg: float = Field(default=210.0, ge=-360.0, le=360.0)  # where the sun stands, counter-clockwise from x (east)
    sun_elevation_deg: float = Field(default=45.0, ge=2.0, le=90.0)
    overcast: float = Field(default=0.0, ge=0.0, le=1.0)  # 0 clear sky, 1 closed cloud
    dusk: float = Field(default=0.0, ge=0.0, le=1.0)  # 0 day, 1 after sunset with lit windows
    fog_visibility_m: float | None = Field(default=None, ge=10.0, le=50_000.0)  # meteorological visibility
    season: Literal["summer", "autumn", "winter"] = "summer"
    gain: float = Field(default=1.0, gt=0.0, le=8.0)
    gamma: float = Field(default=1.0, ge=0.2, le=5.0)
    noise_sigma: float = Field(default=0.0, ge=0.0, le=64.0)  # of each pixel and channel, in 8-bit levels
    motion_blur: float = Field(default=0.0, ge=0.0, le=0.2)  # length of the horizontal smear as a share of the frame's width


def apply_camera(frame: Frame, conditions: Conditions, rng: np.random.Generator) -> Frame:
    """The frame as a worse camera would deliver it: smeared, amplified, bent by gamma, noisy. Shape (H, W, 3) stays."""
    image = _smear(frame, conditions.motion_blur)
    if conditions.gain != 1.0 or conditions.gamma != 1.0:
        image = _response(conditions.gain, conditions.gamma)[image]
    if conditions.noise_sigma > 0.0:
        noise = rng.standard_normal(image.shape, dtype=np.float32) * np.float32(conditions.noise_sigma)
        image = np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)
    return image


def _smear(frame: Frame, share: float) -> Frame:
    """Yaw during the exposure moves the image sideways, hence a horizontal box filter."""
    length = round(share * frame.shape[1])
    if length < 2:
        return frame
    return np.asarray(cv2.blur(frame, (length, 1), borderType=cv2.BORDER_REPLICATE), dtype=np.uint8)


def _response(gain: float, gamma: float) -> Frame:
    """Level after gain and gamma for each of the 256 levels, saturating."""
    level = np.arange(256) / 255.0
    return np.clip(np.rint(255.0 * np.clip(gain * level, 0.0, 1.0) ** gamma), 0, 255).astype(np.uint8)
