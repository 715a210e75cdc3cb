"""What watches over the sensors: frames that are missing or black, a gyro that freezes, a radar that is blind."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hippodrome.core.navigation.config import VehicleShape, WatchConfig
from hippodrome.core.navigation.types import Radar
from hippodrome.core.types import Frame, Observation

MOVING_MPS = 1.0  # a vehicle that stands turns by nothing, and a gyro without noise says so again and again
TURNING_RADPS = 0.02  # a steered turn of so much must show


@dataclass(frozen=True, slots=True)
class SensorHealth:
    """For how long each sensor has been failing, in seconds."""

    without_frame_s: float = 0.0
    dark_s: float = 0.0
    blind_s: float = 0.0
    frozen_s: float = 0.0
    off_s: float = 0.0
    last_yaw_radps: float = math.nan

    def complaint(self, config: WatchConfig) -> tuple[bool, str]:
        """Whether the vehicle has to stop, and what is wrong; an empty reason if nothing is."""
        for seconds, slow_s, halt_s, reason in (
            (self.blind_s, config.radar_slow_s, config.radar_halt_s, "the radar is blind"),
            (self.without_frame_s, config.frames_slow_s, config.frames_halt_s, "there are no frames"),
            (self.dark_s, config.frames_slow_s, config.frames_halt_s, "the frames are black"),
            (self.frozen_s, config.gyro_frozen_s, config.gyro_frozen_s, "the gyro is frozen"),
            (self.off_s, config.gyro_frozen_s, config.gyro_frozen_s, "the gyro does not tell how the vehicle turns"),
        ):
            if seconds >= slow_s:
                return seconds >= halt_s, reason
        return False, ""


def is_dark(frame: Frame, level: float) -> bool:
    """Whether a frame is black; every seventh row and column is enough to tell."""
    return float(frame[::7, ::7].mean()) < level


def watched(
    health: SensorHealth, observation: Observation, radar: Radar, speed_mps: float, steering_rad: float,
    config: WatchConfig, vehicle: VehicleShape,
) -> SensorHealth:  # fmt: skip
    """The state of the sensors after an observation. ``steering_rad`` is how the wheels stood."""
    dt_s, yaw = observation.dt_s, observation.yaw_rate_radps
    dark = observation.frame is not None and is_dark(observation.frame, config.dark_level)
    expected = speed_mps * math.tan(steering_rad) / vehicle.wheelbase_m
    moving = abs(speed_mps) > MOVING_MPS
    frozen = moving and yaw == health.last_yaw_radps and (yaw != 0.0 or abs(expected) > TURNING_RADPS)
    off = moving and abs(yaw - expected) > config.gyro_off_radps
    dark_s = health.dark_s + dt_s if dark or (observation.frame is None and health.dark_s > 0.0) else 0.0
    return SensorHealth(
        without_frame_s=0.0 if observation.frame is not None else health.without_frame_s + dt_s,
        dark_s=dark_s,
        blind_s=health.blind_s + dt_s if radar.blind else 0.0,
        frozen_s=health.frozen_s + dt_s if frozen else (health.frozen_s if not moving and yaw == health.last_yaw_radps else 0.0),
        off_s=health.off_s + dt_s if off else (health.off_s if not moving else max(health.off_s - dt_s, 0.0)),
        last_yaw_radps=yaw,
    )
