"""Lines that run side by side are concentric circles: which direction and bend at the rear axle explains most of the ridges.

With the direction ``a`` of the lane at the rear axle and its curvature ``k``, a point that lies ``t`` along that direction and
``n`` to the left of it lies on the circle that passes the axle at ``c = (2 n - k (t^2 + n^2)) / (1 + sqrt(1 - 2 k n + k^2 (t^2 + n^2)))``
to its left. Points of one line share one ``c``.
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
ITERATIONS: Final = 6
LINE_COUNT: Final = 6  # most lines that are fitted together
LEAST_WEIGHT: Final = 4.0  # ridges that make a line
APART_M: Final = 0.45  # lines of one road lie farther apart
PIXEL_SIGMA: Final = 0.3  # error of a ridge's place in pixels
PLACE_SIGMA_M: Final = 0.02  # and in metres: lines are painted in straight pieces
SWERVE_1PM: Final = 0.0015  # by how much, times the squared distance beyond the near ground, lanes leave their circle
NEAR_M: Final = 3.0


@numba.njit(cache=True)  # type: ignore[misc]  # numba is untyped
def lateral_m(x: float, y: float, sin: float, cos: float, bend: float) -> float:
    """Lateral place at the rear axle (m, left positive) of the concentric line through (x, y)."""
    t, n = cos * x + sin * y, cos * y - sin * x
    square = t * t + n * n
    root = 1.0 - 2.0 * bend * n + bend * bend * square
    return (2.0 * n - bend * square) / (1.0 + np.sqrt(max(root, 0.0)))


@numba.njit(cache=True)  # type: ignore[misc]  # numba is untyped
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


@numba.njit(cache=True)  # type: ignore[misc]  # numba is untyped
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


@numba.njit(cache=True)  # type: ignore[misc]  # numba is untyped
def fit_arc(
    ridges: FloatArray, arc: FloatArray, places: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Least squares over direction, curvature and the lines' places, with ridges far from their line left out.

    Returns the arc (2,), its covariance (2, 2), the places (K,), for each line its information and mean derivatives by
    direction and curvature (K, 3), and the line of each ridge (N,), -1 for none.
    """
    count, lines = len(ridges), len(places)
    arc, places = arc.copy(), places.copy()
    owner = np.full(count, -1.0)
    sums = np.zeros((lines, 4))  # weight, c, dc/d direction, dc/d curvature
    value, by_angle, by_bend, weight = np.empty(count), np.empty(count), np.empty(count), np.empty(count)
    covariance = np.zeros((2, 2))
    for iteration in range(ITERATIONS):
        gate = max(0.12, 0.35 * 0.7**iteration)
        sin, cos = np.sin(arc[0]), np.cos(arc[0])
        sums[:] = 0.0
        for i in range(count):
            x, y = ridges[i, 0], ridges[i, 1]
            t, n = cos * x + sin * y, cos * y - sin * x
            value[i] = lateral_m(x, y, sin, cos, arc[1])
            by_angle[i] = -t
            by_bend[i] = -0.5 * (t * t + n * n)
            swerve = SWERVE_1PM * max(x - NEAR_M, 0.0) ** 2
            variance = (PIXEL_SIGMA * ridges[i, 2]) ** 2 + PLACE_SIGMA_M**2 + swerve**2
            reach = gate + 2.0 * swerve
            owner[i] = -1.0
            weight[i] = 0.0
            for k in range(lines):
                error = abs(value[i] - places[k])
                if error < reach:
                    owner[i] = k
                    weight[i] = (1.0 - (error / reach) ** 2) ** 2 / variance
                    sums[k, 0] += weight[i]
                    sums[k, 1] += weight[i] * value[i]
                    sums[k, 2] += weight[i] * by_angle[i]
                    sums[k, 3] += weight[i] * by_bend[i]
                    break
        a = 1.0 / ANGLE_SIGMA**2
        b = 0.0
        d = 1.0 / BEND_SIGMA**2
        e, f = -a * arc[0], -d * arc[1]
        for i in range(count):
            k = int(owner[i])
            if k < 0 or sums[k, 0] <= 0.0:
                continue
            p = by_angle[i] - sums[k, 2] / sums[k, 0]
            q = by_bend[i] - sums[k, 3] / sums[k, 0]
            r = value[i] - sums[k, 1] / sums[k, 0]
            a += weight[i] * p * p
            b += weight[i] * p * q
            d += weight[i] * q * q
            e -= weight[i] * p * r
            f -= weight[i] * q * r
        determinant = a * d - b * b
        covariance[0, 0], covariance[1, 1] = d / determinant, a / determinant
        covariance[0, 1] = covariance[1, 0] = -b / determinant
        turn, bend = (d * e - b * f) / determinant, (a * f - b * e) / determinant
        arc[0] += turn
        arc[1] = min(max(arc[1] + bend, -0.15), 0.15)
        for k in range(lines):
            if sums[k, 0] > 0.0:
                places[k] = (sums[k, 1] + turn * sums[k, 2] + bend * sums[k, 3]) / sums[k, 0]
    about = np.zeros((lines, 3))
    for k in range(lines):
        if sums[k, 0] > 0.0:
            about[k, 0] = sums[k, 0]
            about[k, 1] = sums[k, 2] / sums[k, 0]
            about[k, 2] = sums[k, 3] / sums[k, 0]
    return arc, covariance, places, about, owner
