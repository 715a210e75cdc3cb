"""Mode "kalman", a yardstick: an extended Kalman filter over (x, y, heading, log scale) with a challenger."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from hippodrome.core.localization.beliefs.belief import NetworkActivity, no_networks
from hippodrome.core.localization.beliefs.config import BeliefConfig
from hippodrome.core.localization.beliefs.motion import (
    Motion,
    PoseMeasurement,
    displacement_m,
    innovation,
    kalman_update,
    predicted_covariance,
)
from hippodrome.core.se2 import wrap_compiled
from hippodrome.core.types import FloatArray

UNKNOWN = np.diag([1e8, 1e8, 1e2])  # m^2, m^2, rad^2: no prior knowledge of the pose


@dataclass(frozen=True, slots=True, eq=False)
class Gaussian:
    """``mean`` (4,) of (x_m, y_m, heading_rad, log_scale), ``covariance`` (4, 4)."""

    mean: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class KalmanBelief:
    """An incumbent and, while measured poses conflict with it, a challenger."""

    incumbent: Gaussian
    challenger: Gaussian | None
    config: BeliefConfig
    keeps_challenger: ClassVar[bool] = True

    @classmethod
    def uniform(cls, start_m: FloatArray, log_scale: float, config: BeliefConfig) -> Self:
        """Return a belief that knows nothing but the map's scale: almost flat about ``start_m`` (2,), any point of the map."""
        covariance = np.zeros((4, 4))
        covariance[:3, :3], covariance[3, 3] = UNKNOWN, config.motion.scale_prior**2
        return cls(Gaussian(np.array([start_m[0], start_m[1], 0.0, log_scale]), covariance), None, config)

    @property
    def pose(self) -> FloatArray:
        """Mean pose (3,) of the incumbent."""
        return self.incumbent.mean[:3]

    @property
    def covariance(self) -> FloatArray:
        """Covariance (3, 3) of ``pose``: m, m, rad."""
        return self.incumbent.covariance[:3, :3].copy()

    @property
    def log_scale(self) -> float:
        """The incumbent's mean of ln(metres per map unit of this drive)."""
        return float(self.incumbent.mean[3])

    @property
    def challenged(self) -> bool:
        """Whether there is a challenger at present."""
        return self.challenger is not None

    def activity(self) -> NetworkActivity:
        """Report the heading only, since a Kalman filter has no networks."""
        return no_networks(self.incumbent.mean[2], self.incumbent.covariance[2, 2])

    def predict(self, motion: Motion) -> Self:
        """Move the incumbent, and the challenger if there is one, each along its own heading and at its own scale."""
        challenger = None if self.challenger is None else _predicted(self.challenger, motion, self.config)
        return replace(self, incumbent=_predicted(self.incumbent, motion, self.config), challenger=challenger)

    def sq_distance(self, measurement: PoseMeasurement, challenger: bool = False) -> float:
        """Squared Mahalanobis distance of a measured pose from the incumbent, or from the challenger."""
        belief = self.challenger if challenger and self.challenger is not None else self.incumbent
        difference = innovation(belief.mean[:3], measurement)
        return float(difference @ np.linalg.solve(belief.covariance[:3, :3] + measurement.covariance, difference))

    def inject(self, measurement: PoseMeasurement) -> Self:
        """Update the incumbent with a measured pose that agrees with it, and dismiss the challenger."""
        return replace(self, incumbent=_updated(self.incumbent, measurement), challenger=None)

    def challenge(self, measurement: PoseMeasurement) -> Self:
        """Make a measured pose that conflicts with the belief the challenger; it begins with the incumbent's scale."""
        covariance = np.zeros((4, 4))
        covariance[:3, :3], covariance[3, 3] = measurement.covariance, self.incumbent.covariance[3, 3]
        return replace(self, challenger=Gaussian(np.append(measurement.pose, self.incumbent.mean[3]), covariance))

    def reinforce(self, measurement: PoseMeasurement) -> Self:
        """Update the challenger with a measured pose that agrees with it; the incumbent stays."""
        return replace(self, challenger=None if self.challenger is None else _updated(self.challenger, measurement))

    def adopt(self) -> Self:
        """The challenger becomes the incumbent."""
        return replace(self, incumbent=self.challenger or self.incumbent, challenger=None)


def _predicted(belief: Gaussian, motion: Motion, config: BeliefConfig) -> Gaussian:
    """Prediction step of the filter: the belief after a motion along its own heading and at its own scale."""
    x_m, y_m, heading_rad, log_scale = belief.mean.tolist()
    east_m, north_m = displacement_m(heading_rad, log_scale, motion)
    mean = np.array([x_m + east_m, y_m + north_m, wrap_compiled(heading_rad + motion.turned_rad), log_scale])
    return Gaussian(mean, predicted_covariance(belief.covariance, heading_rad, log_scale, motion, config.motion))


def _updated(belief: Gaussian, measurement: PoseMeasurement) -> Gaussian:
    """Update step of the filter: the belief after a measured pose."""
    shift, covariance = kalman_update(belief.covariance, innovation(belief.mean[:3], measurement), measurement)
    mean = belief.mean + shift
    mean[2] = wrap_compiled(mean[2])
    return Gaussian(mean, covariance)
