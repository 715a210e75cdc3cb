"""The peak between sampled values: where the parabola through a sample and its two neighbours has its maximum.

All functions return the offset from the middle sample, at most half way to a neighbour, and 0 where the parabola has no maximum.
There are two formulas for one parabola because their callers hold different inputs, and because they round differently in the
last bits: results are reproduced to the bit, so that neither formula can stand in for the other.
"""

from __future__ import annotations

import numpy as np

from hippodrome.core.types import Float32Array


def peak_of_values(x_before: float, before: float, middle: float, x_after: float, after: float) -> float:
    """Offset of the peak of the parabola through three values at uneven distances.

    Args:
        x_before: position of the first sample relative to the middle one, negative.
        before: value at ``x_before``.
        middle: value at 0.
        x_after: position of the last sample, positive.
        after: value at ``x_after``.

    Returns:
        The offset, in the unit of the positions.
    """
    slope_before, slope_after = (middle - before) / -x_before, (after - middle) / x_after
    curvature = (slope_after - slope_before) / (x_after - x_before)
    if curvature >= 0.0:
        return 0.0
    slope_at_middle = slope_before + curvature * -x_before
    return float(min(max(-0.5 * slope_at_middle / curvature, 0.5 * x_before), 0.5 * x_after))


def peak_of_drops(back: float, ahead: float, drop_back: float, drop_ahead: float) -> float:
    """Offset of the peak of the parabola through (-back, -drop_back), (0, 0) and (ahead, -drop_ahead).

    Args:
        back: distance to the sample before, positive.
        ahead: distance to the sample after, positive.
        drop_back: how much smaller the value before is than the middle one.
        drop_ahead: how much smaller the value after is than the middle one.

    Returns:
        The offset, in the unit of the distances; 0 where the parabola has no maximum.
    """
    curvature = (drop_ahead * back + drop_back * ahead) / (back * ahead * (back + ahead))
    if curvature <= 0.0:
        return 0.0
    slope = (drop_back * ahead**2 - drop_ahead * back**2) / (back * ahead * (back + ahead))
    return min(max(0.5 * slope / curvature, -0.5 * back), 0.5 * ahead)


def peak_in_row(values: Float32Array, best: int) -> float:
    """Offset (in samples) of the peak from the largest of evenly spaced values (N,), at index ``best``; 0 at either end."""
    if not 0 < best < len(values) - 1:
        return 0.0
    before, middle, after = (float(value) for value in values[best - 1 : best + 2])
    return peak_of_values(-1.0, before, middle, 1.0, after)


def peak_shift(scores: Float32Array) -> float:
    """Sideways shift in columns, to a fraction of a column, at which the scores (2 n + 1,) of the shifts -n to n are largest."""
    best = int(np.argmax(scores))
    return best - len(scores) // 2 + peak_in_row(scores, best)
