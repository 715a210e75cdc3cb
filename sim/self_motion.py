"""Self-motion as the vehicle senses it: yaw rate with bias, noise and gain error; speed in units of unknown, drifting scale.

The scale error is the monocular one: a map built from it has an unknown number of metres per unit. Levels follow the published
drive (``paper``: about half scale, some 60 deg of heading drift over 22 minutes) and multiply its noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np
from pydantic import Field

from hippodrome.core.types import FloatArray
from hippodrome.sim.spec import Spec
from hippodrome.sim.types import Drive

UNIT: Final = ("units_per_metre", "units_per_metre_spread")  # fields that say in what unit speeds are, and whether that is known
NonNegative: TypeAlias = Annotated[float, Field(ge=0.0)]


class SelfMotionNoise(Spec):
    """One drive's self-motion errors and the two errors of the world that go with a noise level."""

    units_per_metre: Annotated[float, Field(gt=0.01, lt=100.0)] = 0.5
    units_per_metre_spread: NonNegative = 0.2  # standard deviation of ln(units per metre) between drives: nobody can assume 0.5
    scale_wander: NonNegative = 0.0  # standard deviation of the slow relative scale error
    scale_wander_length_m: Annotated[float, Field(gt=0.0)] = 500.0  # over which it forgets itself
    scale_jump: NonNegative = (
        0.0  # standard deviation of a jump of ln(scale), as a visual odometry makes when it is re-initialized
    )
    scale_jump_every_m: Annotated[float, Field(gt=0.0)] = 500.0
    speed_noise: NonNegative = 0.0  # relative, white, per square root of a second
    gyro_bias_degps: NonNegative = 0.0  # standard deviation of the drive's constant bias
    gyro_noise_deg_per_sqrt_s: NonNegative = 0.0  # angle random walk
    gyro_gain: NonNegative = 0.0  # standard deviation of the drive's relative gain error
    lateral_wander_m: NonNegative = 0.0  # of the driver inside the lane
    survey_error_m: NonNegative = 0.0  # of the road network that the map is matched to


_PAPER = SelfMotionNoise(scale_wander=0.04, speed_noise=0.02, gyro_bias_degps=0.05, gyro_noise_deg_per_sqrt_s=0.1)

NOISE_LEVELS: dict[str, SelfMotionNoise] = {
    "clean": SelfMotionNoise(),
    "paper": _PAPER,
    "realistic": _PAPER.model_copy(
        update={
            "gyro_noise_deg_per_sqrt_s": 0.5,
            "gyro_gain": 0.02,
            "scale_jump": 0.10,
            "lateral_wander_m": 0.3,
            "survey_error_m": 0.5,
        }
    ),
    "harsh": _PAPER.model_copy(
        update={
            "gyro_noise_deg_per_sqrt_s": 1.0,
            "gyro_gain": 0.04,
            "scale_jump": 0.15,
            "lateral_wander_m": 0.5,
            "survey_error_m": 1.0,
        }
    ),
}
NoiseLevel: TypeAlias = Literal["clean", "paper", "realistic", "harsh"]


def noise_of(level: NoiseLevel | SelfMotionNoise) -> SelfMotionNoise:
    """The named level, or the custom noise itself."""
    return level if isinstance(level, SelfMotionNoise) else NOISE_LEVELS[level]


def at_level(level: NoiseLevel, noise: NoiseLevel | SelfMotionNoise) -> NoiseLevel | SelfMotionNoise:
    """The errors of a level, with speeds in the unit of another noise, known or drawn; the level's name where that is its own."""
    errors, given = NOISE_LEVELS[level], noise_of(noise)
    unit = {name: getattr(given, name) for name in UNIT}
    return level if unit == {name: getattr(errors, name) for name in UNIT} else errors.model_copy(update=unit)


@dataclass(frozen=True, slots=True, eq=False)
class SelfMotion:
    """N odometry samples: means over ``(t_s - dt_s, t_s]``."""

    t_s: FloatArray  # (N,)
    dt_s: float
    speed: FloatArray  # (N,) map units per second
    yaw_rate_radps: FloatArray  # (N,)


def sense_self_motion(drive: Drive, rate_hz: float, noise: SelfMotionNoise, rng: np.random.Generator) -> SelfMotion:
    """What the ego's odometry reports along ``drive`` at ``rate_hz``."""
    dt_s = 1.0 / rate_hz
    count = int(np.floor((drive.t_s[-1] - drive.t_s[0]) * rate_hz + 1e-9))
    edges_s = drive.t_s[0] + dt_s * np.arange(count + 1)
    travelled_m = np.diff(np.interp(edges_s, drive.t_s, _arc_length_m(drive)))
    turned_rad = np.diff(np.interp(edges_s, drive.t_s, np.unwrap(drive.poses_m[:, 2])))

    log_scale = np.log(noise.units_per_metre) + noise.units_per_metre_spread * rng.standard_normal()
    log_scale = log_scale + _wander(travelled_m, noise.scale_wander, noise.scale_wander_length_m, rng)
    log_scale = log_scale + _jumps(travelled_m, noise.scale_jump, noise.scale_jump_every_m, rng)
    speed_noise = 1.0 + noise.speed_noise / np.sqrt(dt_s) * rng.standard_normal(count)
    speed = np.exp(log_scale) * speed_noise * travelled_m / dt_s

    gain = 1.0 + noise.gyro_gain * rng.standard_normal()
    bias = np.deg2rad(noise.gyro_bias_degps) * rng.standard_normal()
    white = np.deg2rad(noise.gyro_noise_deg_per_sqrt_s) / np.sqrt(dt_s) * rng.standard_normal(count)
    return SelfMotion(t_s=edges_s[1:], dt_s=dt_s, speed=speed, yaw_rate_radps=gain * turned_rad / dt_s + bias + white)


def _arc_length_m(drive: Drive) -> FloatArray:
    """The way (N,) that the wheels rolled: up and down slopes too."""
    places = drive.poses_m[:, :2] if drive.heights_m is None else np.column_stack([drive.poses_m[:, :2], drive.heights_m])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _wander(travelled_m: FloatArray, sigma: float, length_m: float, rng: np.random.Generator) -> FloatArray:
    """Ornstein-Uhlenbeck process over distance, stationary from the start."""
    keep = np.exp(-travelled_m / length_m)
    kicks = sigma * np.sqrt(1.0 - keep**2) * rng.standard_normal(len(travelled_m))
    value, values = sigma * rng.standard_normal(), np.empty(len(travelled_m))
    for i, (k, kick) in enumerate(zip(keep, kicks, strict=True)):
        value = k * value + kick
        values[i] = value
    return values


def _jumps(travelled_m: FloatArray, sigma: float, every_m: float, rng: np.random.Generator) -> FloatArray:
    """Steps of size N(0, sigma) at Poisson places; the scale stays around its mean, as each jump starts afresh from it."""
    after_m = np.cumsum(travelled_m)
    place_m = np.cumsum(rng.exponential(every_m, size=int(after_m[-1] / every_m * 3) + 10))
    level = np.concatenate([[0.0], sigma * rng.standard_normal(len(place_m))])
    values: FloatArray = level[np.searchsorted(place_m, after_m)]
    return values
