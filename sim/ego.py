"""The ego vehicle: how fast it dares to go, and highway-env's kinematic bicycle that follows the path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from highway_env.vehicle.kinematics import Vehicle
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from hippodrome.core.types import FloatArray
from hippodrome.sim.ego_spec import EgoSpec as EgoSpec  # it belongs to the vehicle, and is found here, too
from hippodrome.sim.path import STEP_M, Path

WHEELBASE_M: Final = 2.7  # a compact car
LENGTH_M: Final = 4.5
REAR_AXLE_TO_FRONT_M: Final = 3.6  # rear axle to front bumper, which is what SUMO calls a vehicle's position
MAX_STEERING_RAD: Final = math.radians(42.0)  # turning circle of 10.2 m at the outer wheel: a small car's
MAX_CURVATURE_1PM: Final = math.tan(MAX_STEERING_RAD) / WHEELBASE_M
MAX_STEERING_RATE_RADPS: Final = 0.9  # road wheel; a quick turn of the steering wheel
MAX_YAW_RATE_RADPS: Final = 0.75  # what turns are driven at; leaves room below 0.9 for steering back to the path
LIMIT_LATERAL_MPS2: Final = 3.0  # what the car itself never exceeds, also while it steers back to the path
LIMIT_YAW_RADPS: Final = 0.85
SAFE_GAIN_1PS: Final = 4.0  # brakes for its own steering within a quarter of a second
MIN_CREEP_MPS: Final = 1.0  # in the tightest turns
ERROR_DECAY_M: Final = 3.0  # distance over which an offset from the path fades, at low speed
ERROR_DECAY_S: Final = 0.5  # and the time it takes at least: a driver's reaction
PREVIEW_S: Final = 0.15  # the steering looks ahead by about the delay of its own rate limit
SPEED_GAIN_1PS: Final = 2.0
PROGRESS_GAIN_1PS2: Final = 1.0  # critically damped with the speed gain: 2 sqrt(1) = 2
MAX_LAG_M: Final = 2.0  # a longer lag is made up for at 1 m/s, no faster
GOAL_ROUNDING_S: Final = 0.15  # SUMO's speeds change in steps of 0.1 s
MAX_ACCEL_MPS2: Final = 4.0
MAX_BRAKE_MPS2: Final = 8.0
WANDER_LENGTH_M: Final = 50.0  # correlation length of a driver's drift within the lane
WANDER_ROUNDING_M: Final = 6.0  # the drift's own smoothness, so that it adds hardly any curvature


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """The bicycle's motion, one row per step."""

    poses_m: FloatArray  # (N, 3) rear axle, heading not wrapped
    speed_mps: FloatArray  # (N,) of the rear axle
    yaw_rate_radps: FloatArray  # (N,)
    u_m: FloatArray  # (N,) progress along the path


class EgoCar(Vehicle):  # type: ignore[misc]
    """highway-env's bicycle with a real wheelbase; its position is the middle between the axles, its LENGTH their distance."""

    LENGTH = WHEELBASE_M
    MAX_SPEED = 60.0

    @property
    def rear_axle_m(self) -> tuple[float, float]:
        half = 0.5 * self.LENGTH
        return self.position[0] - half * math.cos(self.heading), self.position[1] - half * math.sin(self.heading)


def comfortable_speed_mps(path: Path, limit_mps: FloatArray, spec: EgoSpec) -> FloatArray:
    """Highest du/dt (n,) along a path: the limit, v^2 kappa <= a_lat, v kappa <= yaw limit, braking in time for the rest."""
    curvature = np.maximum(np.abs(path.curvature_1pm), 1e-6)
    bends = np.minimum(np.sqrt(spec.lateral_accel_mps2 / curvature), MAX_YAW_RATE_RADPS / curvature)
    allowed = np.minimum(limit_mps, np.maximum(bends, MIN_CREEP_MPS) / path.stretch)
    braking = 2.0 * spec.decel_mps2 * STEP_M * np.arange(len(allowed))
    # v(i)^2 <= v(j)^2 + 2 b (u_j - u_i) for all j >= i
    latest = np.minimum.accumulate((allowed**2 + braking)[::-1])[::-1]
    speed: FloatArray = np.sqrt(latest - braking)
    return speed


