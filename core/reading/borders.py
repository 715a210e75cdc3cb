"""Which of the lanes side by side fits the borders that were read: one at the road's edge has no lane beyond it."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from hippodrome.core.types import FloatArray

SURELY: Final = 0.98  # largest probability with which a border is believed to be of a kind
FITS, CONTRADICTS = -1.0, -2.0  # log likelihood of the borders of a lane that is the vehicle's, and of one that is not


def fit_of_borders(left_edge: float, right_edge: float, aside_m: float, others_m: FloatArray, width_m: float) -> float:
    """Log likelihood of the borders that were read, for a lane ``aside_m`` left of the vehicle.

    Args:
        left_edge: probability that the left border is the edge of the road; nan where it was not seen.
        right_edge: the same of the right one.
        aside_m: how far left of the vehicle the middle of the lane lies.
        others_m: (K,) the same of all lanes of the road, in both directions.
        width_m: of the lane.
    """
    likelihood = 0.0
    for side, edge in ((1.0, left_edge), (-1.0, right_edge)):
        if math.isfinite(edge):
            apart = side * (others_m - aside_m)
            goes_on = bool(np.any((apart > 0.6 * width_m) & (apart < 1.6 * width_m)))
            likelihood += math.log(min(max(1.0 - edge if goes_on else edge, 1.0 - SURELY), SURELY))
    return likelihood
