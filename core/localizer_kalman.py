"""The yardstick: an extended Kalman filter over (x, y, heading, ln scale), given the same motions and injections."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from hippodrome.core.attractor import wrap
from hippodrome.core.localizer_config import Injection, LocalizerConfig
from hippodrome.core.types import FloatArray

UNKNOWN = np.diag([1e8, 1e8, 1e2])  # m^2, m^2, rad^2: no prior knowledge of the pose
SEEN = np.eye(3, 4)  # an injection sees x, y and heading


@dataclass(frozen=True, slots=True, eq=False)
class Gaussian:
    """``mean`` (4,) of (x_m, y_m, heading_rad, log_scale), ``covariance`` (4, 4)."""

    mean: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class KalmanPose:
    """An incumbent and, while injections conflict with it, a challenger."""

    incumbent: Gaussian
    challenger: Gaussian | None
    config: LocalizerConfig

    @classmethod
    def uniform(cls, start_m: FloatArray, log_scale: float, config: LocalizerConfig) -> Self:
        """No prior knowledge but the map's scale; ``start_m`` (2,) is the mean of a flat belief."""
        covariance = np.zeros((4, 4))
        covariance[:3, :3], covariance[3, 3] = UNKNOWN, config.motion.scale_prior**2
        return cls(Gaussian(np.array([start_m[0], start_m[1], 0.0, log_scale]), covariance), None, config)

    @property
    def pose(self) -> FloatArray:
        """(3,)."""
        return self.incumbent.mean[:3]

    @property
    def covariance(self) -> FloatArray:
        """(3, 3) of ``pose``."""
        return self.incumbent.covariance[:3, :3].copy()

    @property
    def challenged(self) -> bool:
        return self.challenger is not None

    def predict(self, travelled: float, turned_rad: float, dt_s: float) -> Self:
        """Motion over ``travelled`` map units."""
        challenger = None if self.challenger is None else _predict(self.challenger, travelled, turned_rad, dt_s, self.config)
        return replace(self, incumbent=_predict(self.incumbent, travelled, turned_rad, dt_s, self.config), challenger=challenger)

    def sq_distance(self, injection: Injection, challenger: bool = False) -> float:
        """Squared Mahalanobis distance of the injection from the incumbent or the challenger."""
        belief = self.challenger if challenger and self.challenger is not None else self.incumbent
        innovation = _innovation(belief, injection)
        return float(innovation @ np.linalg.solve(belief.covariance[:3, :3] + injection.covariance, innovation))

    def inject(self, injection: Injection) -> Self:
        """Measurement update; the challenger is dismissed."""
        return replace(self, incumbent=_update(self.incumbent, injection), challenger=None)

    def challenge(self, injection: Injection) -> Self:
        """A conflicting injection: a second hypothesis with the incumbent's scale."""
        covariance = np.zeros((4, 4))
        covariance[:3, :3], covariance[3, 3] = injection.covariance, self.incumbent.covariance[3, 3]
        return replace(self, challenger=Gaussian(np.append(injection.pose, self.incumbent.mean[3]), covariance))

    def reinforce(self, injection: Injection) -> Self:
        """Measurement update of the challenger."""
        return replace(self, challenger=None if self.challenger is None else _update(self.challenger, injection))

    def adopt(self) -> Self:
        """The challenger has won."""
        return replace(self, incumbent=self.challenger or self.incumbent, challenger=None)


def _predict(belief: Gaussian, travelled: float, turned_rad: float, dt_s: float, config: LocalizerConfig) -> Gaussian:
    noise, (x_m, y_m, heading_rad, log_scale) = config.motion, belief.mean
    distance_m = travelled * math.exp(log_scale)
    direction = heading_rad + 0.5 * turned_rad
    along = distance_m * np.array([math.cos(direction), math.sin(direction)])
    transition = np.eye(4)
    transition[:2, 2], transition[:2, 3] = (-along[1], along[0]), along
    covariance = transition @ belief.covariance @ transition.T
    covariance[:2, :2] += noise.speed**2 / dt_s * np.outer(along, along)
    covariance[2, 2] += noise.gyro_rad_per_sqrt_s**2 * dt_s + (noise.gyro_gain * turned_rad) ** 2
    covariance[3, 3] += noise.scale_walk_per_sqrt_m**2 * abs(distance_m)
    mean = np.array([x_m + along[0], y_m + along[1], wrap(heading_rad + turned_rad), log_scale])
    return Gaussian(mean, covariance)


def _innovation(belief: Gaussian, injection: Injection) -> FloatArray:
    innovation = injection.pose - belief.mean[:3]
    innovation[2] = wrap(innovation[2])
    return innovation


def _update(belief: Gaussian, injection: Injection) -> Gaussian:
    gain = np.linalg.solve(belief.covariance[:3, :3] + injection.covariance, SEEN @ belief.covariance).T
    mean = belief.mean + gain @ _innovation(belief, injection)
    mean[2] = wrap(mean[2])
    left = np.eye(4) - gain @ SEEN
    covariance = left @ belief.covariance @ left.T + gain @ injection.covariance @ gain.T  # Joseph form stays symmetric
    return Gaussian(mean, covariance)
