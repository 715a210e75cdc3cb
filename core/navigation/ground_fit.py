"""Where along the way the pose is, by the ground about the vehicle: what is seen to be road, against what the network has paved.

Across its lane the vehicle is known to centimetres by what it reads, along the way by what passes. At a junction's mouth the
borders curve away: there the ground tells the place along the way to some .2 m. The pose is moved along the axis on which it is
known worst, which in a street is the street. Each place on that axis has a probability: the one that the pose had there, times
the one that the ground looks so from there (a likelihood field: Thrun, Burgard, Fox, "Probabilistic robotics", 2005, section
6.4). What is left of the axis is the mean and the variance of these places. So a mouth that is not to be seen where it should
be tells something, too, and two mouths that look alike leave the pose as unsure as it was.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit

from hippodrome.core.navigation.border import OTHER, ROAD, UNKNOWN
from hippodrome.core.navigation.paving import LEVEL_M, MOST_LEVEL, Paving
from hippodrome.core.navigation.sight import Ground
from hippodrome.core.navigation.track import Track, known_along
from hippodrome.core.roads.network import BoolArray
from hippodrome.core.types import FloatArray, Int8Array, UInt8Array

EDGE_M, BLUR_M = 0.2, 0.15  # what is seen of the paving's edge lies so far inside of it, so blurred ..
WRONG: Final = 0.1  # .. and a tenth of the cells is what it is by chance: vehicles, walls; all as measured at true poses
FORWARD_M, ASIDE_M, GRID_M = (-3.0, 11.0), 8.0, 0.5  # of the ground that is compared
THIN: Final = 2  # to the sides it is looked at so many times as densely: a kerb is no broader
LEAST_POINTS: Final = 80  # of it that must be known
PER_M: Final = 0.03  # weight of a point per metre driven: its error is that of its neighbours, and it is seen over and over again
LOOK_M: Final = 0.5  # driven between two looks
ASKEW_RAD: Final = 1.2  # at the end of a turn, where the axis lies across the vehicle's, the lane that is read tells more
MISFIT: Final = 0.2  # mean cost of a point in the best place, from which on the ground is not as the network has it: in fog a
# pavement looks like a road. With less the place is right to .25 m, in 298 looks about mouths; with more to .6 m, in 25 looks
SIGMAS, MORE_M = 3.0, 1.0  # so far either way the place is looked for ..
STEP_M, SHARE = 0.1, 0.1  # .. in steps of so much, or of such a share of the standard deviation
STRAY, STRAY_SIGMAS = 0.02, 3.0  # a pose is wrong more than it knows so often, and by so much more
FLOOR_M: Final = 0.2  # however clear the ground: the network's corners are rounded otherwise than the road's
FINE: Final = 4  # parts of a level of the raster, of the table of costs


@dataclass(frozen=True, slots=True)
class Fit:
    """What the ground leaves of an axis of the pose.

    Args:
        shift_m: by which the vehicle is farther along the axis than believed.
        variance_m2: of the place on it.
    """

    shift_m: float
    variance_m2: float


class GroundFit:
    """Takes the ground about the vehicle into the pose, every half a metre.

    Args:
        paved: what the network says of it.
    """

    def __init__(self, paved: Paving) -> None:
        self._paved, self._cost, self._places = paved, _costs(), _places()
        self._since_m = 0.0

    def step(self, track: Track, ground: Ground, distance_m: float) -> Track:
        """The pose after a look at the ground, where one is due and enough of it is known."""
        self._since_m += abs(distance_m)
        if self._since_m < LOOK_M:
            return track
        since_m, self._since_m = min(self._since_m, 2.0 * LOOK_M), 0.0
        axis, sigma_m = track.worst_axis()
        if float(axis @ (math.cos(track.pose[2]), math.sin(track.pose[2]))) < math.cos(ASKEW_RAD):
            return track
        fit = self.fit(track.pose, axis, sigma_m, ground, PER_M * since_m)
        return track if fit is None else known_along(track, axis, fit.shift_m, fit.variance_m2)

    def fit(self, pose: FloatArray, axis: FloatArray, sigma_m: float, ground: Ground, weight: float) -> Fit | None:
        """What the ground leaves of an axis (2,) of a pose (3,), known to ``sigma_m`` on it.

        ``weight`` is what a point of the ground counts. None where too little is seen, or nothing that fits.
        """
        kinds = on_this_side(ground.kinds_at(self._places.reshape(-1, 2)).reshape(self._places.shape[:2]))[:, ::THIN]
        known: BoolArray = (kinds == ROAD) | (kinds == OTHER)
        if int(known.sum()) < LEAST_POINTS:
            return None
        reach_m = SIGMAS * sigma_m + MORE_M
        step_m = max(STEP_M, SHARE * sigma_m)
        count = math.ceil(reach_m / step_m)
        shifts = np.arange(-count, count + 1, dtype=np.float64) * float(step_m)
        points, other = np.ascontiguousarray(self._places[:, ::THIN][known]), np.ascontiguousarray(kinds[known] == OTHER)
        cost = _cost_of(
            points, other, pose, axis, shifts, self._paved.levels, self._paved.corner_m, self._paved.cell_m, self._cost
        )
        return posterior(shifts, weight * cost, sigma_m) if float(cost.min()) < MISFIT * len(points) else None


def posterior(shifts_m: FloatArray, cost: FloatArray, sigma_m: float) -> Fit:
    """Mean and variance of a place on an axis, of which places (n,) cost so much (n,), -ln of a likelihood.

    Before, it had a standard deviation ``sigma_m`` about 0, and now and then a larger one.
    """
    wide_m = STRAY_SIGMAS * sigma_m + MORE_M
    narrow, wide = (np.exp(-0.5 * (shifts_m / one) ** 2) / one for one in (max(sigma_m, STEP_M), wide_m))
    share = ((1.0 - STRAY) * narrow + STRAY * wide) * np.exp(cost.min() - cost)
    share = share / share.sum()
    mean_m = float(share @ shifts_m)
    return Fit(mean_m, max(float(share @ (shifts_m - mean_m) ** 2), min(FLOOR_M, sigma_m) ** 2))


def on_this_side(kinds: UInt8Array) -> UInt8Array:
    """The ground (n, m), rows ahead of one another and columns from right to left, with no road beyond what is none.

    A pavement beyond the kerb is as grey as the road, and so are walls.
    """
    seen, middle = kinds.copy(), kinds.shape[1] // 2
    for side in (seen[:, middle:], seen[:, middle::-1]):
        side[np.logical_or.accumulate(side == OTHER, axis=1) & (side == ROAD)] = UNKNOWN
    return seen


def _places() -> FloatArray:
    """Places (n, m, 2) about the vehicle, in its axes: rows ahead of one another, columns from right to left."""
    left = np.arange(-ASIDE_M, ASIDE_M + 0.1, GRID_M / THIN)
    return np.stack(np.meshgrid(np.arange(*FORWARD_M, GRID_M), left, indexing="ij"), axis=-1)


def _costs() -> FloatArray:
    """What it costs (2, n) to see road, and to see none, at each ``FINE``-th of a level of the raster: -ln of its probability."""
    distance = LEVEL_M / FINE * np.arange(-FINE * MOST_LEVEL, FINE * MOST_LEVEL + 1)
    road = 0.5 * WRONG + (1.0 - WRONG) / (1.0 + np.exp((EDGE_M - distance) / BLUR_M))
    return np.stack([-np.log(road), -np.log(1.0 - road)])


@njit(cache=True)
def _cost_of(
    points: FloatArray,
    other: BoolArray,
    pose: FloatArray,
    axis: FloatArray,
    shifts: FloatArray,
    levels: Int8Array,
    corner: FloatArray,
    cell_m: float,
    cost: FloatArray,
) -> FloatArray:
    """What it costs (n,) that the pose is shifted along the axis; between cells of the raster its levels are interpolated."""
    total = np.zeros(len(shifts))
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    middle = len(cost[0]) // 2
    rows, columns = levels.shape
    for k in range(len(points)):
        kind = 1 if other[k] else 0
        x = (pose[0] + cos * points[k, 0] - sin * points[k, 1] - corner[0]) / cell_m - 0.5
        y = (pose[1] + sin * points[k, 0] + cos * points[k, 1] - corner[1]) / cell_m - 0.5
        for i in range(len(shifts)):
            u, v = x + shifts[i] * axis[0] / cell_m, y + shifts[i] * axis[1] / cell_m
            a, b = math.floor(u), math.floor(v)
            if a < 0 or b < 0 or a + 1 >= rows or b + 1 >= columns:
                total[i] += cost[kind, 0]
                continue
            p, q = u - a, v - b
            level = (1.0 - p) * ((1.0 - q) * levels[a, b] + q * levels[a, b + 1]) + p * (
                (1.0 - q) * levels[a + 1, b] + q * levels[a + 1, b + 1]
            )
            total[i] += cost[kind, middle + round(FINE * level)]
    return total
