"""Self-motion sensed step by step, with the errors that ``sim/self_motion.py`` gives to a whole drive."""

from __future__ import annotations

import math

import numpy as np

from hippodrome.sim.self_motion import SelfMotionNoise


class Odometry:
    """Speed in map units and yaw rate, as noisy as told. The same model as ``sense_self_motion``, drawn as the drive goes on."""

    def __init__(self, noise: SelfMotionNoise, rng: np.random.Generator) -> None:
        self._noise, self._rng = noise, rng
        self._log_scale = math.log(noise.units_per_metre) + noise.units_per_metre_spread * rng.standard_normal()
        self._wander = noise.scale_wander * rng.standard_normal()
        self._gain = 1.0 + noise.gyro_gain * rng.standard_normal()
        self._bias_radps = math.radians(noise.gyro_bias_degps) * rng.standard_normal()
        self._jump, self._to_next_jump_m = 0.0, float(rng.exponential(noise.scale_jump_every_m))

    def sense(self, travelled_m: float, turned_rad: float, dt_s: float) -> tuple[float, float]:
        """Mean speed [map units per second] and mean yaw rate [rad/s] over the last ``dt_s``.

        A way driven backwards is negative, and so is its speed: wheel sensors know the direction from the gear.
        """
        noise, rng = self._noise, self._rng
        keep = math.exp(-abs(travelled_m) / noise.scale_wander_length_m)
        self._wander = keep * self._wander + noise.scale_wander * math.sqrt(1.0 - keep**2) * rng.standard_normal()
        self._to_next_jump_m -= abs(travelled_m)
        while self._to_next_jump_m <= 0.0:
            self._jump = noise.scale_jump * rng.standard_normal()
            self._to_next_jump_m += float(rng.exponential(noise.scale_jump_every_m))
        white_speed, white_yaw = rng.standard_normal(2)
        scale = math.exp(self._log_scale + self._wander + self._jump)
        speed = scale * (1.0 + noise.speed_noise / math.sqrt(dt_s) * white_speed) * travelled_m / dt_s
        white = math.radians(noise.gyro_noise_deg_per_sqrt_s) / math.sqrt(dt_s) * white_yaw
        return float(speed), float(self._gain * turned_rad / dt_s + self._bias_radps + white)
