"""Whether the vehicle stands on road, by the ground that was seen under it: a confident pose beside the road contradicts that."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from hippodrome.core.navigation.border import OTHER
from hippodrome.core.navigation.sight import Ground

BODY_M: Final = (-0.3, 3.3, 0.8)  # from behind the rear axle to ahead of the front axle, and to either side
STEP_M: Final = 0.2
BESIDE, BESIDE_M = 0.05, 10.0  # so much of it no road over so much of the way: a corner that is cut is over sooner
OFF, OFF_M = 0.4, 2.0  # with so much of it no road, it takes no more than this
DOUBT: Final = 0.5  # of such ways from which on no place is taken for sure


def _body() -> np.ndarray:
    """Points (n, 2) under the vehicle, in its axes."""
    x, y = np.meshgrid(np.arange(BODY_M[0], BODY_M[1], STEP_M), np.arange(-BODY_M[2], BODY_M[2] + 0.01, STEP_M), indexing="ij")
    return np.column_stack([x.ravel(), y.ravel()])


BODY: Final = _body()


@dataclass(frozen=True, slots=True)
class Footing:
    """The metres that were driven beside the road, less those that were driven on it since.

    Args:
        beside_m: with some of the vehicle on no road.
        off_m: with much of it on no road.
    """

    beside_m: float = 0.0
    off_m: float = 0.0

    @property
    def is_on_road(self) -> bool:
        """Whether all of the vehicle is on road, as far as that is known."""
        return self.beside_m == 0.0

    @property
    def is_doubtful(self) -> bool:
        """Whether a place on the road is in doubt."""
        return self.beside_m > DOUBT * BESIDE_M or self.off_m > DOUBT * OFF_M

    @property
    def is_off_road(self) -> bool:
        """Whether the vehicle is beside the road."""
        return self.beside_m > BESIDE_M or self.off_m > OFF_M


def stepped(footing: Footing, ground: Ground, distance_m: float) -> Footing:
    """The footing after metres that were driven forward; backing off is not counted.

    Who has come off the road is beside it until he has backed: a pavement beyond the kerb looks like road.
    """
    if distance_m <= 0.0:
        return footing
    if footing.is_off_road:
        return Footing(min(footing.beside_m + distance_m, 2.0 * BESIDE_M), footing.off_m)
    share = float(np.mean(ground.kinds_at(BODY) == OTHER))
    beside_m = footing.beside_m + (distance_m if share > BESIDE else -distance_m)
    off_m = footing.off_m + (distance_m if share > OFF else -distance_m)
    return Footing(min(max(beside_m, 0.0), 2.0 * BESIDE_M), min(max(off_m, 0.0), 2.0 * OFF_M))
