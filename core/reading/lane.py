"""Which of the lines bound the vehicle's own lane, and where in it the vehicle is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from hippodrome.core.reading.arcs import GRADE
from hippodrome.core.reading.config import ReaderConfig
from hippodrome.core.types import FloatArray

NARROWEST_M, WIDEST_M = 2.4, 4.6  # of a lane
FARTHEST_M: Final = 2.5  # of a lane's border from the axle of a vehicle that is in it
WIDTH_SPREAD_M: Final = 0.35  # by which lanes differ from the expected width, in the choice of the two borders
BRIGHTER: Final = 0.38  # log of how much brighter kerb, pavement and gravel are than asphalt ..
BRIGHTER_SPREAD: Final = 0.13  # .. and its spread, also that of one lane's asphalt against the next one's
LONGER_SPREAD_M: Final = 0.5  # of the length along which a line is seen
FEW_ROWS: Final = 15.0  # a line seen in fewer rows tells less of its kind
SUREST: Final = 7.0  # log odds: no line is so surely of a kind that the next road cannot be another
SIDES: Final = (1, -1)  # left, right
ENOUGH: Final = 25.0  # ridges that a border needs to be one; more do not make it more likely
USUAL: Final = 4.0  # ridges that a lane of the expected width is worth
WIDTH_ERROR_M: Final = 0.07  # of a width as it is measured
ALONE: Final = 1.0  # log odds against a lane with the road's edge on both sides
PLACE_SIGMA_M, BEND_SIGMA_M2 = 0.01, 1.2  # error of the place in metres, and per curvature: lanes are drawn in straight pieces
SEEN_ROWS, UNSEEN_SIGMA_M = 8.0, 0.12  # borders seen in fewer rows are mostly remembered: the lane may end here, and turn
USUAL_RAD, TURNED_SIGMA_M = 0.07, 1.3  # who heads aside of the lane more than usual may be turning off it: error per rad beyond
HEADING_SIGMA_RAD, BEND_SIGMA_M = 0.007, 0.8  # the same of the direction
TOLD_M: Final = 4.5  # after so many metres all that is beside the axle has been ahead of the camera
ALONG_RAD: Final = 0.2  # a lane in which the vehicle is heads no more aside than this
BESIDE_M: Final = 0.4  # from the axle along the lane to a piece of its border that lies beside it
LONGEST_GAP_M: Final = 6.8  # between two dashes


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """The lines that were fitted together."""

    arc: FloatArray  # (3,) direction of the lane at the rear axle, curvature, its change
    covariance: FloatArray  # (3, 3)
    places_m: FloatArray  # (K,) lateral places at the rear axle
    about: FloatArray  # (K, 4) information, mean derivatives by the arc
    traits: FloatArray  # (K, 6) as ``line_traits`` tells them
    ridges: FloatArray  # (N, 5) that were fitted
    trust: FloatArray  # (N,)
    owner: FloatArray  # (N,) the line of each, -1 for none


@dataclass(frozen=True, slots=True)
class Place:
    """Place in the lane: lateral place of its middle at the rear axle, its variance, the width (nan: one border seen)."""

    middle_m: float
    variance_m2: float
    width_m: float
    left: int  # rows of the lines that bound it, -1 for none
    right: int
    edges: dict[int, float]  # side (1 left, -1 right) -> log odds that the border on it is the edge of the road


def edge_odds(lines: Lines, k: int, side: int, config: ReaderConfig) -> float:
    """Log odds that a line is the edge of the road, where ``side`` (1 left, -1 right) is its outer side."""
    _, rows, covered, _, _, ratio = lines.traits[k]
    if rows == 0.0:
        return 0.0
    brighter = side * math.log(max(ratio, 1e-3))
    surface = BRIGHTER * (2.0 * brighter - BRIGHTER) / (2.0 * BRIGHTER_SPREAD**2)
    longer = (covered - config.longest_dash_m) / LONGER_SPREAD_M
    weight = min(rows / FEW_ROWS, 1.0)
    return float(weight * (min(max(surface, -1.5), 2.5) + min(max(longer, -1.0), 4.0)))


def place_in_lane(
    lines: Lines, width_m: float, width_sigma_m: float, told: dict[int, float], config: ReaderConfig
) -> Place | None:
    """The lane between the two lines that look most like its borders; beside one of them where only one is seen.

    ``told`` are the log odds that the frames before gave for the border on each side to be the road's edge.
    """
    candidates = [k for k in range(len(lines.places_m)) if abs(lines.places_m[k]) < FARTHEST_M]
    odds = {
        (k, side): max(min(edge_odds(lines, k, side, config) + told.get(side, 0.0), SUREST), -SUREST)
        for k in candidates
        for side in SIDES
    }
    chosen = _borders(lines, candidates, odds, width_m, config)
    if chosen is None:
        return None
    sides = [(k, side) for k, side in zip(chosen, SIDES, strict=True) if k >= 0]
    painted = [float(lines.places_m[k]) for k, _ in sides]
    share = 1.0 / len(sides)
    gradient = share * np.sum([lines.about[k, 1:] for k, _ in sides], axis=0)
    variance = GRADE**2 * (
        float(gradient @ lines.covariance @ gradient) + share**2 * sum(1.0 / float(lines.about[k, 0]) for k, _ in sides)
    )
    variance += PLACE_SIGMA_M**2 + (BEND_SIGMA_M2 * float(lines.arc[1])) ** 2
    variance += (TURNED_SIGMA_M * max(abs(float(lines.arc[0])) - USUAL_RAD, 0.0)) ** 2
    if sum(float(lines.traits[k, 1]) for k, _ in sides) < SEEN_ROWS:
        variance += UNSEEN_SIGMA_M**2
    if len(sides) == 1:
        side = sides[0][1]
        edge = 1.0 / (1.0 + math.exp(-odds[sides[0]]))
        middle = painted[0] + side * (config.edge_inset_m * edge - 0.5 * width_m)
        variance += config.edge_inset_m**2 * edge * (1.0 - edge) + (0.5 * width_sigma_m) ** 2
        width = math.nan
    else:
        shift, shift_variance, widening = _insets(
            painted[0] - painted[1], odds[sides[0]], odds[sides[1]], width_m, width_sigma_m, config
        )
        middle, width = 0.5 * (painted[0] + painted[1]) + shift, painted[0] - painted[1] + widening
        variance += shift_variance
    return Place(middle, variance, width, chosen[0], chosen[1], {side: odds[k, side] for k, side in sides})


def edge_probability(place: Place, side: int) -> float:
    """Probability that the border on a side (1 left, -1 right) is the road's edge; nan where it is not seen."""
    return 1.0 / (1.0 + math.exp(-place.edges[side])) if side in place.edges else math.nan


