"""Speed carried on from one pair of frames to the next by the depth of corners that both pairs show: no road is needed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.core.views.egomotion.epipolar import Turned

LEAST_PARALLAX_PX: Final = 1.5  # of a corner whose depth is believed
LEAST_SHARED: Final = 12  # corners from which on a ratio of two steps is believed
CORRIDOR, FAR = 2.5, 12.0  # heights to either side, and ahead, within which corners may lie on the road
LEAST_GROUND: Final = 6  # corners that have to agree on a plane below
ALIKE: Final = 0.15  # width of the relative steps that agree


@dataclass(frozen=True, slots=True, eq=False)
class Depths:
    """Depths of corners ahead of a camera, in units of its step."""

    first: FloatArray  # (N,) before the step; NaN: unknown
    second: FloatArray  # (N,) after it
    sigma: FloatArray  # (N,) relative standard deviation


def depths(before: FloatArray, after: FloatArray, turned: Turned, pixel: float) -> Depths:
    """Depths by triangulation: the least squares of z1 x1 = z2 R x2 + c, for bearings (N, 3) with 1 ahead."""
    there = after @ turned.rotation.T
    aa, ab, bb = (before * before).sum(axis=1), (before * there).sum(axis=1), (there * there).sum(axis=1)
    ac, bc = before @ turned.direction, there @ turned.direction
    determinant = np.maximum(aa * bb - ab**2, 1e-15)
    first, second = (ac * bb - ab * bc) / determinant, (ab * ac - aa * bc) / determinant
    parallax_px = np.sqrt(determinant / (aa * bb)) / pixel
    known = turned.inlier & (parallax_px > LEAST_PARALLAX_PX) & (first > 0.0) & (second > 0.0)
    return Depths(
        np.where(known, first, np.nan), np.where(known, second, np.nan), 0.4 / np.maximum(parallax_px, LEAST_PARALLAX_PX)
    )


def step_ratio(last: FloatArray, last_sigma: FloatArray, now: Depths) -> tuple[float, float] | None:
    """This step over the last one, and its relative standard deviation; None if too few corners tell.

    Args:
        last: Depths (N,) of the corners where this step begins, in units of the last step; NaN: unknown.
        last_sigma: Relative standard deviations (N,).
        now: Depths in units of this step.
    """
    both = np.isfinite(last) & np.isfinite(now.first)
    if np.count_nonzero(both) < LEAST_SHARED:
        return None
    ratio = np.log(last[both] / now.first[both])
    weight = 1.0 / (last_sigma[both] ** 2 + now.sigma[both] ** 2)
    order = np.argsort(ratio)
    share = np.cumsum(weight[order]) / weight.sum()
    low, middle, high = np.interp([0.25, 0.5, 0.75], share, ratio[order])
    effective = weight.sum() ** 2 / (weight**2).sum()
    return float(np.exp(middle)), float(0.01 + 0.93 * (high - low) / np.sqrt(effective))


def ground_step(before: FloatArray, now: Depths, normal: FloatArray) -> float | None:
    """The step, in heights of the camera above the road, at which most corners ahead lie on one plane below it; None without any.

    Corners on kerbs, cars and walls are higher than the road and would make the step longer, each by another amount.
    """
    below = (before @ normal) * now.first  # in steps
    step = 1.0 / np.where(below > 1e-6, below, np.nan)
    near = (np.abs(before[:, 0] * now.first) * step < CORRIDOR) & (now.first * step < FAR)
    found = np.sort(np.log(step[near & np.isfinite(step)]))
    if len(found) < LEAST_GROUND:
        return None
    counts = np.searchsorted(found, found + ALIKE, side="right") - np.arange(len(found))
    best = int(np.argmax(counts))
    return float(np.exp(np.median(found[best : best + counts[best]]))) if counts[best] >= LEAST_GROUND else None
