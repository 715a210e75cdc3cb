"""Pictures of the localizer's attractor networks: the ring of head-direction cells, and a sheet of grid cells for each module.

They are drawn as on the report's page: sky blue the integrator, orange the calibration, brighter the more active.
"""

from __future__ import annotations

import math
from typing import Final

import cv2
import numpy as np

from hippodrome.core.types import FloatArray, Frame

CELLS: Final = 36  # along each side of a sheet, and round the ring: 10 degrees of phase a cell
COLOURS: Final = ((86, 180, 233), (230, 159, 0))  # integrator, calibration
SHARPEST: Final = 30.0  # reliability in 1/rad^2 of a bump as wide as a cell: sharper ones are drawn as wide and brighter
LOG_FLAT, LOG_PEAK = math.log(0.2), math.log(5000.0)  # activities that are drawn black and full
RINGS: Final = ((0.76, 0.98), (0.52, 0.74))  # inner and outer radius of each population's ring, of the picture's half
NEEDLE: Final = 0.48  # length of the heading's line, of the picture's half
PAPER, INK = (250, 250, 250), (30, 30, 30)


def head_ring(head_rad: FloatArray, reliability: FloatArray, heading_rad: float | None, side_px: int) -> Frame:
    """The two rings of head-direction cells, east to the right.

    Args:
        head_rad: (2,) where the bumps of integrator and calibration are.
        reliability: (2,) how sharp they are, 1/rad^2.
        heading_rad: the heading that the localizer stands by, drawn as a line; None: it stands by none.
        side_px: of the picture.
    """
    half = 0.5 * side_px
    y, x = np.mgrid[:side_px, :side_px] + 0.5 - half
    radius, cell = np.hypot(x, y) / half, np.rint(np.arctan2(-y, x) * CELLS / (2.0 * math.pi)).astype(int) % CELLS
    picture = np.full((side_px, side_px, 3), PAPER, dtype=np.uint8)
    for population, (inner, outer) in enumerate(RINGS):
        share = _brightness(_log_bump(2.0 * math.pi * np.arange(CELLS) / CELLS, head_rad[population], reliability[population]))
        there = (radius >= inner) & (radius <= outer)
        picture[there] = np.rint(share[cell[there], None] * np.array(COLOURS[population])).astype(np.uint8)
    if heading_rad is not None:
        reach = NEEDLE * half
        tip = round(half + reach * math.cos(heading_rad)), round(half - reach * math.sin(heading_rad))
        cv2.line(picture, (round(half), round(half)), tip, INK, 2, cv2.LINE_AA)
    return picture


def grid_sheet(phase_rad: FloatArray, reliability: FloatArray, side_px: int) -> Frame:
    """The sheet of a module of grid cells, both populations over one another.

    Args:
        phase_rad: (2, 2) population and axis: where the bumps are.
        reliability: (2, 2) how sharp they are, 1/rad^2.
        side_px: of the picture.
    """
    axis = 2.0 * math.pi * np.arange(CELLS) / CELLS - math.pi
    sheet = np.zeros((CELLS, CELLS, 3))
    for population, colour in enumerate(COLOURS):
        along, across = (_log_bump(axis, phase_rad[population, k], reliability[population, k]) for k in (0, 1))
        sheet += _brightness(along[None, :] + across[::-1, None])[:, :, None] * np.array(colour)
    small = np.minimum(sheet, 255.0).astype(np.uint8)
    return np.asarray(cv2.resize(small, (side_px, side_px), interpolation=cv2.INTER_NEAREST), dtype=np.uint8)


def _log_bump(angle_rad: FloatArray, mean_rad: float, reliability: float) -> FloatArray:
    """Logarithm of the activity of cells at these angles; 0 everywhere in a flat network."""
    sharp = max(float(reliability), 0.0)
    height = 0.5 * math.log1p(2.0 * math.pi * sharp)
    values: FloatArray = height + min(sharp, SHARPEST) * (np.cos(angle_rad - mean_rad) - 1.0)
    return values


def _brightness(log_activity: FloatArray) -> FloatArray:
    values: FloatArray = np.clip((log_activity - LOG_FLAT) / (LOG_PEAK - LOG_FLAT), 0.0, 1.0)
    return values
