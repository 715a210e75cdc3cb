"""How long to drive, in numbers. ``sim/tour.py`` plans the tour."""

from __future__ import annotations

from typing import Final

from pydantic import Field

from hippodrome.sim.spec import Spec

DEFAULT_LENGTH_M: Final = 3800.0  # once over a default town, in 12 minutes
TYPICAL_SPEED_MPS: Final = 5.5  # of the paper's drive: about 7.2 km in 1,315 s


class TourSpec(Spec):
    """How long to drive, by distance or by time (the first to be reached), and how much of it on roads driven before."""

    length_m: float | None = Field(None, gt=0.0, le=1e6)
    duration_s: float | None = Field(None, gt=0.0, le=1e5)
    revisit_share: float = Field(0.4, ge=0.0, le=0.95)  # wanted; on a town larger than the tour it bounds the toured area

    def planned_length_m(self) -> float:
        """The tour's length, estimated where only a duration is given."""
        if self.length_m is not None:
            return self.length_m
        return DEFAULT_LENGTH_M if self.duration_s is None else TYPICAL_SPEED_MPS * self.duration_s
