"""Lines that run side by side are concentric circles: which direction and bend at the rear axle explains most of the ridges.

With the direction ``a`` of the lane at the rear axle and its curvature ``k``, a point that lies ``t`` along that direction and
``n`` to the left of it lies on the circle that passes the axle to its left at
``c = (2 n - k (t^2 + n^2)) / (1 + sqrt(1 - 2 k n + k^2 (t^2 + n^2)))``. Points of one line share one ``c``.
Roads that begin to bend need the change of curvature ``k'`` along the lane too, which takes ``k' t^3 / 6`` from ``c``.
"""

from __future__ import annotations

from typing import Final

import numba
import numpy as np

from hippodrome.core.types import FloatArray

ANGLES: Final = np.linspace(-0.42, 0.42, 29)  # of the lane against the vehicle, tried first
BENDS: Final = np.array([-0.08, -0.045, -0.02, 0.0, 0.02, 0.045, 0.08])  # curvatures, 1/m, tried with each
BIN_M, SIDE_M = 0.12, 6.0  # of the histogram of c
MOST_TRIED: Final = 160  # ridges that are tried: more of them change nothing
ANGLE_SIGMA, BEND_SIGMA = 0.25, 0.04  # of lanes' directions (rad) and curvatures (1/m), known beforehand
PRIOR: Final = np.array(
    [0.08, BEND_SIGMA, 0.015]
)  # of the vehicle in its lane: it mostly heads along it; change of curvature (1/m^2)
STEADY_1PM2: Final = 0.0005  # the same on a road that does not bend
GRADE: Final = 2.0  # standard deviations seem this many times too small: neighbouring rows err together
SHARPEST_1PM: Final = 0.15
FIRST_GATE_M, GATE_SHRINKS, LEAST_GATE_M = 0.35, 0.7, 0.12  # distance from its line from which on a ridge is none of it
ITERATIONS: Final = 6
LINE_COUNT: Final = 6  # most lines that are fitted together
LEAST_WEIGHT: Final = 5.0  # ridges that make a line
APART_M: Final = 0.45  # lines of one road lie farther apart
PIXEL_SIGMA: Final = 0.3  # error of a ridge's place in pixels
PLACE_SIGMA_M: Final = 0.02  # and in metres: lines are painted in straight pieces
SWERVE_1PM: Final = 0.0015  # by how much, times the squared distance beyond the near ground, lanes leave their circle
NEAR_M: Final = 3.0


@numba.njit(cache=True)
def lateral_m(x: float, y: float, sin: float, cos: float, bend: float) -> float:
    """Lateral place at the rear axle (m, left positive) of the concentric line through (x, y)."""
    t, n = cos * x + sin * y, cos * y - sin * x
    square = t * t + n * n
    root = 1.0 - 2.0 * bend * n + bend * bend * square
    return float((2.0 * n - bend * square) / (1.0 + np.sqrt(max(root, 0.0))))


