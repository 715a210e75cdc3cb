"""A place where the vehicle may be, as the hypotheses have it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from hippodrome.core.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A place where the vehicle may be.

    Args:
        pose: (3,) the mean of the particles there, in the network frame.
        covariance: (3, 3) of them.
        share: of all the weight.
        agreement: share of the ground about it that is as the network says, averaged over the last metres.
    """

    pose: FloatArray
    covariance: FloatArray
    share: float
    agreement: float

    @property
    def sigma_m(self) -> float:
        """Standard deviation of the position, over both axes."""
        return math.sqrt(max(float(self.covariance[0, 0] + self.covariance[1, 1]), 0.0))

    def at(self, pose: FloatArray) -> Place:
        """The place with another pose."""
        return replace(self, pose=pose)
