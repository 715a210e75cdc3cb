"""What the localizer asks of a pose belief, whichever algorithm holds it.

Every belief moves with the vehicle (``predict``), takes measured poses in (``inject``, after the paper's injection of visual
energy) and is read out (``pose``, ``covariance``). Beliefs with one hypothesis, the incumbent, need a second one, the challenger,
to hold measurements that conflict with it; it takes over by ``adopt``. Beliefs that weigh all hypotheses at once do without.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol, Self, TypeGuard

import numpy as np

from hippodrome.core.attractors.grid_cells import GridState
from hippodrome.core.attractors.head_direction import HeadDirectionState
from hippodrome.core.localization.beliefs.motion import Motion, PoseMeasurement
from hippodrome.core.types import FloatArray


class NetworkActivity(NamedTuple):
    """State of the attractor networks as estimates report it. M grid modules; populations: integrator, calibration."""

    head_direction_rad: FloatArray  # (2,)
    head_reliability: FloatArray  # (2,) 1/rad^2
    grid_phase_rad: FloatArray  # (M, 2 populations, 2 axes)
    grid_reliability: FloatArray  # (M, 2 populations, 2 axes) 1/rad^2


class PoseBelief(Protocol):
    """A belief about the pose in the network frame and the scale of this drive. Immutable: its methods return new ones."""

    @property
    def pose(self) -> FloatArray:
        """The believed pose (3,)."""

    @property
    def covariance(self) -> FloatArray:
        """Covariance (3, 3) of ``pose``: m, m, rad."""

    @property
    def log_scale(self) -> float:
        """ln(metres per map unit of this drive)."""

    @property
    def keeps_challenger(self) -> bool:
        """Whether the belief is a ``CompetingBelief``, which can hold a challenger beside the incumbent."""

    def predict(self, motion: Motion) -> Self:
        """The belief after a motion of the vehicle."""

    def inject(self, measurement: PoseMeasurement) -> Self:
        """The belief after a measured pose. A belief with a challenger updates its incumbent and dismisses the challenger."""

    def activity(self) -> NetworkActivity:
        """State of the attractor networks, which estimates report."""


class CompetingBelief(PoseBelief, Protocol):
    """A belief with an incumbent, which is read out, and from time to time a challenger that holds what conflicts with it."""

    @property
    def challenged(self) -> bool:
        """Whether there is a challenger at present."""

    def sq_distance(self, measurement: PoseMeasurement, challenger: bool = False) -> float:
        """Squared Mahalanobis distance of a measured pose from the incumbent, or from the challenger."""

    def challenge(self, measurement: PoseMeasurement) -> Self:
        """The belief after a measured pose that conflicts with it: the pose becomes the challenger, and the incumbent stays."""

    def reinforce(self, measurement: PoseMeasurement) -> Self:
        """The belief after a measured pose that agrees with the challenger, which it updates; the incumbent stays as it is."""

    def adopt(self) -> Self:
        """The challenger becomes the incumbent."""


def competes(belief: PoseBelief) -> TypeGuard[CompetingBelief]:
    """Whether the belief can hold a challenger; to the type checker it is a ``CompetingBelief`` then."""
    return belief.keeps_challenger


def network_activity(head: HeadDirectionState, grid: GridState) -> NetworkActivity:
    """The activity of a belief that is held by attractor networks: their means and reliabilities."""
    return NetworkActivity(head.mean_rad, head.reliability, grid.mean_rad, grid.reliability)


def no_networks(heading_rad: float, sq_heading: float) -> NetworkActivity:
    """The activity that a belief without networks reports: its heading, with variance ``sq_heading`` (rad^2), and no grid."""
    none = np.zeros((0, 2, 2))
    return NetworkActivity(np.full(2, heading_rad), np.array([1.0 / sq_heading, 0.0]), none, none)
