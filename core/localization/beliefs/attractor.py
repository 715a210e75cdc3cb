"""Pose belief of the localizer: head-direction ring, grid-cell tori and a scale cell, coupled through path integration.

Each network follows Eqs. (3)-(7) and (13)-(16), Li et al. 2025, on its own. What the equations lack is that path integration
ties them together: a heading error becomes a position error across the track, a scale error one along it. The couplings are
those covariances, of each population its own while the two are in conflict. With them an injection of a pose reaches every
network as an injection of its own, Eqs. (13)-(14): one whose mean and reliability leave the belief of Eqs. (15)-(16) where the
whole evidence puts it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from hippodrome.core.attractors import grid_cells, head_direction
from hippodrome.core.attractors.attractor import CALIBRATION, INTEGRATOR
from hippodrome.core.attractors.grid_cells import GridState
from hippodrome.core.attractors.head_direction import HeadDirectionState
from hippodrome.core.localization.beliefs.motion import (
    Motion,
    correction,
    displacement_m,
    innovation,
    predicted_covariance,
)
from hippodrome.core.localization.config import Injection, LocalizerConfig
from hippodrome.core.types import FloatArray

BROADEST_RAD = 1.0  # a heading less certain than this carries no direction that a coupling could learn
LEAST_LEFT = 0.5  # share of a variance that one motion may take away (driving back undoes what driving on did)


@dataclass(frozen=True, slots=True, eq=False)
class Ties:
    """What one population knows beyond the rings: its sheet, its scale, and how its errors hang together."""

    position_m: FloatArray  # (2,) tells the sheet of the tori
    log_scale: float  # ln(metres per map unit of this drive)
    coupling: FloatArray  # (4, 4) covariances of x, y, heading and log scale; of the diagonal only the scale's variance is used


@dataclass(frozen=True, slots=True, eq=False)
class AttractorPose:
    """State of the networks. While a challenger is up, the calibration cells hold it and the integrators the incumbent."""

    head: HeadDirectionState
    grid: GridState
    ties: tuple[Ties, Ties]  # of the integrators and of the calibration cells; without a challenger the same
    challenged: bool
    config: LocalizerConfig
    _incumbent: tuple[FloatArray, FloatArray] = field(init=False, repr=False)  # pose (3,), covariance (4, 4): asked for often

    def __post_init__(self) -> None:
        object.__setattr__(self, "_incumbent", self._belief(INTEGRATOR))

    @classmethod
    def uniform(cls, start_m: FloatArray, log_scale: float, config: LocalizerConfig) -> Self:
        """No prior knowledge but the map's scale; ``start_m`` (2,) only serves as a place to count sheets from."""
        ties = Ties(start_m, log_scale, np.diag([0.0, 0.0, 0.0, config.motion.scale_prior**2]))
        return cls(
            head=head_direction.uniform(config.head),
            grid=grid_cells.uniform(grid_cells.module_periods(config.smallest_period_m), config.grid),
            ties=(ties, ties),
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

    @property
    def log_scale(self) -> float:
        """ln(metres per map unit of this drive), the incumbent's."""
        return self.ties[INTEGRATOR].log_scale

    def predict(self, motion: Motion) -> Self:
        """Path integration, then inhibition; reliabilities fade by the motion's noise and by what the couplings pass on."""
        inte = self._moved(INTEGRATOR, motion)
        cali = self._moved(CALIBRATION, motion) if self.challenged else inte
        added = np.stack([inte.added, cali.added])
        turned = motion.turned_rad / motion.dt_s, motion.dt_s
        head = head_direction.integrate(self.head, *turned, (float(added[INTEGRATOR, 2]), float(added[CALIBRATION, 2])))
        grid = grid_cells.integrate(self.grid, np.stack([inte.step_m, cali.step_m]), added[:, :2])
        return replace(
            self,
            head=head_direction.inhibit(head, motion.dt_s, self.config.head),
            grid=grid_cells.inhibit(grid, motion.dt_s, self.config.grid),
            ties=(inte.ties, cali.ties),
        )

    def _moved(self, population: int, motion: Motion) -> _Moved:
        pose, covariance = self._incumbent if population == INTEGRATOR else self._belief(population)
        ties = self.ties[population]
        heading_rad = float(pose[2])
        grown = predicted_covariance(covariance, heading_rad, ties.log_scale, motion, self.config.motion)
        variance = np.diag(covariance)[:3]
        least = np.zeros(3) if self.challenged else (LEAST_LEFT - 1.0) * variance
        added = np.maximum(np.diag(grown)[:3] - variance, least)
        step_m = np.array(displacement_m(heading_rad, ties.log_scale, motion))
        return _Moved(step_m, added, Ties(ties.position_m + step_m, ties.log_scale, grown))

    def sq_distance(self, injection: Injection, challenger: bool = False) -> float:
        """Squared Mahalanobis distance of the injection from the incumbent or the challenger."""
        pose, covariance = self._belief(CALIBRATION) if challenger else self._incumbent
        difference = innovation(pose, injection)
        covariance = covariance[:3, :3] + injection.covariance
        return float(difference @ np.linalg.solve(covariance, difference))

    def inject(self, injection: Injection) -> Self:
        """An injection that agrees with the incumbent: Eqs. (13)-(16) and hand-back in each network."""
        settled = self._settle(INTEGRATOR) if self.challenged else self
        share = settled._share(INTEGRATOR, injection)
        head = head_direction.inject(settled.head, float(share.pose[2]), float(share.reliability[2]), self.config.head)
        grid = grid_cells.inject(settled.grid, share.pose[:2], share.reliability[:2], self.config.grid)
        position_m, _ = grid_cells.read_out(grid, share.ties.position_m)
        ties = replace(share.ties, position_m=position_m)
        return replace(settled, head=head, grid=grid, ties=(ties, ties))

    def reinforce(self, injection: Injection) -> Self:
        """An injection that agrees with the challenger: Eqs. (13)-(14), no hand-back."""
        share = self._share(CALIBRATION, injection)
        head = head_direction.stimulate(self.head, float(share.pose[2]), float(share.reliability[2]))
        grid = grid_cells.stimulate(self.grid, share.pose[:2], share.reliability[:2])
        position_m, _ = grid_cells.population_belief(grid, CALIBRATION, share.ties.position_m)
        return replace(self, head=head, grid=grid, ties=(self.ties[INTEGRATOR], replace(share.ties, position_m=position_m)))

    def _share(self, population: int, injection: Injection) -> _Share:
        """What the networks have to be given so that Eqs. (13)-(16) leave them at the joint belief of all four quantities."""
        (pose, covariance), ties = self._belief(population), self.ties[population]
        shift, after = correction(covariance, innovation(pose, injection), injection)
        before = np.diag(covariance)[:3]
        left = np.diag(after)[:3] / before
        quarter = 0.25 * self.grid.period[0]  # farther away, a virtual position would change sheets
        offset = np.clip(shift[:3] / (1.0 - left), [-quarter, -quarter, -0.5 * math.pi], [quarter, quarter, 0.5 * math.pi])
        reached = Ties(pose[:2] + shift[:2], ties.log_scale + float(shift[3]), after)
        return _Share(pose + offset, (1.0 / left - 1.0) / before, reached)

    def challenge(self, injection: Injection) -> Self:
        """A conflicting injection: the calibration cells leave for it, the integrators stay."""
        xy_m, heading_rad = injection.pose[:2], float(injection.pose[2])
        sq, incumbent = np.diag(injection.covariance), self.ties[INTEGRATOR]
        coupling = np.zeros((4, 4))
        coupling[:3, :3], coupling[3, 3] = injection.covariance, incumbent.coupling[3, 3]
        return replace(
            self,
            head=head_direction.challenge(self.head, heading_rad, 1.0 / sq[2]),
            grid=grid_cells.challenge(self.grid, xy_m, 1.0 / sq[:2]),
            ties=(incumbent, Ties(xy_m, incumbent.log_scale, coupling)),
            challenged=True,
        )

    def adopt(self) -> Self:
        """The challenger has won: a snap, and what was learned about the incumbent's errors is void."""
        return self._settle(CALIBRATION)

    def _settle(self, population: int) -> Self:
        return replace(
            self,
            head=head_direction.adopt(self.head, population, self.config.head),
            grid=grid_cells.adopt(self.grid, population, self.config.grid),
            ties=(self.ties[population], self.ties[population]),
            challenged=False,
        )

    def _belief(self, population: int) -> tuple[FloatArray, FloatArray]:
        """Pose (3,) and covariance (4, 4) of one side while they are in conflict, else of both fused."""
        ties = self.ties[population]
        if self.challenged:
            heading_rad, r_heading = float(self.head.mean_rad[population]), float(self.head.reliability[population])
            xy_m, r_position = grid_cells.population_belief(self.grid, population, ties.position_m)
        else:
            heading_rad, r_heading = head_direction.read_out(self.head)
            xy_m, r_position = grid_cells.read_out(self.grid, ties.position_m)
        covariance = ties.coupling.copy()
        covariance[[0, 1, 2], [0, 1, 2]] = [1.0 / r_position[0], 1.0 / r_position[1], min(1.0 / r_heading, BROADEST_RAD**2)]
        return np.array([*xy_m, heading_rad]), covariance


@dataclass(frozen=True, slots=True, eq=False)
class _Moved:
    """What self-motion does to one population."""

    step_m: FloatArray  # (2,)
    added: FloatArray  # (3,) to the variances: m^2, m^2, rad^2
    ties: Ties


@dataclass(frozen=True, slots=True, eq=False)
class _Share:
    """An injection as the networks get it, each on its own, and the ties that go with it."""

    pose: FloatArray  # (3,)
    reliability: FloatArray  # (3,) 1/m^2, 1/m^2, 1/rad^2
    ties: Ties