@numba.njit(cache=True)
def best_arc(ridges: FloatArray, weight: FloatArray) -> FloatArray:
    """Direction and curvature (2,) of the trial whose histogram of lateral places is the sharpest."""
    count = len(ridges)
    step = max(1, -(-count // MOST_TRIED))
    bins = int(2.0 * SIDE_M / BIN_M) + 1
    histogram = np.empty(bins + 1)
    best = np.zeros(2)
    most = -1.0
    for angle in ANGLES:
        sin, cos = np.sin(angle), np.cos(angle)
        for bend in BENDS:
            histogram[:] = 0.0
            for i in range(0, count, step):
                place = (lateral_m(ridges[i, 0], ridges[i, 1], sin, cos, bend) + SIDE_M) / BIN_M
                if 0.0 <= place < bins:
                    whole = int(place)
                    histogram[whole] += weight[i] * (whole + 1.0 - place)
                    histogram[whole + 1] += weight[i] * (place - whole)
            score = 0.0
            for k in range(bins):
                score += (histogram[k] + histogram[k + 1]) ** 2
            score *= np.exp(-0.25 * ((angle / ANGLE_SIGMA) ** 2 + (bend / BEND_SIGMA) ** 2) * 0.5)
            if score > most:
                most, best[0], best[1] = score, angle, bend
    return best


@numba.njit(cache=True)
def line_places(ridges: FloatArray, weight: FloatArray, arc: FloatArray) -> FloatArray:
    """Lateral places (K,) of the lines, by weight: peaks of the histogram that lie apart."""
    bins = int(2.0 * SIDE_M / BIN_M) + 1
    histogram = np.zeros(bins + 2)
    sin, cos = np.sin(arc[0]), np.cos(arc[0])
    for i in range(len(ridges)):
        place = (lateral_m(ridges[i, 0], ridges[i, 1], sin, cos, arc[1]) + SIDE_M) / BIN_M
        if 0.0 <= place < bins:
            whole = int(place)
            histogram[whole] += weight[i] * (whole + 1.0 - place)
            histogram[whole + 1] += weight[i] * (place - whole)
    places = np.empty(LINE_COUNT)
    found = 0
    while found < LINE_COUNT:
        at, most = -1, LEAST_WEIGHT
        for k in range(1, bins):
            mass = histogram[k - 1] + histogram[k] + histogram[k + 1]
            if mass > most:
                at, most = k, mass
        if at < 0:
            break
        centre = (histogram[at + 1] - histogram[at - 1]) / most
        places[found] = (at + centre) * BIN_M - SIDE_M
        found += 1
        reach = int(APART_M / BIN_M)
        for k in range(max(0, at - reach), min(bins + 1, at + reach) + 1):
            histogram[k] = 0.0
    return places[:found]


@numba.njit(cache=True)
def fit_arc(
    ridges: FloatArray, trust: FloatArray, start: FloatArray, places: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Least squares over direction, curvature, its change and the lines' places; ridges far from their line are left out.

    Returns the arc (3,), its covariance (3, 3), the places (K,), for each line its information and mean derivatives by the arc
    (K, 4), and the line of each ridge (N,), -1 for none. All variances are those of ridges that err independently.
    """
    count, lines = len(ridges), len(places)
    arc, places = np.array([start[0], start[1], 0.0]), places.copy()
    owner = np.full(count, -1.0)
    sums = np.zeros((lines, 5))  # weight, and weighted: place, its derivatives by the arc
    value, weight, by = np.empty(count), np.empty(count), np.empty((count, 3))
    covariance, step, normal, right = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3)), np.zeros(3)
    for iteration in range(ITERATIONS):
        gate = max(LEAST_GATE_M, FIRST_GATE_M * GATE_SHRINKS**iteration)
        sin, cos = np.sin(arc[0]), np.cos(arc[0])
        sums[:] = 0.0
        for i in range(count):
            x, y = ridges[i, 0], ridges[i, 1]
            t, n = cos * x + sin * y, cos * y - sin * x
            value[i] = lateral_m(x, y, sin, cos, arc[1]) - arc[2] * t**3 / 6.0
            by[i, 0], by[i, 1], by[i, 2] = -t, -0.5 * (t * t + n * n), -(t**3) / 6.0
            swerve = SWERVE_1PM * (max(x - NEAR_M, 0.0) + max(-x, 0.0)) ** 2
            variance = (PIXEL_SIGMA * ridges[i, 2]) ** 2 + PLACE_SIGMA_M**2 + swerve**2
            reach = gate + 2.0 * swerve
            owner[i], weight[i] = -1.0, 0.0
            for k in range(lines):
                error = abs(value[i] - places[k])
                if error < reach:
                    owner[i] = k
                    weight[i] = trust[i] * (1.0 - (error / reach) ** 2) ** 2 / variance
                    sums[k, 0] += weight[i]
                    sums[k, 1] += weight[i] * value[i]
                    for j in range(3):
                        sums[k, 2 + j] += weight[i] * by[i, j]
                    break
        normal[:] = 0.0
        for j in range(3):
            normal[j, j] = 1.0 / PRIOR[j] ** 2
            right[j] = -arc[j] / PRIOR[j] ** 2
        for i in range(count):
            k = int(owner[i])
            if k < 0 or sums[k, 0] <= 0.0:
                continue
            r = value[i] - sums[k, 1] / sums[k, 0]
            for j in range(3):
                p = by[i, j] - sums[k, 2 + j] / sums[k, 0]
                right[j] -= weight[i] * p * r
                for m in range(3):
                    normal[j, m] += weight[i] * p * (by[i, m] - sums[k, 2 + m] / sums[k, 0])
        _invert(normal, covariance)
        for j in range(3):
            step[j] = covariance[j, 0] * right[0] + covariance[j, 1] * right[1] + covariance[j, 2] * right[2]
            arc[j] += step[j]
        arc[1] = min(max(arc[1], -SHARPEST_1PM), SHARPEST_1PM)
        for k in range(lines):
            if sums[k, 0] > 0.0:
                places[k] = (sums[k, 1] + step[0] * sums[k, 2] + step[1] * sums[k, 3] + step[2] * sums[k, 4]) / sums[k, 0]
    about = np.zeros((lines, 4))
    for k in range(lines):
        if sums[k, 0] > 0.0:
            about[k, 0] = sums[k, 0]
            for j in range(3):
                about[k, 1 + j] = sums[k, 2 + j] / sums[k, 0]
    _steady(arc, covariance, places, about)
    return arc, covariance, places, about, owner


@numba.njit(cache=True)
def _invert(matrix: FloatArray, inverse: FloatArray) -> None:
    """Inverse of a symmetric positive definite (3, 3) matrix."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for m in range(3):
            p, q = (m + 1) % 3, (m + 2) % 3
            inverse[m, i] = matrix[j, p] * matrix[k, q] - matrix[j, q] * matrix[k, p]
    determinant = matrix[0, 0] * inverse[0, 0] + matrix[0, 1] * inverse[1, 0] + matrix[0, 2] * inverse[2, 0]
    inverse /= determinant


@numba.njit(cache=True)
def _steady(arc: FloatArray, covariance: FloatArray, places: FloatArray, about: FloatArray) -> None:
    """Take curvature as steady as the ridges allow: most roads are straight, or bend evenly, for as far as one sees.

    The change of curvature is drawn towards none, with the variance of such changes that this one frame suggests.
    """
    own = GRADE**2 * covariance[2, 2]
    usual = max(STEADY_1PM2**2, arc[2] ** 2 - own) / GRADE**2
    total = covariance[2, 2] + usual
    gain = covariance[:, 2] / total
    error = -arc[2]
    for j in range(3):
        arc[j] += gain[j] * error
    for k in range(len(places)):
        places[k] += error * (gain[0] * about[k, 1] + gain[1] * about[k, 2] + gain[2] * about[k, 3])
    before = covariance[:, 2].copy()
    for j in range(3):
        for m in range(3):
            covariance[j, m] -= gain[j] * before[m]
