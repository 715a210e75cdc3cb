"""The focal length of a camera that nobody calibrated, from frames between which it turned.

When a camera turns, what it sees moves faster towards the edges of the picture, and the more so the wider its field of view. Of
the fields of view tried the one is taken under which the corners of many pairs of frames fit a motion best.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.core.views.egomotion import epipolar
from hippodrome.core.views.egomotion.tracks import Grey, follow, new_corners

FIELDS_DEG: Final = (30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0, 110.0, 120.0)  # fields of view tried
USUAL_DEG: Final = 65.0  # under which the pairs that turn most are picked
BEST_PAIRS: Final = 100  # pairs that turn most, of those offered
LEAST_PAIRS, LEAST_CORNERS = 20, 40  # fewer tell nothing
ERROR_PX: Final = 0.3  # of a corner; beyond it the cost grows as a logarithm
CLEAR_NATS: Final = 8.0  # by which the best field of view has to beat the widest and the narrowest one

Corners = tuple[FloatArray, FloatArray]  # (N, 2) pixels in the first frame and in the second


def corner_pair(before: Grey, after: Grey) -> Corners:
    """Corners of two frames."""
    corners = new_corners(before, np.zeros((0, 2)), np.zeros_like(before))
    ends, found = follow(before, after, corners, corners)
    return corners[found], ends[found]


def focal_px(pairs: Sequence[Corners], size_px: tuple[int, int]) -> float | None:
    """The focal length, in pixels of frames of this width and height; None if the pairs do not tell it."""
    offered = [pair for pair in pairs if len(pair[0]) >= LEAST_CORNERS]
    if len(offered) < LEAST_PAIRS:
        return None
    usual = _focal_of(USUAL_DEG, size_px)
    turn = np.array([_fit(pair, usual, size_px)[1] for pair in offered])
    picked = [offered[number] for number in np.argsort(-turn)[:BEST_PAIRS]]
    cost = np.array([sum(_fit(pair, _focal_of(deg, size_px), size_px)[0] for pair in picked) for deg in FIELDS_DEG])
    best = int(np.argmin(cost))
    if not 0 < best < len(cost) - 1 or min(cost[0], cost[-1]) < cost[best] + CLEAR_NATS:
        return None
    least = np.polynomial.Polynomial.fit(FIELDS_DEG[best - 1 : best + 2], cost[best - 1 : best + 2], 2).deriv().roots()[0]
    return _focal_of(float(least), size_px)


def _focal_of(field_deg: float, size_px: tuple[int, int]) -> float:
    return 0.5 * size_px[0] / math.tan(0.5 * math.radians(field_deg))


def _fit(pair: Corners, focal: float, size_px: tuple[int, int]) -> tuple[float, float]:
    """How badly the corners fit a motion under this focal length, nats, and by how much the camera turned, radians."""
    centre = 0.5 * (np.array(size_px) - 1.0)
    before, after = (np.column_stack([(at_px - centre) / focal, np.ones(len(at_px))]) for at_px in pair)
    anything = epipolar.Prior(0.0, 0.3, 0.1, np.zeros(2), 0.2, 2.0)
    turned = epipolar.estimate_rotation(before, after, 1.0 / focal, anything)
    error = epipolar.errors(before, after, turned) * focal / ERROR_PX
    return float(np.log1p(error**2).sum()), abs(float(turned.vector_rad[1]))
