"""What the pixels of the ground show, by the level of the asphalt, and that level, which is followed from frame to frame."""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hippodrome.core.navigation.border import OTHER, PAINT, ROAD
from hippodrome.core.types import UInt8Array

DARKEST, BRIGHTEST, PAINT_LEVEL = 0.45, 1.38, 1.7  # levels relative to the asphalt right ahead: shade, kerbstones, paint
COLOURFUL = 0.16  # difference between a pixel's colours, relative to its level, from which on it is grass
STEADY = 0.85  # weight of the past in the level of the asphalt
LEAST_PATCH = 0.25  # of the patch must lie before the first border to tell the level
SUDDEN = (0.5, 1.5)  # a level that changes by more is none of asphalt

Levels: TypeAlias = NDArray[np.floating[Any]]
"""Levels of pixels (h, w), or shares of them."""


def kinds_of(relative: Levels, colour: Levels) -> UInt8Array:
    """What pixels (h, w) show: ``ROAD``, ``OTHER`` or ``PAINT``.

    Args:
        relative: their levels (h, w), relative to the asphalt's.
        colour: by how much (h, w) their colours differ, relative to their level.
    """
    kind = np.where((relative > DARKEST) & (relative < BRIGHTEST) & (colour <= COLOURFUL), ROAD, OTHER).astype(np.uint8)
    kind[(relative > PAINT_LEVEL) & (colour < COLOURFUL)] = PAINT
    return kind


def followed(before: float, level: Levels, colour: Levels, patch: NDArray[np.bool_]) -> float:
    """The level of the asphalt after a frame.

    It is that of the patch right ahead, in each column up to where what is seen at the frame's lower rim ends. In a sharp bend
    the pavement lies right ahead of the vehicle: were its level taken for the asphalt's, the painted edge would seem to be road,
    and the vehicle would follow the pavement. Where too little of the patch is left, the level stays.

    Args:
        before: the level before it; nan at the first frame, where all of the patch counts.
        level: of the pixels (h, w) of the ground.
        colour: as ``kinds_of`` has it.
        patch: which (h, w) of them are right ahead.
    """
    if math.isnan(before):
        return float(np.median(level[patch]))
    kind = kinds_of(level / max(before, 1.0), colour)
    here = patch & ~np.logical_or.accumulate(kind[::-1] != kind[-1], axis=0)[::-1]
    if np.count_nonzero(here) < LEAST_PATCH * np.count_nonzero(patch):
        return before
    seen = float(np.median(level[here]))
    return STEADY * before + (1.0 - STEADY) * seen if SUDDEN[0] < seen / max(before, 1.0) < SUDDEN[1] else before


def hidden(kind: UInt8Array) -> NDArray[np.bool_]:
    """Pixels (h, w) above a stretch of no road in their column: a grey wall behind the pavement looks like asphalt beyond it."""
    other = kind[::-1] == OTHER
    begins = np.zeros(kind.shape, dtype=np.bool_)
    begins[2:] = other[:-2] & other[1:-1] & other[2:]
    behind: NDArray[np.bool_] = np.maximum.accumulate(begins, axis=0)[::-1]
    return behind
