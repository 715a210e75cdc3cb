"""Mode "paper": the printed networks on one torus, to show what they do and where they fail.

Nothing moves from calibration to integrator cells, reliabilities are forced to sum to E at every tick, and the position on the
torus may be wrong by whole periods: see the departures named in ``core.attractors.attractor``. The scale stays that of the map,
as in the paper, where both drives are one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from hippodrome.core.attractors import grid_cells, head_direction
from hippodrome.core.attractors.config import TURN
from hippodrome.core.attractors.grid_cells import GridState
from hippodrome.core.attractors.head_direction import HeadDirectionState
from hippodrome.core.localization.beliefs.belief import NetworkActivity, network_activity
from hippodrome.core.localization.beliefs.config import BeliefConfig
from hippodrome.core.localization.beliefs.motion import Motion, PoseMeasurement
from hippodrome.core.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class PaperBelief:
    """State of the two networks."""

    head: HeadDirectionState
    grid: GridState
    position_m: FloatArray  # (2,) the read-out of the torus, unwrapped from one observation to the next
    log_scale: float  # ln(metres per map unit), never learned
    placed: bool  # whether it is known which repetition of the torus the vehicle is on: the first measured pose tells
    config: BeliefConfig
    keeps_challenger: ClassVar[bool] = False

    @classmethod
    def uniform(cls, start_m: FloatArray, log_scale: float, config: BeliefConfig) -> Self:
        """Return a belief without prior knowledge.

        ``start_m`` (2,) is any point of the map, near which the position is read out until the first pose is measured.
        """
        head = head_direction.uniform(config.paper.head)
        grid = grid_cells.uniform(np.array([config.paper.period_m]), config.paper.grid)
        return cls(head, grid, start_m, log_scale, False, config)

    @property
    def pose(self) -> FloatArray:
        """The fused pose (3,) of both populations, Eqs. (15)-(16): m, m, rad."""
        return np.array([self.position_m[0], self.position_m[1], head_direction.read_out(self.head)[0]])

    @property
    def covariance(self) -> FloatArray:
        """Covariance (3, 3) of ``pose``: constant, as global inhibition holds the total information at E."""
        _, r_heading = head_direction.read_out(self.head)
        _, r_position = grid_cells.read_out(self.grid, self.position_m)
        return np.diag([1.0 / r_position[0], 1.0 / r_position[1], 1.0 / r_heading])

    def activity(self) -> NetworkActivity:
        """State of the head-direction and grid-cell networks, which the estimate reports."""
        return network_activity(self.head, self.grid)

    def predict(self, motion: Motion) -> Self:
        """Path integration, then mutual and global inhibition, in both networks as printed in the paper."""
        head = head_direction.integrate(self.head, motion.turned_rad / motion.dt_s, motion.dt_s)
        head = head_direction.inhibit(head, motion.dt_s, self.config.paper.head)
        heading_rad, _ = head_direction.read_out(head)
        step_m = grid_cells.displacement(np.full(2, heading_rad), motion.travelled * math.exp(self.log_scale), 1.0)
        grid = grid_cells.integrate(self.grid, step_m, np.zeros((2, 2)))
        grid = grid_cells.inhibit(grid, motion.dt_s, self.config.paper.grid)
        position_m, _ = grid_cells.read_out(grid, self.position_m + step_m[0])
        return replace(self, head=head, grid=grid, position_m=position_m)

    def inject(self, measurement: PoseMeasurement) -> Self:
        """Inject a measured pose into the calibration cells, Eqs. (13)-(14), Li et al. 2025.

        Its reliability is a fixed share of E; the covariance of the measurement is not used.
        """
        paper = self.config.paper
        head = head_direction.stimulate(self.head, float(measurement.pose[2]), paper.strength * paper.head.information)
        per_length = (TURN / paper.period_m) ** 2
        reliability = np.full(2, paper.strength * paper.grid.information * per_length)
        grid = grid_cells.stimulate(self.grid, measurement.pose[:2], reliability)
        position_m, _ = grid_cells.read_out(grid, self.position_m if self.placed else measurement.pose[:2])
        return replace(self, head=head, grid=grid, position_m=position_m, placed=True)
