"""Light, weather, season and camera effects of a drive. They change colours only: the geometry of a town stays."""

from __future__ import annotations

import cv2
import numpy as np

from hippodrome.core.types import Frame
from hippodrome.sim.scene.conditions_spec import Conditions


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
