"""Pose belief of the localizer: head-direction ring, grid-cell tori and a scale cell, coupled through path integration.

Each network follows Eqs. (3)-(7) and (13)-(16), Li et al. 2025, on its own. What the equations lack is that path integration
ties them together: a heading error becomes a position error across the track, a scale error one along it. The couplings are
those covariances. With them an injection of a pose reaches every network as an injection of its own, Eqs. (13)-(14): one whose
mean and reliability leave the fused belief of Eqs. (15)-(16) where the whole evidence puts it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from hippodrome.core import grid_cells, head_direction
from hippodrome.core.attractor import CALIBRATION, INTEGRATOR
from hippodrome.core.grid_cells import GridState
from hippodrome.core.head_direction import HeadDirectionState
from hippodrome.core.localizer_config import Injection, LocalizerConfig
from hippodrome.core.localizer_motion import Motion, correction, innovation, predicted_covariance
from hippodrome.core.types import FloatArray

BROADEST_RAD = 1.0  # a heading less certain than this carries no direction that a coupling could learn
LEAST_LEFT = 0.5  # share of a variance that one motion may take away (driving back undoes what driving on did)


@dataclass(frozen=True, slots=True, eq=False)
class AttractorPose:
    """State of the networks. While a challenger is up, the calibration cells hold it and the integrators the incumbent."""

    head: HeadDirectionState
    grid: GridState
    position_m: FloatArray  # (2 populations, 2) tells the sheet of the tori
    log_scale: float  # ln(metres per map unit of this drive)
    sq_sigma_scale: float
    coupling: FloatArray  # (4, 4) covariances of x, y, heading and log scale with one another; the diagonal is not used
    challenged: bool
    config: LocalizerConfig
    _incumbent: tuple[FloatArray, FloatArray] = field(init=False, repr=False)  # pose (3,), covariance (4, 4): asked for often

    def __post_init__(self) -> None:
        pose, reliability = self._belief(INTEGRATOR)
        object.__setattr__(self, "_incumbent", (pose, self._with_couplings(reliability, self.coupling)))

    @classmethod
    def uniform(cls, start_m: FloatArray, log_scale: float, config: LocalizerConfig) -> Self:
        """No prior knowledge but the map's scale; ``start_m`` (2,) only serves as a place to count sheets from."""
        return cls(
            head=head_direction.uniform(config.head),
            grid=grid_cells.uniform(grid_cells.module_periods(config.smallest_period_m), config.grid),
            position_m=np.tile(start_m, (2, 1)),
            log_scale=log_scale,
            sq_sigma_scale=config.motion.scale_prior**2,
            coupling=np.zeros((4, 4)),
            challenged=False,
            config=config,
        )

    @property
    def pose(self) -> FloatArray:
        """(3,) the read-out of Eqs. (15)-(16), of the incumbent alone while it is challenged."""
        return self._incumbent[0].copy()

    @property
    def covariance(self) -> FloatArray:
        """(3, 3) of ``pose``."""
        return self._incumbent[1][:3, :3].copy()

    def predict(self, motion: Motion) -> Self:
        """Path integration, then inhibition; reliabilities fade by the motion's noise and by what the couplings pass on."""
        covariance, heading_rad = self._incumbent[1], float(self._incumbent[0][2])
        grown = predicted_covariance(covariance, heading_rad, self.log_scale, motion, self.config.motion)
        variance = np.diag(covariance)
        least = np.zeros(4) if self.challenged else (LEAST_LEFT - 1.0) * variance
        added = np.maximum(np.diag(grown) - variance, least)
        distance_m = motion.travelled * math.exp(self.log_scale)
        step = grid_cells.displacement(self.head.mean_rad + 0.5 * motion.turned_rad, distance_m, 1.0)
        head = head_direction.integrate(self.head, motion.turned_rad / motion.dt_s, motion.dt_s, float(added[2]))
        grid = grid_cells.integrate(self.grid, step, added[:2])
        return replace(
            self,
            head=head_direction.inhibit(head, motion.dt_s, self.config.head),
            grid=grid_cells.inhibit(grid, motion.dt_s, self.config.grid),
            position_m=self.position_m + step,
            sq_sigma_scale=float(grown[3, 3]),
            coupling=grown,
        )

    def sq_distance(self, injection: Injection, challenger: bool = False) -> float:
        """Squared Mahalanobis distance of the injection from the incumbent or the challenger."""
        pose, covariance = self._challenger() if challenger else self._incumbent
        difference = innovation(pose, injection)
        covariance = covariance[:3, :3] + injection.covariance
        return float(difference @ np.linalg.solve(covariance, difference))

    def inject(self, injection: Injection) -> Self:
        """An injection that agrees with the incumbent: Eqs. (13)-(16) and hand-back in each network."""
        return self._settle(INTEGRATOR)._inject(injection) if self.challenged else self._inject(injection)

    def _inject(self, injection: Injection) -> Self:
        pose, covariance = self._incumbent
        shift, after = correction(covariance, innovation(pose, injection), injection)
        before = np.diag(covariance)
        left = np.diag(after) / before
        reliability = (1.0 / left - 1.0) / before
        quarter = 0.25 * self.grid.period[0]  # farther away, a virtual position would change sheets
        offset = np.clip(shift[:3] / (1.0 - left[:3]), [-quarter, -quarter, -0.5 * math.pi], [quarter, quarter, 0.5 * math.pi])
        grid = grid_cells.inject(self.grid, pose[:2] + offset[:2], reliability[:2], self.config.grid)
        xy_m, _ = grid_cells.read_out(grid, pose[:2] + shift[:2])
        return replace(
            self,
            head=head_direction.inject(self.head, float(pose[2] + offset[2]), float(reliability[2]), self.config.head),
            grid=grid,
            position_m=np.tile(xy_m, (2, 1)),
            log_scale=self.log_scale + float(shift[3]),
            sq_sigma_scale=float(after[3, 3]),
            coupling=after,
        )

    def challenge(self, injection: Injection) -> Self:
        """A conflicting injection: the calibration cells leave for it, the integrators stay."""
        xy_m, heading_rad = injection.pose[:2], float(injection.pose[2])
        sq = np.diag(injection.covariance)
        return replace(
            self,
            head=head_direction.challenge(self.head, heading_rad, 1.0 / sq[2]),
            grid=grid_cells.challenge(self.grid, xy_m, 1.0 / sq[:2]),
            position_m=np.stack([self.position_m[INTEGRATOR], xy_m]),
            challenged=True,
        )

    def reinforce(self, injection: Injection) -> Self:
        """An injection that agrees with the challenger: Eqs. (13)-(14), no hand-back."""
        sq = np.diag(injection.covariance)
        head = head_direction.stimulate(self.head, float(injection.pose[2]), 1.0 / sq[2])
        grid = grid_cells.stimulate(self.grid, injection.pose[:2], 1.0 / sq[:2])
        return replace(self, head=head, grid=grid)

    def adopt(self) -> Self:
        """The challenger has won: a snap, and what was learned about the incumbent's errors is void."""
        return replace(self._settle(CALIBRATION), coupling=np.zeros((4, 4)))

    def _settle(self, population: int) -> Self:
        return replace(
            self,
            head=head_direction.adopt(self.head, population, self.config.head),
            grid=grid_cells.adopt(self.grid, population, self.config.grid),
            position_m=np.tile(self.position_m[population], (2, 1)),
            challenged=False,
        )

    def _belief(self, population: int) -> tuple[FloatArray, FloatArray]:
        """Pose (3,) and reliabilities (3,) of one side while they are in conflict, else of both fused."""
        near = self.position_m[population]
        if self.challenged:
            heading_rad, r_heading = float(self.head.mean_rad[population]), float(self.head.reliability[population])
            xy_m, r_position = grid_cells.population_belief(self.grid, population, near)
        else:
            heading_rad, r_heading = head_direction.read_out(self.head)
            xy_m, r_position = grid_cells.read_out(self.grid, near)
        return np.array([*xy_m, heading_rad]), np.array([*r_position, r_heading])

    def _challenger(self) -> tuple[FloatArray, FloatArray]:
        """Pose (3,) and covariance (4, 4); it has learned no couplings yet."""
        pose, reliability = self._belief(CALIBRATION)
        return pose, self._with_couplings(reliability, np.zeros((4, 4)))

    def _with_couplings(self, reliability: FloatArray, coupling: FloatArray) -> FloatArray:
        """Covariance (4, 4) of reliabilities (3,), the scale's variance and couplings (4, 4)."""
        covariance = coupling.copy()
        heading = min(1.0 / reliability[2], BROADEST_RAD**2)
        covariance[[0, 1, 2, 3], [0, 1, 2, 3]] = [1.0 / reliability[0], 1.0 / reliability[1], heading, self.sq_sigma_scale]
        return covariance
