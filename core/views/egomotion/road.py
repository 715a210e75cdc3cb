"""How far a camera moved, from the plane of the road that both frames show, in units of the camera's height."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from hippodrome.core.types import Float32Array, FloatArray
from hippodrome.core.views.egomotion.tracks import Grey

NEAREST, FARTHEST = 1.2, 9.0  # heights of the camera ahead between which the road is looked at
ASIDE: Final = 1.8  # heights to either side: a lane, and little of what stands beside it
CELLS: Final = (6, 12)  # rows and columns of the patch's cells; each votes by itself, as cars and kerbs are no road
CELL_PX: Final = (8, 10)  # samples of a cell, rows and columns
LEAST_ROWS_PX: Final = 8.0  # rows of road below which a frame shows none
BLUR: Final = 15  # samples over which the mean is taken out: light and shade
INDEPENDENT: Final = 6.0  # samples of a cell that tell apart from one another: they are blurred by the lens and the file format
OUTLIER_NATS: Final = 2.0  # most that one cell says against a step
GRAIN: Final = 2.0  # grey levels of noise: a cell with less texture says less

FLOW_PX: Final = 0.6  # pixels by which two tried steps differ where the road is nearest
TRIED: Final = (8, 96)  # least and most steps tried
WIDE: Final = 4.0  # standard deviations of what is expected that are tried, ..
WIDE_SHARE: Final = 0.15  # .. and a share of the step: the depths of corners can mislead
BACKWARDS: Final = 0.02  # longest step backwards, heights: a vehicle that rolls back; others are not told from the road
CORNER_SIGMA, CORNER_NATS = 0.25, 12.0  # how far the step of the corners on the ground is off, relative; most that they say
ELSEWHERE: Final = 60  # steps tried over the whole range of speeds, now and then
DOUBT_NATS: Final = 10.0  # by so much a step elsewhere has to be likelier before what is believed is doubted


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """Where the road is sampled in the second frame: in the first one it was farther away, and therefore seen, too."""

    rays: FloatArray  # (3, M) bearings
    column: Float32Array  # (H, W) pixels
    row: Float32Array  # (H, W)
    nearness: FloatArray  # (M,) inverse distance along the ray's z axis, in 1 / heights


def road_patch(matrix: FloatArray, size_px: tuple[int, int], normal: FloatArray) -> Patch | None:
    """The stretch of road ahead that a camera sees, sampled densely where it is near; None if it sees none.

    Args:
        matrix: Pinhole matrix (3, 3).
        size_px: Width and height of the frames.
        normal: Unit vector (3,) to the ground, in the camera's axes.
    """
    focal, (centre_x, centre_y) = matrix[0, 0], matrix[:2, 2]
    pitch = math.atan2(normal[2], normal[1])
    top_px, low_px = (centre_y + matrix[1, 1] * math.tan(math.atan(1.0 / ahead) - pitch) for ahead in (FARTHEST, NEAREST))
    low_px = min(low_px, size_px[1] - 2.0)
    if low_px - top_px < LEAST_ROWS_PX:
        return None
    rows = np.linspace(top_px, low_px, CELLS[0] * CELL_PX[0])
    across = np.linspace(-ASIDE, ASIDE, CELLS[1] * CELL_PX[1])
    nearness = normal[1] * (rows - centre_y) / matrix[1, 1] + normal[2]  # heights over z, at the middle
    aside = across[None, :] * nearness[:, None]
    aside = np.clip(aside, (2.0 - centre_x) / focal, (size_px[0] - 3.0 - centre_x) / focal)
    column = aside * focal + centre_x
    row = np.repeat(rows[:, None], len(across), axis=1)
    rays = np.stack([aside.ravel(), (row.ravel() - centre_y) / matrix[1, 1], np.ones(row.size)])
    return Patch(rays, column.astype(np.float32), row.astype(np.float32), normal @ rays)


def agreements(
    before: Grey, after: Grey, patch: Patch, matrix: FloatArray, rotation: FloatArray, direction: FloatArray, steps: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """How well the cells (C,) of the road agree after each of the steps (K,), in heights: (K, C), and unmoved (C,)."""
    seen = _plain(cv2.remap(after, patch.column, patch.row, cv2.INTER_LINEAR))
    power = _cells(seen * seen) + GRAIN**2
    turned = (matrix @ rotation @ patch.rays).astype(np.float32)
    moved = ((matrix @ direction)[:, None] * patch.nearness).astype(np.float32)

    def agreement(column: Float32Array, row: Float32Array) -> FloatArray:
        other = _plain(cv2.remap(before, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT))
        found: FloatArray = _cells(seen * other) / np.sqrt(power * (_cells(other * other) + GRAIN**2))
        return found

    found = []
    for step in steps.astype(np.float32):
        there = turned + step * moved
        depth = np.maximum(there[2], 1e-3)
        found.append(agreement(*((there[axis] / depth).reshape(patch.column.shape) for axis in (0, 1))))
    return np.array(found), agreement(patch.column, patch.row)


def likelihood(agreement: FloatArray, standing: FloatArray, weights: FloatArray) -> FloatArray:
    """Log likelihood (K,) of the steps from how well each cell agrees after them (K, C).

    A cell with Gaussian texture of ``INDEPENDENT`` samples tells -n/2 ln(1 - r^2). One that fits no step at all, a wall or
    another vehicle, is allowed to: no cell says more than ``OUTLIER_NATS`` against a step. Nor does it say anything against a
    step after which it agrees no worse than if it had not moved at all, as the bonnet and what it mirrors do.

    Args:
        agreement: Of each cell after each step, (K, C).
        standing: Of each cell without any motion, (C,).
        weights: Share of each cell that counts, (C,).
    """
    nats, still = (-0.5 * INDEPENDENT * np.log(1.0 - np.clip(r, 0.0, 0.99) ** 2) for r in (agreement, standing))
    told: FloatArray = np.maximum(nats, np.maximum(nats.max(axis=0) - OUTLIER_NATS, still)) @ weights
    return told


def free_cells(static: Grey, patch: Patch) -> FloatArray:
    """Share (C,) of each cell that does not move along with the camera."""
    seen = cv2.remap(static, patch.column, patch.row, cv2.INTER_NEAREST)
    return 1.0 - _cells(seen.astype(np.float32)) / 255.0


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """A step by the road, in heights of the camera; ``sigma`` is infinite where the road tells nothing."""

    step: float
    sigma: float
    elsewhere: float | None  # a step outside of what was expected that fits clearly better


@dataclass(frozen=True, slots=True)
class Expected:
    """What is expected of a step, in heights of the camera."""

    step: float
    sigma: float
    longest: float  # of the fastest vehicle
    corners: float | None  # step by the corners on the ground, if there are enough of them
    search: bool  # try the whole range, too


def measure_step(
    before: Grey, after: Grey, patch: Patch, weights: FloatArray, matrix: FloatArray, rotation: FloatArray,
    direction: FloatArray, expected: Expected,
) -> Measured:  # fmt: skip
    """The likeliest step between two frames near the expected one.

    Args:
        before: The first frame.
        after: The second frame.
        patch: Where the road lies in the second frame.
        weights: Share (C,) of each cell of it that counts.
        matrix: Pinhole matrix (3, 3).
        rotation: Of the second camera in the axes of the first, (3, 3).
        direction: Unit vector (3,) from the first camera to the second, in the axes of the first.
        expected: Where to look.
    """

    def nats(steps: FloatArray) -> FloatArray:
        told = likelihood(*agreements(before, after, patch, matrix, rotation, direction, steps), weights)
        if expected.corners is None:
            return told
        away = np.log(np.maximum(steps, 1e-3) / expected.corners) / CORNER_SIGMA
        return told - np.minimum(0.5 * away**2, CORNER_NATS)

    half = WIDE * expected.sigma + WIDE_SHARE * abs(expected.step) + 0.02
    low, high = max(expected.step - half, -BACKWARDS), min(expected.step + half, expected.longest)
    spacing = FLOW_PX / (matrix[1, 1] * float(patch.nearness.max()) ** 2)
    steps = np.linspace(low, max(high, low + spacing), int(np.clip((high - low) / spacing, *TRIED)))
    told = nats(steps)
    elsewhere = None
    if (others := _others(expected, low, high)) is not None and (there := nats(others)).max() > told.max() + DOUBT_NATS:
        elsewhere = float(others[np.argmax(there)])
    spread = expected.sigma + 0.05 * abs(expected.step)
    best = int(np.argmax(told - 0.5 * ((steps - expected.step) / spread) ** 2))
    if best in (0, len(steps) - 1):
        return Measured(0.0, math.inf, elsewhere)
    near = slice(max(0, best - 4), best + 5)
    share = np.exp(told[near] - told[best])
    mean = float(share @ steps[near] / share.sum())
    variance = float(share @ (steps[near] - mean) ** 2 / share.sum())
    return Measured(mean, math.sqrt(variance + (0.3 * (steps[1] - steps[0])) ** 2), elsewhere)


def _others(expected: Expected, low: float, high: float) -> FloatArray | None:
    """Steps (K,) to try outside of what is expected."""
    if expected.corners is not None and not low < expected.corners < high:
        return expected.corners * np.linspace(0.9, 1.1, 9)
    return np.geomspace(0.01 * expected.longest, expected.longest, ELSEWHERE) if expected.search else None


def _plain(seen: Grey) -> Float32Array:
    grey = seen.astype(np.float32)
    plain: Float32Array = grey - cv2.blur(grey, (BLUR, BLUR))
    return plain


def _cells(values: Float32Array) -> FloatArray:
    """Means of the cells (C,)."""
    small = cv2.resize(values, (CELLS[1], CELLS[0]), interpolation=cv2.INTER_AREA)
    return small.ravel().astype(np.float64)