def wander_m(count: int, sigma_m: float, rng: np.random.Generator) -> FloatArray:
    """Smooth Ornstein-Uhlenbeck drift (count,) along the path: deviation ``sigma_m``, correlated over ``WANDER_LENGTH_M``."""
    decay = math.exp(-STEP_M / WANDER_LENGTH_M)
    warm_up = int(4 * WANDER_LENGTH_M / STEP_M)
    noise = rng.standard_normal(count + warm_up) * math.sqrt(1.0 - decay**2)
    drift = gaussian_filter1d(lfilter([1.0], [1.0, -decay], noise), WANDER_ROUNDING_M / STEP_M)[warm_up:]
    drift *= sigma_m
    return np.asarray(drift, dtype=np.float64)


def follow(path: Path, goal_u_m: FloatArray, step_s: float) -> Track:
    """Drives the bicycle along the path so that its rear axle is at ``goal_u_m[i]`` (N,) at time ``i * step_s``.

    Steering: kappa = kappa_path - e / l^2 - 2 psi / l, critically damped over the length l (Samson, 1993, linearised).
    The position on the path is carried along and never searched, so self-crossing paths cannot confuse it.
    """
    goal_speed = gaussian_filter1d(np.gradient(goal_u_m, step_s), GOAL_ROUNDING_S / step_s, mode="nearest")
    goal_accel = np.gradient(goal_speed, step_s)
    x, y = path.points_m.T.tolist()
    heading, curvature, stretch = path.heading_rad.tolist(), path.curvature_1pm.tolist(), path.stretch.tolist()
    last = len(x) - 2

    def at(values: list[float], where: float) -> float:
        k = min(max(where / STEP_M, 0.0), last + 0.999)
        i = int(k)
        return values[i] + (k - i) * (values[i + 1] - values[i])

    u, steering = float(goal_u_m[0]), 0.0
    psi0 = at(heading, u)
    centre = (at(x, u) + 0.5 * WHEELBASE_M * math.cos(psi0), at(y, u) + 0.5 * WHEELBASE_M * math.sin(psi0))
    car = EgoCar(None, centre, psi0, float(goal_speed[0] * at(stretch, u)))
    rows = np.empty((len(goal_u_m), 6))
    for i, (goal, speed_wanted, accel_wanted) in enumerate(
        zip(goal_u_m.tolist(), goal_speed.tolist(), goal_accel.tolist(), strict=True)
    ):
        rear_x, rear_y = car.rear_axle_m
        psi, kappa = at(heading, u), math.tan(steering) / WHEELBASE_M
        dx, dy = rear_x - at(x, u), rear_y - at(y, u)
        metres_per_u = at(stretch, u)
        u = max(u, u + (math.cos(psi) * dx + math.sin(psi) * dy) / metres_per_u)
        offset = math.cos(psi) * dy - math.sin(psi) * dx
        turn = car.heading - psi
        slip = math.atan(0.5 * math.tan(steering))
        speed = car.speed * math.cos(slip)
        rows[i] = rear_x, rear_y, car.heading, speed, speed * kappa, u

        decay = max(ERROR_DECAY_M, ERROR_DECAY_S * speed)
        wanted = at(curvature, u + PREVIEW_S * speed) - offset / decay**2 - 2.0 * turn / decay
        most = min(MAX_CURVATURE_1PM, LIMIT_LATERAL_MPS2 / max(speed, 0.1) ** 2, LIMIT_YAW_RADPS / max(speed, 0.1))
        steering = _towards(steering, math.atan(WHEELBASE_M * min(max(wanted, -most), most)), MAX_STEERING_RATE_RADPS * step_s)
        accel = (
            accel_wanted * metres_per_u
            + SPEED_GAIN_1PS * (speed_wanted * metres_per_u - speed)
            + PROGRESS_GAIN_1PS2 * min(max(goal - u, -MAX_LAG_M), MAX_LAG_M) * metres_per_u
        )
        bend = max(abs(wanted), abs(kappa), 1e-6)
        safe = max(min(math.sqrt(LIMIT_LATERAL_MPS2 / bend), LIMIT_YAW_RADPS / bend), MIN_CREEP_MPS)
        accel = min(accel, MAX_ACCEL_MPS2, (safe - speed) * SAFE_GAIN_1PS)
        accel = max(accel, -MAX_BRAKE_MPS2, -car.speed / step_s)
        car.act({"steering": steering, "acceleration": accel})
        car.step(step_s)
    return Track(rows[:, :3], rows[:, 3], rows[:, 4], rows[:, 5])


def _towards(value: float, goal: float, most: float) -> float:
    return value + min(max(goal - value, -most), most)
