"""Mode "coupled": head-direction ring, grid-cell tori and a scale, coupled through path integration.

Each network follows Eqs. (3)-(7) and (13)-(16), Li et al. 2025, on its own. What the equations lack is that path integration
makes their errors depend on each other: a heading error becomes a position error across the track, a scale error one along it.
These cross-covariances are kept beside the networks, for each population of cells its own while the two are in conflict.

With them a measured pose reaches every network as an injection of its own, Eqs. (13)-(14), whose mean and reliability are chosen
such that the read-out of Eqs. (15)-(16) is the joint (Kalman) update of all four quantities.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from hippodrome.core.attractors import grid_cells, head_direction
from hippodrome.core.attractors.attractor import CALIBRATION, INTEGRATOR
from hippodrome.core.attractors.grid_cells import GridState
from hippodrome.core.attractors.head_direction import HeadDirectionState
from hippodrome.core.localization.beliefs.belief import NetworkActivity, network_activity
from hippodrome.core.localization.beliefs.config import BeliefConfig
from hippodrome.core.localization.beliefs.motion import (
    Motion,
    PoseMeasurement,
    displacement_m,
    innovation,
    kalman_update,
    predicted_covariance,
)
from hippodrome.core.types import FloatArray

BROADEST_RAD = 1.0  # largest standard deviation of the heading: with a larger one no cross-covariance could be learned
LEAST_LEFT = 0.5  # one motion leaves at least this share of a variance, where driving back undoes what driving out has added


@dataclass(frozen=True, slots=True, eq=False)
class JointEstimate:
    """What one population of cells knows beyond its ring and tori: the unwrapped position, the scale, and cross-covariances."""

    position_m: FloatArray  # (2,) the position, from which its phases on the tori are unwrapped
    log_scale: float  # ln(metres per map unit of this drive)
    cross_covariance: FloatArray  # (4, 4) of x, y, heading, log scale; on the diagonal only the variance of the scale is used


@dataclass(frozen=True, slots=True, eq=False)
class AttractorBelief:
    """State of the networks. While there is a challenger, the calibration cells hold it and the integrators the incumbent."""

    head: HeadDirectionState
    grid: GridState
    joint: tuple[JointEstimate, JointEstimate]  # for integrators and calibration cells; equal while there is no challenger
    challenged: bool
    config: BeliefConfig
    _incumbent: tuple[FloatArray, FloatArray] = field(init=False, repr=False)  # its pose (3,) and covariance (4, 4)
    keeps_challenger: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Decode the incumbent's estimate once, as many methods need it; a frozen dataclass allows no plain assignment."""
        object.__setattr__(self, "_incumbent", self._estimate(INTEGRATOR))

    @classmethod
    def uniform(cls, start_m: FloatArray, log_scale: float, config: BeliefConfig) -> Self:
        """The belief before the first observation, which knows only the map's scale.

        ``start_m`` (2,) is only a point from which phases are unwrapped.
        """
        joint = JointEstimate(start_m, log_scale, np.diag([0.0, 0.0, 0.0, config.motion.scale_prior**2]))
        return cls(
            head=head_direction.uniform(config.head),
            grid=grid_cells.uniform(grid_cells.module_periods(config.smallest_period_m), config.grid),
            joint=(joint, joint),
            challenged=False,
            config=config,
        )

    @property
    def pose(self) -> FloatArray:
        """The read-out (3,) of Eqs. (15)-(16), of the incumbent alone while it is challenged."""
        return self._incumbent[0].copy()

    @property
    def covariance(self) -> FloatArray:
        """Covariance (3, 3) of ``pose``."""
        return self._incumbent[1][:3, :3].copy()

    @property
    def log_scale(self) -> float:
        """ln(metres per map unit of this drive), as the incumbent has it."""
        return self.joint[INTEGRATOR].log_scale

    def activity(self) -> NetworkActivity:
        """The state of the two networks, for the estimate that is reported."""
        return network_activity(self.head, self.grid)

    def predict(self, motion: Motion) -> Self:
        """Path integration, then inhibition. Reliabilities fade by the motion's noise and by the errors that couple into them."""
        integrator = self._path_integrated(INTEGRATOR, motion)
        calibration = self._path_integrated(CALIBRATION, motion) if self.challenged else integrator
        added = np.stack([integrator.added_variance, calibration.added_variance])
        head = head_direction.integrate(
            self.head,
            motion.turned_rad / motion.dt_s,
            motion.dt_s,
            (float(added[INTEGRATOR, 2]), float(added[CALIBRATION, 2])),
        )
        grid = grid_cells.integrate(self.grid, np.stack([integrator.step_m, calibration.step_m]), added[:, :2])
        return replace(
            self,
            head=head_direction.inhibit(head, motion.dt_s, self.config.head),
            grid=grid_cells.inhibit(grid, motion.dt_s, self.config.grid),
            joint=(integrator.joint, calibration.joint),
        )

    def _path_integrated(self, population: int, motion: Motion) -> _PathIntegration:
        """What a motion does to one population, which has a heading and a scale of its own.

        A motion usually adds variance, but may also take some away: driving back undoes the error that driving out has added.
        While the populations agree, this is limited to the share 1 - ``LEAST_LEFT``, so that variances stay positive. While they
        are in conflict, no variance is taken away.
        """
        pose, covariance = self._incumbent if population == INTEGRATOR else self._estimate(population)
        joint = self.joint[population]
        heading_rad = float(pose[2])
        predicted = predicted_covariance(covariance, heading_rad, joint.log_scale, motion, self.config.motion)
        variance = np.diag(covariance)[:3]
        least_added = np.zeros(3) if self.challenged else (LEAST_LEFT - 1.0) * variance
        added_variance = np.maximum(np.diag(predicted)[:3] - variance, least_added)
        step_m = np.array(displacement_m(heading_rad, joint.log_scale, motion))
        return _PathIntegration(step_m, added_variance, JointEstimate(joint.position_m + step_m, joint.log_scale, predicted))

    def sq_distance(self, measurement: PoseMeasurement, challenger: bool = False) -> float:
        """Squared Mahalanobis distance of a measured pose from the incumbent, or from the challenger."""
        pose, covariance = self._estimate(CALIBRATION) if challenger else self._incumbent
        difference = innovation(pose, measurement)
        return float(difference @ np.linalg.solve(covariance[:3, :3] + measurement.covariance, difference))

    def inject(self, measurement: PoseMeasurement) -> Self:
        """The belief after a measured pose that agrees with the incumbent; a challenger is dismissed.

        Eqs. (13)-(16), Li et al. 2025, in each network, whose two populations then hold the same belief.
        """
        settled = self._settled_on(INTEGRATOR) if self.challenged else self
        given = settled._injections(INTEGRATOR, measurement)
        head = head_direction.inject(settled.head, float(given.pose[2]), float(given.reliability[2]), self.config.head)
        grid = grid_cells.inject(settled.grid, given.pose[:2], given.reliability[:2], self.config.grid)
        position_m, _ = grid_cells.read_out(grid, given.joint.position_m)
        joint = replace(given.joint, position_m=position_m)
        return replace(settled, head=head, grid=grid, joint=(joint, joint))

    def reinforce(self, measurement: PoseMeasurement) -> Self:
        """The belief after a measured pose that agrees with the challenger; the incumbent stays as it is.

        Eqs. (13)-(14), Li et al. 2025, in the calibration cells of each network, which hold the challenger.
        """
        given = self._injections(CALIBRATION, measurement)
        head = head_direction.stimulate(self.head, float(given.pose[2]), float(given.reliability[2]))
        grid = grid_cells.stimulate(self.grid, given.pose[:2], given.reliability[:2])
        position_m, _ = grid_cells.population_belief(grid, CALIBRATION, given.joint.position_m)
        joint = replace(given.joint, position_m=position_m)
        return replace(self, head=head, grid=grid, joint=(self.joint[INTEGRATOR], joint))

    def _injections(self, population: int, measurement: PoseMeasurement) -> _Injections:
        """The poses and reliabilities to inject so that Eqs. (13)-(16) bring each network to the joint Kalman update.

        If the Kalman update leaves the share ``left`` of a variance and shifts the mean by ``shift``, then so does the injection
        of the mean plus ``shift / (1 - left)`` with ``1 / left - 1`` times the reliability of the belief.
        """
        (pose, covariance), joint = self._estimate(population), self.joint[population]
        shift, updated = kalman_update(covariance, innovation(pose, measurement), measurement)
        variance = np.diag(covariance)[:3]
        left = np.diag(updated)[:3] / variance
        quarter_m = 0.25 * self.grid.period[0]  # an injection farther away could be unwrapped to the next period of a torus
        reach = [quarter_m, quarter_m, 0.5 * math.pi]
        offset = np.clip(shift[:3] / (1.0 - left), np.negative(reach), reach)
        reached = JointEstimate(pose[:2] + shift[:2], joint.log_scale + float(shift[3]), updated)
        return _Injections(pose + offset, (1.0 / left - 1.0) / variance, reached)

    def challenge(self, measurement: PoseMeasurement) -> Self:
        """The belief after a measured pose that conflicts with it: the calibration cells take this pose over as the challenger.

        The integrators keep the incumbent. The challenger starts with the incumbent's scale, of which the pose tells nothing.
        """
        position_m, heading_rad = measurement.pose[:2], float(measurement.pose[2])
        variance, incumbent = np.diag(measurement.covariance), self.joint[INTEGRATOR]
        covariance = np.zeros((4, 4))
        covariance[:3, :3], covariance[3, 3] = measurement.covariance, incumbent.cross_covariance[3, 3]
        return replace(
            self,
            head=head_direction.challenge(self.head, heading_rad, 1.0 / variance[2]),
            grid=grid_cells.challenge(self.grid, position_m, 1.0 / variance[:2]),
            joint=(incumbent, JointEstimate(position_m, incumbent.log_scale, covariance)),
            challenged=True,
        )

    def adopt(self) -> Self:
        """The challenger becomes the incumbent: the integrators take its pose over, with its scale and its covariances."""
        return self._settled_on(CALIBRATION)

    def _settled_on(self, population: int) -> Self:
        """The belief after a conflict: both populations hold what ``population`` believed, and there is no challenger."""
        return replace(
            self,
            head=head_direction.adopt(self.head, population, self.config.head),
            grid=grid_cells.adopt(self.grid, population, self.config.grid),
            joint=(self.joint[population], self.joint[population]),
            challenged=False,
        )

    def _estimate(self, population: int) -> tuple[FloatArray, FloatArray]:
        """Pose (3,) and covariance (4, 4) that a population believes in while the two are in conflict, else the fused ones."""
        joint = self.joint[population]
        if self.challenged:
            heading_rad, r_heading = float(self.head.mean_rad[population]), float(self.head.reliability[population])
            position_m, r_position = grid_cells.population_belief(self.grid, population, joint.position_m)
        else:
            heading_rad, r_heading = head_direction.read_out(self.head)
            position_m, r_position = grid_cells.read_out(self.grid, joint.position_m)
        covariance = joint.cross_covariance.copy()
        covariance[[0, 1, 2], [0, 1, 2]] = [1.0 / r_position[0], 1.0 / r_position[1], min(1.0 / r_heading, BROADEST_RAD**2)]
        return np.array([*position_m, heading_rad]), covariance


@dataclass(frozen=True, slots=True, eq=False)
class _PathIntegration:
    """What a motion does to one population."""

    step_m: FloatArray  # (2,) displacement to the east and to the north
    added_variance: FloatArray  # (3,) what is added to the variances of x, y and heading: m^2, m^2, rad^2
    joint: JointEstimate  # the estimate after the motion


@dataclass(frozen=True, slots=True, eq=False)
class _Injections:
    """What a measured pose injects into each network."""

    pose: FloatArray  # (3,) means for the tori (x, y) and the ring (heading)
    reliability: FloatArray  # (3,) 1/m^2, 1/m^2, 1/rad^2
    joint: JointEstimate  # the estimate after the injection