def heading_variance_rad2(lines: Lines) -> float:
    """Variance of the direction of the lane where the rear axle is."""
    own = GRADE**2 * float(lines.covariance[0, 0])
    return own + HEADING_SIGMA_RAD**2 + (BEND_SIGMA_M * float(lines.arc[1])) ** 2


def _borders(
    lines: Lines, candidates: list[int], odds: dict[tuple[int, int], float], width_m: float, config: ReaderConfig
) -> tuple[int, int] | None:
    """Rows of the left and the right border (-1: not seen): those with the most ridges whose distance a lane's width can be."""
    counts = np.bincount(lines.owner[lines.owner >= 0].astype(np.int64), minlength=len(lines.places_m))
    at = {key: float(lines.places_m[key[0]]) + (key[1] * config.edge_inset_m if odds[key] > 0.0 else 0.0) for key in odds}
    best, chosen = -math.inf, None
    for left in [*candidates, -1]:
        for right in [*candidates, -1]:
            if left == right or (left >= 0 and at[left, 1] < 0.0) or (right >= 0 and at[right, -1] > 0.0):
                continue
            score = sum(min(float(counts[k]), ENOUGH) for k in (left, right) if k >= 0)
            if left >= 0 and right >= 0:
                width = at[left, 1] - at[right, -1]
                if not NARROWEST_M < width < WIDEST_M:
                    continue
                score += USUAL - USUAL * ((width - width_m) / WIDTH_SPREAD_M) ** 2
            if score > best:
                best, chosen = score, (left, right)
    return chosen


def _insets(
    apart_m: float, left_odds: float, right_odds: float, width_m: float, width_sigma_m: float, config: ReaderConfig
) -> tuple[float, float, float]:
    """By how much the middle lies off that of the two lines, the variance of this, and how much wider the lane is.

    A line at the road's edge lies inside of the lane's border. Which of the two are such lines is told by their looks, by the
    usual width of the lane, and by roads that mostly have room for two.
    """
    total = mean = square = widening = 0.0
    for left in (0, 1):
        for right in (0, 1):
            width = apart_m + config.edge_inset_m * (left + right)
            misfit = (width - width_m) ** 2 / (width_sigma_m**2 + WIDTH_ERROR_M**2)
            weight = math.exp(left * left_odds + right * right_odds - ALONE * left * right - 0.5 * min(misfit, 50.0))
            shift = 0.5 * config.edge_inset_m * (left - right)
            total += weight
            mean += weight * shift
            square += weight * shift**2
            widening += weight * config.edge_inset_m * (left + right)
    mean /= total
    return mean, max(square / total - mean**2, 0.0), widening / total


def beside_the_axle(lines: Lines, place: Place, told_m: float) -> bool:
    """Whether the rear axle is in the lane that was read, and not yet before it or past its end.

    ``told_m`` is how far back what was seen is known. Without it, a lane that the vehicle heads along begins behind it.
    """
    if abs(float(lines.arc[0])) > ALONG_RAD:
        return False
    if told_m < TOLD_M:
        return True
    solid, dashed = -math.inf, math.inf
    for side, k in ((1, place.left), (-1, place.right)):
        along = np.sort(lines.ridges[lines.owner == k, 0]) if k >= 0 else np.zeros(0)
        behind, ahead = along[along <= BESIDE_M], along[along > -BESIDE_M]
        if len(behind) == 0 or len(ahead) == 0:
            continue
        gap = max(float(ahead[0] - behind[-1]), 0.0)
        if place.edges.get(side, 0.0) > 0.0 and gap < 2.0 * BESIDE_M:
            solid = max(solid, float(ahead[0]))
        dashed = min(dashed, gap)
    return solid > -BESIDE_M or dashed < LONGEST_GAP_M
