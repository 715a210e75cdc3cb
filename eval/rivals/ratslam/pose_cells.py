"""RatSLAM's pose cells: a three-dimensional continuous attractor network over x, y and heading, each axis closed to a ring.

Milford & Wyeth 2004 and 2008, with the constants of OpenRatSLAM (Ball et al. 2013). One packet of activity moves with
self-motion; activity that a familiar view injects competes with it. A pose code (3,) is (x, y, heading) in cells.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from hippodrome.core.types import FloatArray


@dataclass(frozen=True)
class PoseCellConfig:
    """Size of the network and its weights. All values are OpenRatSLAM's, those of its road data set where data sets differ."""

    cells_xy: int = 30
    cells_heading: int = 36  # of 10 deg each
    excitation_width: int = 7  # cells beyond which the Gaussian is cut off
    excitation_sigma: float = 1.0
    inhibition_width: int = 5
    inhibition_sigma: float = 2.0
    global_inhibition: float = 0.00002  # subtracted from every cell in each step
    averaged_reach: int = 3  # cells on either side of the peak over which the read-out averages


def start(config: PoseCellConfig) -> FloatArray:
    """Initial activity (headings, y, x): all of it in the middle cell of x and y, at heading cell 0."""
    cells = np.zeros((config.cells_heading, config.cells_xy, config.cells_xy))
    cells[0, config.cells_xy // 2, config.cells_xy // 2] = 1.0
    return cells


def inject(cells: FloatArray, code: FloatArray, energy: float) -> FloatArray:
    """Activity with ``energy`` added at a pose code (3,), that of a familiar view (Sec. III-B, Milford & Wyeth 2008)."""
    x, y, heading = (int(c) % n for c, n in zip(np.floor(code + 0.5), cells.shape[::-1], strict=True))
    injected = cells.copy()
    injected[heading, y, x] += energy
    return injected


def attract(cells: FloatArray, config: PoseCellConfig) -> FloatArray:
    """One step of the internal dynamics, Eqs. (1)-(4), Milford & Wyeth 2008.

    Local excitation, local inhibition, global inhibition with rectification, and normalisation of the total to one.
    """
    excited = _spread(cells, gaussian(config.excitation_width, config.excitation_sigma))
    inhibition = _spread(excited, gaussian(config.inhibition_width, config.inhibition_sigma))
    rectified = np.maximum(excited - inhibition - config.global_inhibition, 0.0)
    total = float(rectified.sum())
    assert total > 0.0, "an activity packet is taller than the inhibition by construction"
    normalised: FloatArray = rectified / total
    return normalised


def path_integrate(cells: FloatArray, distance: float, turn_rad: float) -> FloatArray:
    """Activity moved by self-motion, Eqs. (5)-(6), Milford & Wyeth 2008: each layer of cells along its own heading.

    Args:
        cells: Activity (headings, y, x).
        distance: Distance travelled, in cells.
        turn_rad: Turn.
    """
    moved: FloatArray = _turned(_advanced(cells, distance), turn_rad * len(cells) / (2.0 * np.pi))
    return moved


def read_out(cells: FloatArray, config: PoseCellConfig) -> FloatArray:
    """Pose code (3,) of the packet of activity: the circular mean of the cells around the most active one."""
    peak = np.unravel_index(int(np.argmax(cells)), cells.shape)
    reach = np.arange(-config.averaged_reach, config.averaged_reach + 1)
    box = cells[np.ix_(*[(p + reach) % n for p, n in zip(peak, cells.shape, strict=True)])]
    along = [box.sum(axis=tuple({0, 1, 2} - {axis})) for axis in (2, 1, 0)]
    offset = np.array([float(weights @ reach) / float(weights.sum()) for weights in along])
    code: FloatArray = np.mod(np.array(peak[::-1]) + offset, np.array(cells.shape[::-1]))
    return code


def code_distance(a: FloatArray, b: FloatArray, config: PoseCellConfig) -> FloatArray:
    """Euclidean distance (N,) in cells between pose codes (N, 3) and (3,), along the shorter way round each ring."""
    size = np.array([config.cells_xy, config.cells_xy, config.cells_heading])
    apart = np.mod(a - b, size)
    distance: FloatArray = np.linalg.norm(np.minimum(apart, size - apart), axis=-1)
    return distance


def gaussian(width: int, sigma: float) -> FloatArray:
    """Weights (width,) along one axis, which sum to one; the Gaussian is separable."""
    offset = np.arange(width) - width // 2
    weights = np.exp(-(offset**2) / (2.0 * sigma**2))
    normalised: FloatArray = weights / weights.sum()
    return normalised


@njit(cache=True)
def _spread(cells: FloatArray, weights: FloatArray) -> FloatArray:
    """Circular convolution with ``weights`` along all three axes, one after the other; cells without activity are skipped."""
    headings, rows, columns = cells.shape
    half = len(weights) // 2
    along_x, along_y, spread = np.zeros_like(cells), np.zeros_like(cells), np.zeros_like(cells)
    for h in range(headings):
        for y in range(rows):
            for x in range(columns):
                if cells[h, y, x] != 0.0:
                    for i in range(len(weights)):
                        along_x[h, y, (x + i - half) % columns] += weights[i] * cells[h, y, x]
        for y in range(rows):
            for x in range(columns):
                if along_x[h, y, x] != 0.0:
                    for i in range(len(weights)):
                        along_y[h, (y + i - half) % rows, x] += weights[i] * along_x[h, y, x]
    for h in range(headings):
        for y in range(rows):
            for x in range(columns):
                if along_y[h, y, x] != 0.0:
                    for i in range(len(weights)):
                        spread[(h + i - half) % headings, y, x] += weights[i] * along_y[h, y, x]
    return spread


@njit(cache=True)
def _advanced(cells: FloatArray, distance: float) -> FloatArray:
    """Activity with every layer shifted by ``distance`` cells along its heading; the four cells around a new place share it."""
    headings, rows, columns = cells.shape
    advanced = np.zeros_like(cells)
    for h in range(headings):
        angle = 2.0 * np.pi * h / headings
        dx, dy = distance * np.cos(angle), distance * np.sin(angle)
        left, below = int(np.floor(dx)), int(np.floor(dy))
        right_share, above_share = dx - left, dy - below
        for y in range(rows):
            for x in range(columns):
                activity = cells[h, y, x]
                if activity != 0.0:
                    x0, y0 = (x + left) % columns, (y + below) % rows
                    x1, y1 = (x0 + 1) % columns, (y0 + 1) % rows
                    advanced[h, y0, x0] += (1.0 - right_share) * (1.0 - above_share) * activity
                    advanced[h, y0, x1] += right_share * (1.0 - above_share) * activity
                    advanced[h, y1, x0] += (1.0 - right_share) * above_share * activity
                    advanced[h, y1, x1] += right_share * above_share * activity
    return advanced


@njit(cache=True)
def _turned(cells: FloatArray, layers: float) -> FloatArray:
    """Activity shifted by ``layers`` heading cells; the two layers around a new heading share it."""
    headings = len(cells)
    low = int(np.floor(layers))
    share = layers - low
    turned = np.zeros_like(cells)
    for h in range(headings):
        turned[(h + low) % headings] += (1.0 - share) * cells[h]
        turned[(h + low + 1) % headings] += share * cells[h]
    return turned
