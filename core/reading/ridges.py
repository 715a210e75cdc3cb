"""Painted lines as narrow bright ridges in the rows of a frame, measured to a fraction of a pixel."""

from __future__ import annotations

from typing import Final

import numba
import numpy as np

from hippodrome.core.types import Float32Array, FloatArray

CONTRAST: Final = 0.15  # of a line against the brighter of its two sides, as a share of it: kerbs have less against the pavement
LEAST_LEVELS: Final = 6.0  # the same in 8-bit levels ..
LEAST_NOISES: Final = 5.0  # .. and in standard deviations of the noise: what is less may be chance
FLANK_M: Final = 0.22  # how far aside of a line's middle its dark sides are looked for ..
FLANK_PX: Final = 3  # .. and how many pixels more, which is how far a moving camera smears
BROAD: Final = 1.8  # a ridge this many times as broad as a line, and ..
BROAD_PX: Final = 4.5  # .. so many pixels, is none
ASIDE_M: Final = 8.0  # lines farther aside are of no use
PER_ROW: Final = 24  # most ridges kept of a row


@numba.njit(cache=True)
def noise_levels(grey: Float32Array) -> float:
    """Standard deviation of the noise (8-bit levels) from second differences along the rows, of which most see plain road."""
    step, count = 5, 0
    height, width = grey.shape
    bent = np.empty(height * width // step + 1)
    for row in range(height):
        for u in range(1 + row % step, width - 1, step):
            bent[count] = abs(grey[row, u - 1] - 2.0 * grey[row, u] + grey[row, u + 1])
            count += 1
    return float(np.median(bent[:count]) / (0.6745 * np.sqrt(6.0)))


@numba.njit(cache=True)
def find_ridges(grey: Float32Array, x_m: Float32Array, y_m: Float32Array, line_m: float) -> FloatArray:
    """Ridges (N, 5): x, y in metres, metres per pixel, contrast in levels, number of the row; of the rows ``grey`` (R, W)."""
    count, width = grey.shape
    noise = noise_levels(grey)
    found = np.empty((count * PER_ROW, 5))
    total = 0
    smooth = np.empty(width, np.float32)
    for row in range(count):
        line = grey[row]
        metres = abs(y_m[row, width // 2 + 1] - y_m[row, width // 2 - 1]) / 2.0
        line_px = line_m / metres
        half = min(int(line_px / 2.0), 12)
        for u in range(width):
            low, high = max(u - half, 0), min(u + half, width - 1)
            value = np.float32(0.0)
            for k in range(low, high + 1):
                value += line[k]
            smooth[u] = value / np.float32(high - low + 1)
        reach = int(np.ceil(FLANK_M / metres)) + FLANK_PX
        broadest = BROAD * line_px + BROAD_PX
        kept = 0
        for u in range(2, width - 2):
            top = smooth[u]
            if not (top > smooth[u - 1] and top >= smooth[u + 1]) or abs(y_m[row, u]) > ASIDE_M or kept == PER_ROW:
                continue
            left = right = top
            for k in range(max(u - reach, 0), u):
                left = min(left, smooth[k])
            for k in range(u + 1, min(u + reach, width - 1) + 1):
                right = min(right, smooth[k])
            base = max(left, right)
            contrast = top - base
            if contrast < max(LEAST_LEVELS, LEAST_NOISES * noise / np.sqrt(2.0 * half + 1.0)) or contrast < CONTRAST * base:
                continue
            level = base + 0.5 * contrast
            a = u
            while a > 0 and smooth[a] > level:
                a -= 1
            b = u
            while b < width - 1 and smooth[b] > level:
                b += 1
            if smooth[a] > level or smooth[b] > level:
                continue
            begin = a + (level - smooth[a]) / (smooth[a + 1] - smooth[a])
            end = b - (level - smooth[b]) / (smooth[b - 1] - smooth[b])
            if end - begin > broadest:
                continue
            middle = 0.5 * (begin + end)
            whole = min(int(middle), width - 2)
            share = middle - whole
            found[total, 0] = (1.0 - share) * x_m[row, whole] + share * x_m[row, whole + 1]
            found[total, 1] = (1.0 - share) * y_m[row, whole] + share * y_m[row, whole + 1]
            found[total, 2] = metres
            found[total, 3] = contrast
            found[total, 4] = row
            total += 1
            kept += 1
    return found[:total]


def trust_of(ridges: FloatArray) -> FloatArray:
    """Weights (N,) up to 1: paint stands out, and what stands out much less than most of the paint in a frame may be none."""
    contrast = ridges[:, 3]
    strong = np.partition(contrast, int(0.8 * (len(contrast) - 1)))[int(0.8 * (len(contrast) - 1))]
    trust: FloatArray = np.minimum(contrast / (0.6 * strong), 1.0) ** 2
    return trust
