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
LEAST_LEFT = 0.5  # share of a variance that one motion must leave: driving back undoes what driving on has added


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
    joint: tuple[JointEstimate, JointEstimate]  # of integrators and calibration cells; the same while there is no challenger
    challenged: bool
    config: BeliefConfig
    _incumbent: tuple[FloatArray, FloatArray] = field(init=False, repr=False)  # cached: pose (3,), covariance (4, 4)
    keeps_challenger: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "_incumbent", self._estimate(INTEGRATOR))

    @classmethod
    def uniform(cls, start_m: FloatArray, log_scale: float, config: BeliefConfig) -> Self:
        """Return a belief that knows nothing but the map's scale.

        A torus repeats its positions. Until a pose is measured, the read-out is the repetition near ``start_m`` (2,), any point
        of the map.
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
        """The fused pose (3,) of both populations, Eqs. (15)-(16); while there is a challenger, that of the integrators alone."""
        return self._incumbent[0].copy()

    @property
    def covariance(self) -> FloatArray:
        """Covariance (3, 3) of ``pose``."""
        return self._incumbent[1][:3, :3].copy()

    @property
    def log_scale(self) -> float:
        """ln(metres per map unit of this drive), as the incumbent estimates it."""
        return self.joint[INTEGRATOR].log_scale

    def activity(self) -> NetworkActivity:
        """State of the head-direction and grid-cell networks, which the estimate reports."""
        return network_activity(self.head, self.grid)

    def predict(self, motion: Motion) -> Self:
        """Path integration in both networks, then inhibition between their populations.

        Reliabilities fall by the noise of the motion, and by the errors of heading and scale that the motion turns into errors of
        the position.
        """
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
        """Predict one population: its step along its own heading and at its own scale, and the variance that the step adds.

        Without a challenger the added variance may be negative, since driving back undoes what driving on has added; the share
        ``LEAST_LEFT`` of the variance remains at least.
        """
        pose, covariance = self._incumbent if population == INTEGRATOR else self._estimate(population)
        joint = self.joint[population]
        heading_rad = float(pose[2])
        predicted = predicted_covariance(covariance, heading_rad, joint.log_scale, motion, self.config.motion)
        variance = np.diag(covariance)[:3]
        least = np.zeros(3) if self.challenged else (LEAST_LEFT - 1.0) * variance
        added_variance = np.maximum(np.diag(predicted)[:3] - variance, least)
        step_m = np.array(displacement_m(heading_rad, joint.log_scale, motion))
        return _PathIntegration(step_m, added_variance, JointEstimate(joint.position_m + step_m, joint.log_scale, predicted))

    def sq_distance(self, measurement: PoseMeasurement, challenger: bool = False) -> float:
        """Squared Mahalanobis distance of a measured pose from the incumbent, or from the challenger."""
        pose, covariance = self._estimate(CALIBRATION) if challenger else self._incumbent
        difference = innovation(pose, measurement)
        return float(difference @ np.linalg.solve(covariance[:3, :3] + measurement.covariance, difference))

    def inject(self, measurement: PoseMeasurement) -> Self:
        """Update the incumbent with a measured pose that agrees with it, and dismiss the challenger.

        In each network Eqs. (13)-(14) inject the pose, and both populations then take over the fused belief (hand-back).
        """
        settled = self._settled_on(INTEGRATOR) if self.challenged else self
        given = settled._injections(INTEGRATOR, measurement)
        head = head_direction.inject(settled.head, float(given.pose[2]), float(given.reliability[2]), self.config.head)
        grid = grid_cells.inject(settled.grid, given.pose[:2], given.reliability[:2], self.config.grid)
        position_m, _ = grid_cells.read_out(grid, given.joint.position_m)
        joint = replace(given.joint, position_m=position_m)
        return replace(settled, head=head, grid=grid, joint=(joint, joint))

    def reinforce(self, measurement: PoseMeasurement) -> Self:
        """Update the challenger with a measured pose that agrees with it, by Eqs. (13)-(14) on the calibration cells.

        There is no hand-back, so that the integrators keep the incumbent.
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
        quarter_m = 0.25 * self.grid.period[0]  # farther away an injection could unwrap to a neighbouring repetition of a torus
        reach = [quarter_m, quarter_m, 0.5 * math.pi]
        offset = np.clip(shift[:3] / (1.0 - left), np.negative(reach), reach)
        reached = JointEstimate(pose[:2] + shift[:2], joint.log_scale + float(shift[3]), updated)
        return _Injections(pose + offset, (1.0 / left - 1.0) / variance, reached)

    def challenge(self, measurement: PoseMeasurement) -> Self:
        """Make a measured pose that conflicts with the belief the challenger; the integrators keep the incumbent.

        The calibration cells take over the measured pose with its covariance; the scale of the challenger is the incumbent's.
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
        """Make the challenger the incumbent: the integrators take over its pose, and the incumbent's covariances are dropped."""
        return self._settled_on(CALIBRATION)

    def _settled_on(self, population: int) -> Self:
        """End the conflict between incumbent and challenger: both populations take over the belief of ``population``."""
        return replace(
            self,
            head=head_direction.adopt(self.head, population, self.config.head),
            grid=grid_cells.adopt(self.grid, population, self.config.grid),
            joint=(self.joint[population], self.joint[population]),
            challenged=False,
        )

    def _estimate(self, population: int) -> tuple[FloatArray, FloatArray]:
        """Pose (3,) and covariance (4, 4) of one population while there is a challenger, else of both populations fused.

        The variances of the pose come from the reliabilities of the networks, all else in the covariance from ``joint``.
        """
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
    """The prediction of one population for one motion."""

    step_m: FloatArray  # (2,) displacement, x and y in the network frame
    added_variance: FloatArray  # (3,) of x, y, heading: m^2, m^2, rad^2
    joint: JointEstimate  # the joint estimate after the motion


@dataclass(frozen=True, slots=True, eq=False)
class _Injections:
    """What a measured pose injects into each network."""

    pose: FloatArray  # (3,) means for the tori and the ring
    reliability: FloatArray  # (3,) 1/m^2, 1/m^2, 1/rad^2
    joint: JointEstimate  # the joint estimate after the update
