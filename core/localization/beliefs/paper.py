"""Mode "paper" of the localizer: the printed networks on one torus, to show what they do and where they fail.

Nothing moves from calibration to integrator cells, reliabilities are forced to sum to E at every tick, and the torus may lock to
a wrong sheet: see the traps named at ``core.attractor``. The scale stays the map's, as in the paper both drives are one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from hippodrome.core.attractors import grid_cells, head_direction
from hippodrome.core.attractors.grid_cells import GridState
from hippodrome.core.attractors.head_direction import HeadDirectionState
from hippodrome.core.localization.beliefs.motion import Motion
from hippodrome.core.localization.config import Injection, LocalizerConfig
from hippodrome.core.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class PaperPose:
    """State of the two networks; ``position_m`` (2,) is the read-out, unwrapped from tick to tick."""

    head: HeadDirectionState
    grid: GridState
    position_m: FloatArray
    log_scale: float
    placed: bool  # the sheet is known: the first injection names it
    config: LocalizerConfig

    @classmethod
    def uniform(cls, start_m: FloatArray, log_scale: float, config: LocalizerConfig) -> Self:
        """No prior knowledge; ``start_m`` (2,) only serves as a place to count sheets from."""
        head = head_direction.uniform(config.paper.head)
        grid = grid_cells.uniform(np.array([config.paper.period_m]), config.paper.grid)
        return cls(head, grid, start_m, log_scale, False, config)

    @property
    def pose(self) -> FloatArray:
        """(3,)."""
        return np.array([self.position_m[0], self.position_m[1], head_direction.read_out(self.head)[0]])

    @property
    def covariance(self) -> FloatArray:
        """(3, 3): constant, as global inhibition holds the total information at E."""
        _, r_heading = head_direction.read_out(self.head)
        _, r_position = grid_cells.read_out(self.grid, self.position_m)
        return np.diag([1.0 / r_position[0], 1.0 / r_position[1], 1.0 / r_heading])

    def predict(self, motion: Motion) -> Self:
        """Path integration, mutual inhibition, global inhibition."""
        head = head_direction.integrate(self.head, motion.turned_rad / motion.dt_s, motion.dt_s)
        head = head_direction.inhibit(head, motion.dt_s, self.config.paper.head)
        heading_rad, _ = head_direction.read_out(head)
        step = grid_cells.displacement(np.full(2, heading_rad), motion.travelled * math.exp(self.log_scale), 1.0)
        grid = grid_cells.integrate(self.grid, step, np.zeros((2, 2)))
        grid = grid_cells.inhibit(grid, motion.dt_s, self.config.paper.grid)
        position_m, _ = grid_cells.read_out(grid, self.position_m + step[0])
        return replace(self, head=head, grid=grid, position_m=position_m)

    def inject(self, injection: Injection) -> Self:
        """Eqs. (13)-(14), Li et al. 2025, with a fixed share of E."""
        paper = self.config.paper
        head = head_direction.stimulate(self.head, float(injection.pose[2]), paper.strength * paper.head.information)
        per_length = (grid_cells.TURN / paper.period_m) ** 2
        reliability = np.full(2, paper.strength * paper.grid.information * per_length)
        grid = grid_cells.stimulate(self.grid, injection.pose[:2], reliability)
        position_m, _ = grid_cells.read_out(grid, self.position_m if self.placed else injection.pose[:2])
        return replace(self, head=head, grid=grid, position_m=position_m, placed=True)
