"""Which of the lines bound the vehicle's own lane, and where in it the vehicle is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from hippodrome.core.reading.config import ReaderConfig
from hippodrome.core.types import FloatArray

NARROWEST_M, WIDEST_M = 2.4, 4.6  # of a lane
FARTHEST_M: Final = 2.5  # of a lane's border from the axle of a vehicle that is in it
WIDTH_SPREAD_M: Final = 0.35  # by which lanes differ from the expected width, in the choice of the two borders
BRIGHTER: Final = 0.28  # log of how much brighter kerb, pavement and gravel are than asphalt ..
BRIGHTER_SPREAD: Final = 0.06
LONGER_SPREAD_M: Final = 0.5  # of the length of the longest stretch
GRADE: Final = 2.0  # standard deviations seem this many times too small: neighbouring rows err together


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """The lines that were fitted together."""

    arc: FloatArray  # (2,) direction of the lane at the rear axle, curvature
    covariance: FloatArray  # (2, 2)
    places_m: FloatArray  # (K,) lateral places at the rear axle
    about: FloatArray  # (K, 3) information, mean derivative by direction, by curvature
    traits: FloatArray  # (K, 6) as ``line_traits`` tells them


@dataclass(frozen=True, slots=True)
class Place:
    """Place in the lane: lateral place of its middle at the rear axle, its variance, the width (nan: one border seen)."""

    middle_m: float
    variance_m2: float
    width_m: float
    left: int  # rows of the lines that bound it, -1 for none
    right: int


def edge_probability(lines: Lines, k: int, side: int, config: ReaderConfig) -> float:
    """How surely a line is the edge of the road, where ``side`` (1 left, -1 right) is its outer side."""
    _, _, stretch, _, _, ratio = lines.traits[k]
    brighter = side * math.log(max(ratio, 1e-3))
    surface = (brighter - BRIGHTER) / BRIGHTER_SPREAD + 2.0
    longer = (stretch - config.dash_m - 0.8) / LONGER_SPREAD_M
    return 1.0 / (1.0 + math.exp(-max(min(min(max(surface, -3.0), 3.0) + min(max(longer, -0.5), 4.0), 8.0), -8.0)))


def place_in_lane(lines: Lines, width_m: float, width_sigma_m: float, config: ReaderConfig) -> Place | None:
    """The lane between the two lines that look most like its borders; beside one of them where only one is seen."""
    best: tuple[float, int, int] | None = None
    candidates = [k for k in range(len(lines.places_m)) if abs(lines.places_m[k]) < FARTHEST_M]
    edges = {(k, side): edge_probability(lines, k, side, config) for k in candidates for side in (1, -1)}
    at = {(k, side): float(lines.places_m[k]) + side * config.edge_inset_m * edges[k, side] for k, side in edges}
    for left in [*candidates, -1]:
        for right in [*candidates, -1]:
            if left == right or (left >= 0 and at[left, 1] < 0.0) or (right >= 0 and at[right, -1] > 0.0):
                continue
            score = sum(min(float(lines.traits[k, 1]), 25.0) for k in (left, right) if k >= 0)
            if left >= 0 and right >= 0:
                width = at[left, 1] - at[right, -1]
                if not NARROWEST_M < width < WIDEST_M:
                    continue
                score += 4.0 - 4.0 * ((width - width_m) / WIDTH_SPREAD_M) ** 2
            if best is None or score > best[0]:
                best = score, left, right
    if best is None:
        return None
    sides = [(k, side) for k, side in ((best[1], 1), (best[2], -1)) if k >= 0]
    share = 1.0 / len(sides)
    gradient = share * np.sum([lines.about[k, 1:] for k, _ in sides], axis=0)
    variance = GRADE**2 * (
        float(gradient @ lines.covariance @ gradient) + share**2 * sum(1.0 / float(lines.about[k, 0]) for k, _ in sides)
    )
    variance += share**2 * config.edge_inset_m**2 * sum(edges[s] * (1.0 - edges[s]) for s in sides)
    middle, width = sum(at[s] for s in sides) * share, math.nan
    if len(sides) == 1:
        middle -= 0.5 * sides[0][1] * width_m
        variance += (0.5 * width_sigma_m) ** 2
    else:
        width = at[sides[0]] - at[sides[1]]
    return Place(middle, variance, width, best[1], best[2])
