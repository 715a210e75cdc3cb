"""The attractor networks while mapping: they run beside the experience map, and their state is recorded at every vertex.

They do not bend the map: its edges hold raw odometry, as the read-out of a network jumps with every injection.

They start once the memory could recognise a place. Until then nothing can be injected, so that the states at earlier vertices
follow from dead reckoning; and by then the typical way between keyframes is known, from which the tori get their periods.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hippodrome.core.attractors import grid_cells, head_direction
from hippodrome.core.attractors.grid_cells import GridState
from hippodrome.core.attractors.head_direction import HeadDirectionState
from hippodrome.core.mapping.config import MapperAttractorConfig
from hippodrome.core.types import AttractorStates, FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class NeuralPose:
    """State of both networks, and the position that tells which of its periods each torus is in."""

    head: HeadDirectionState
    grid: GridState
    position: FloatArray  # (2 populations, 2 axes) map units, unwrapped

    @property
    def pose(self) -> FloatArray:
        """The pose (3,) that the networks encode, Eqs. (15)-(16), Li et al. 2025, in map units and rad."""
        heading_rad, _ = head_direction.read_out(self.head)
        position, _ = grid_cells.read_out(self.grid, self.position[0])
        return np.array([position[0], position[1], heading_rad])


def begin(pose: FloatArray, spacing: float, config: MapperAttractorConfig) -> NeuralPose:
    """Start the networks at a known pose (3,); ``spacing`` is the typical distance between keyframes, map units."""
    period = grid_cells.module_periods(config.period_spacings * spacing)
    head = head_direction.known(float(pose[2]), config.head)
    return NeuralPose(head, grid_cells.known(pose[:2], period, config.grid), np.tile(pose[:2], (2, 1)))


def path_integrate(state: NeuralPose, motion: FloatArray, dt_s: float, config: MapperAttractorConfig) -> NeuralPose:
    """Path integration of one body motion (3,), then inhibition, Eqs. (3)-(7), Li et al. 2025, in both networks."""
    step = _rotated(state.head.mean_rad, motion[:2])
    head = head_direction.integrate(state.head, float(motion[2]) / dt_s, dt_s)
    grid = grid_cells.integrate(state.grid, step, np.zeros((2, 2)))
    return NeuralPose(
        head=head_direction.inhibit(head, dt_s, config.head),
        grid=grid_cells.inhibit(grid, dt_s, config.grid),
        position=state.position + step,
    )


def inject(state: NeuralPose, pose: FloatArray, config: MapperAttractorConfig) -> NeuralPose:
    """Inject the pose (3,) that a recognised view cell stands for into both networks, Eqs. (13)-(14), Li et al. 2025.

    Its reliability is ``injection_share`` of the information E. For the position it is converted to 1/length^2, which is the same
    share of E on every torus.
    """
    head = head_direction.inject(state.head, float(pose[2]), config.injection_share * config.head.information, config.head)
    per_length = 2.0 * np.pi / state.grid.period[0]
    strength = np.full(2, config.injection_share * config.grid.information * per_length**2)
    grid = grid_cells.inject(state.grid, pose[:2], strength, config.grid)
    injected = NeuralPose(head, grid, state.position)
    return NeuralPose(head, grid, np.tile(injected.pose[:2], (2, 1)))  # both populations are unwrapped from the new read-out on


def recorded(states: list[NeuralPose]) -> AttractorStates:
    """Stack the states of the networks at V vertices into the arrays that the map stores."""
    count = len(states)
    modules = len(states[0].grid.period) if states else 0
    return AttractorStates(
        head_mean_rad=_stacked([s.head.mean_rad for s in states], (count, 2)),
        head_reliability=_stacked([s.head.reliability for s in states], (count, 2)),
        grid_period=states[0].grid.period.astype(np.float32) if states else np.zeros(0, dtype=np.float32),
        grid_mean_rad=_stacked([s.grid.mean_rad for s in states], (count, modules, 2, 2)),
        grid_reliability=_stacked([s.grid.reliability for s in states], (count, modules, 2, 2)),
    )


def _rotated(heading_rad: FloatArray, motion: FloatArray) -> FloatArray:
    """A body displacement (2,) turned by each population's heading (2,): (2 populations, 2 axes)."""
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    return np.stack([cos * motion[0] - sin * motion[1], sin * motion[0] + cos * motion[1]], axis=-1)


def _stacked(rows: list[FloatArray], shape: tuple[int, ...]) -> np.ndarray[Any, np.dtype[np.float32]]:
    """The rows as one array of the given shape, which has to be given because an empty list of rows has none."""
    return np.array(rows, dtype=np.float32).reshape(shape)
