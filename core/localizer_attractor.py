"""Pose belief of the localizer: head-direction ring, grid-cell tori and a scale cell, coupled through path integration.

Each network follows Eqs. (3)-(7) and (13)-(16), Li et al. 2025, on its own. What the equations lack is that path integration
ties them together: a heading error becomes a position error across the track, a scale error one along it. The couplings below
are those two covariances, so that an injection into the grid cells also reaches the head direction and the scale, each as an
injection of its own, Eqs. (13)-(14).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from hippodrome.core import grid_cells, head_direction
from hippodrome.core.attractor import CALIBRATION, INTEGRATOR, wrap
from hippodrome.core.grid_cells import GridState
from hippodrome.core.head_direction import HeadDirectionState
from hippodrome.core.localizer_config import Injection, LocalizerConfig
from hippodrome.core.types import FloatArray

LEAST_LEFT = 0.05  # share of a variance that one coupled injection leaves
BROADEST_RAD = 1.0  # a heading less certain than this carries no direction that a coupling could learn


@dataclass(frozen=True, slots=True, eq=False)
class AttractorPose:
    """State of the networks. While a challenger is up, the calibration cells hold it and the integrators the incumbent."""

    head: HeadDirectionState
    grid: GridState
    position_m: FloatArray  # (2 populations, 2) tells the sheet of the tori
    log_scale: float  # ln(metres per map unit of this drive)
    sq_sigma_scale: float
    coupling_scale: FloatArray  # (2,) covariance of position and log scale, m
    coupling_heading: FloatArray  # (2,) covariance of position and heading, m rad
    challenged: bool
    config: LocalizerConfig

    @classmethod
    def uniform(cls, start_m: FloatArray, log_scale: float, config: LocalizerConfig) -> Self:
        """No prior knowledge but the map's scale; ``start_m`` (2,) only serves as a place to count sheets from."""
        return cls(
            head=head_direction.uniform(config.head),
            grid=grid_cells.uniform(grid_cells.module_periods(config.smallest_period_m), config.grid),
            position_m=np.tile(start_m, (2, 1)),
            log_scale=log_scale,
            sq_sigma_scale=config.motion.scale_prior**2,
            coupling_scale=np.zeros(2),
            coupling_heading=np.zeros(2),
            challenged=False,
            config=config,
        )

    @property
    def pose(self) -> FloatArray:
        """(3,) the read-out of Eqs. (15)-(16), of the incumbent alone while it is challenged."""
        heading_rad, _, xy_m, _ = self._belief(INTEGRATOR)
        return np.array([xy_m[0], xy_m[1], heading_rad])

    @property
    def covariance(self) -> FloatArray:
        """(3, 3) of ``pose``."""
        return self._covariance(INTEGRATOR)

    def predict(self, travelled: float, turned_rad: float, dt_s: float) -> Self:
        """Path integration over ``travelled`` map units, then inhibition; uncertainty grows with the motion's own noise."""
        noise = self.config.motion
        heading_rad, sq_heading, _, sq_position = self._belief(INTEGRATOR)
        distance_m = travelled * math.exp(self.log_scale)
        step = grid_cells.displacement(self.head.mean_rad + 0.5 * turned_rad, distance_m, 1.0)
        direction = heading_rad + 0.5 * turned_rad
        along = distance_m * np.array([math.cos(direction), math.sin(direction)])
        across = np.array([-along[1], along[0]])
        sq_heading = min(sq_heading, BROADEST_RAD**2)
        grown = (
            2.0 * (along * self.coupling_scale + across * self.coupling_heading)
            + along**2 * (self.sq_sigma_scale + noise.speed**2 / dt_s)
            + across**2 * sq_heading
        )
        sq_turn = noise.gyro_rad_per_sqrt_s**2 * dt_s + (noise.gyro_gain * turned_rad) ** 2
        head = head_direction.integrate(self.head, turned_rad / dt_s, dt_s, sq_turn)
        grid = grid_cells.integrate(self.grid, step, np.maximum(grown, -0.5 * sq_position))
        return replace(
            self,
            head=head_direction.inhibit(head, dt_s, self.config.head),
            grid=grid_cells.inhibit(grid, dt_s, self.config.grid),
            position_m=self.position_m + step,
            sq_sigma_scale=self.sq_sigma_scale + noise.scale_walk_per_sqrt_m**2 * abs(distance_m),
            coupling_scale=self.coupling_scale + along * self.sq_sigma_scale,
            coupling_heading=self.coupling_heading + across * sq_heading,
        )

    def sq_distance(self, injection: Injection, challenger: bool = False) -> float:
        """Squared Mahalanobis distance of the injection from the incumbent or the challenger."""
        population = CALIBRATION if challenger else INTEGRATOR
        heading_rad, _, xy_m, _ = self._belief(population)
        innovation = injection.pose - np.array([xy_m[0], xy_m[1], heading_rad])
        innovation[2] = wrap(innovation[2])
        return float(innovation @ np.linalg.solve(self._covariance(population) + injection.covariance, innovation))

    def inject(self, injection: Injection) -> Self:
        """An injection that agrees with the incumbent: Eqs. (13)-(16) and hand-back, first by position, then by heading."""
        return self.dismiss()._inject_position(injection)._inject_heading(injection)

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
        return replace(self._settle(CALIBRATION), coupling_scale=np.zeros(2), coupling_heading=np.zeros(2))

    def dismiss(self) -> Self:
        """The incumbent has won."""
        return self._settle(INTEGRATOR) if self.challenged else self

    def _settle(self, population: int) -> Self:
        return replace(
            self,
            head=head_direction.adopt(self.head, population, self.config.head),
            grid=grid_cells.adopt(self.grid, population, self.config.grid),
            position_m=np.tile(self.position_m[population], (2, 1)),
            challenged=False,
        )

    def _belief(self, population: int) -> tuple[float, float, FloatArray, FloatArray]:
        """Heading, its variance, position (2,) and its variances (2,) of one side, or of both where they are one."""
        near = self.position_m[population]
        if not self.challenged:
            heading_rad, r_heading = head_direction.read_out(self.head)
            xy_m, r_position = grid_cells.read_out(self.grid, near)
        else:
            heading_rad, r_heading = float(self.head.mean_rad[population]), float(self.head.reliability[population])
            xy_m, r_position = grid_cells.population_belief(self.grid, population, near)
        return heading_rad, 1.0 / r_heading, xy_m, 1.0 / r_position

    def _covariance(self, population: int) -> FloatArray:
        _, sq_heading, _, sq_position = self._belief(population)
        covariance = np.diag([sq_position[0], sq_position[1], sq_heading])
        if population == INTEGRATOR:
            limit = 0.7 * np.sqrt(sq_position * sq_heading)  # two axes at 0.7: keeps the matrix positive definite
            covariance[:2, 2] = covariance[2, :2] = np.clip(self.coupling_heading, -limit, limit)
        return covariance

    def _inject_position(self, injection: Injection) -> Self:
        heading_rad, sq_heading, xy_m, sq_position = self._belief(INTEGRATOR)
        innovation, noise = injection.pose[:2] - xy_m, injection.covariance[:2, :2]
        turn, kept_heading, left_heading = _coupled(self.coupling_heading, innovation, sq_position, noise, sq_heading)
        stretch, kept_scale, left_scale = _coupled(self.coupling_scale, innovation, sq_position, noise, self.sq_sigma_scale)
        head = self.head
        if 0.0 < abs(turn) < 0.5 * math.pi * (1.0 - left_heading):  # beyond it the virtual heading would wrap round the ring
            virtual_rad = heading_rad + turn / (1.0 - left_heading)
            head = head_direction.inject(head, virtual_rad, (1.0 / left_heading - 1.0) / sq_heading, self.config.head)
        grid = grid_cells.inject(self.grid, injection.pose[:2], 1.0 / np.diag(noise), self.config.grid)
        return replace(
            self,
            head=head,
            grid=grid,
            log_scale=self.log_scale + stretch,
            sq_sigma_scale=self.sq_sigma_scale * left_scale,
            coupling_scale=self.coupling_scale * kept_scale,
            coupling_heading=self.coupling_heading * kept_heading,
        )._followed()

    def _inject_heading(self, injection: Injection) -> Self:
        heading_rad, sq_heading, xy_m, sq_position = self._belief(INTEGRATOR)
        sq_injected = float(injection.covariance[2, 2])
        innovation = wrap(float(injection.pose[2]) - heading_rad)
        gain = self.coupling_heading / (sq_heading + sq_injected)
        left = np.maximum(1.0 - self.coupling_heading * gain / sq_position, LEAST_LEFT)
        virtual_m = xy_m + gain * innovation / np.maximum(1.0 - left, 1e-9)
        reachable = np.abs(virtual_m - xy_m) < 0.25 * self.grid.period[0]  # beyond it the virtual position would change sheets
        reliability = np.where(reachable, (1.0 / left - 1.0) / sq_position, 0.0)
        return replace(
            self,
            head=head_direction.inject(self.head, float(injection.pose[2]), 1.0 / sq_injected, self.config.head),
            grid=grid_cells.inject(self.grid, np.where(reachable, virtual_m, xy_m), reliability, self.config.grid),
            coupling_heading=self.coupling_heading * sq_injected / (sq_heading + sq_injected),
        )._followed()

    def _followed(self) -> Self:
        """The sheet follows the read-out."""
        xy_m, _ = grid_cells.read_out(self.grid, self.position_m[INTEGRATOR])
        return replace(self, position_m=np.tile(xy_m, (2, 1)))


def _coupled(
    coupling: FloatArray, innovation: FloatArray, sq_position: FloatArray, noise: FloatArray, sq_own: float
) -> tuple[float, float, float]:
    """What a position injection says about a coupled quantity: its shift, the share of the coupling that stays, and the share
    of its variance ``sq_own`` that is left. The innovation counts along the coupling's own direction only.
    """
    size = float(np.linalg.norm(coupling))
    if size < 1e-9:
        return 0.0, 1.0, 1.0
    direction = coupling / size
    sq_belief, sq_noise = float(direction**2 @ sq_position), float(direction @ noise @ direction)
    total = sq_belief + sq_noise
    left = max(1.0 - size**2 / (total * sq_own), LEAST_LEFT)
    return size * float(direction @ innovation) / total, sq_noise / total, left
