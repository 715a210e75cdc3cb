"""The yardstick: an extended Kalman filter over (x, y, heading, ln scale), given the same motions and injections."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from hippodrome.core.localization.beliefs.motion import (
    Motion,
    correction,
    displacement_m,
    innovation,
    predicted_covariance,
)
from hippodrome.core.localization.config import Injection, LocalizerConfig
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray

UNKNOWN = np.diag([1e8, 1e8, 1e2])  # m^2, m^2, rad^2: no prior knowledge of the pose


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
    def log_scale(self) -> float:
        """ln(metres per map unit of this drive)."""
        return float(self.incumbent.mean[3])

    @property
    def challenged(self) -> bool:
        return self.challenger is not None

    def predict(self, motion: Motion) -> Self:
        """Both beliefs moved."""
        challenger = None if self.challenger is None else _predict(self.challenger, motion, self.config)
        return replace(self, incumbent=_predict(self.incumbent, motion, self.config), challenger=challenger)

    def sq_distance(self, injection: Injection, challenger: bool = False) -> float:
        """Squared Mahalanobis distance of the injection from the incumbent or the challenger."""
        belief = self.challenger if challenger and self.challenger is not None else self.incumbent
        difference = innovation(belief.mean[:3], injection)
        return float(difference @ np.linalg.solve(belief.covariance[:3, :3] + injection.covariance, difference))

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


def _predict(belief: Gaussian, motion: Motion, config: LocalizerConfig) -> Gaussian:
    x_m, y_m, heading_rad, log_scale = belief.mean.tolist()
    east_m, north_m = displacement_m(heading_rad, log_scale, motion)
    mean = np.array([x_m + east_m, y_m + north_m, wrap_compiled(heading_rad + motion.turned_rad), log_scale])
    return Gaussian(mean, predicted_covariance(belief.covariance, heading_rad, log_scale, motion, config.motion))


def _update(belief: Gaussian, injection: Injection) -> Gaussian:
    shift, covariance = correction(belief.covariance, innovation(belief.mean[:3], injection), injection)
    mean = belief.mean + shift
    mean[2] = wrap_compiled(mean[2])
    return Gaussian(mean, covariance)
