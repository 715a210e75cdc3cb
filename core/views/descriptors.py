"""A frame becomes a descriptor: a template of about a kilobyte that tells places apart and ignores the light.

Kind "gradient" (the default) is a histogram of oriented gradients on a coarse grid (Dalal and Triggs 2005). Orientations without
a sign ignore the direction of the sun, and normalisation over blocks ignores the exposure. Kind "grey" is RatSLAM's: a grey image
of 60 x 10 pixels, each normalised by its neighbourhood.

Descriptors are flattened column of the image by column, so that a sideways shift of the view is an offset in memory. ``scoring``
compares them.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.types import Float32Array, Frame, Int8Array, UInt8Array
from hippodrome.core.views.config import ViewCellConfig

Descriptor: TypeAlias = Int8Array | UInt8Array  # (D,), or (C, D) for C of them

GRADIENT_SCALE = 127.0  # a block-normalised histogram entry lies in [0, 1] and is stored as 0 to 127
GREY_LEVELS_PER_SIGMA = 42.0  # a normalised pixel within 3 sigma of its neighbourhood's mean spans the byte


def describe(frame: Frame, config: ViewCellConfig) -> Descriptor:
    """The descriptor of a frame of any size, in colour or grey: (D,) int8 for "gradient", uint8 for "grey".

    D is the product of ``config.shape``. Sky and road are cut off first, as they tell no place.
    """
    height = frame.shape[0]
    crop = frame[round(config.top * height) : round(config.bottom * height)]
    grey: Frame = crop if crop.ndim == 2 else np.asarray(cv2.cvtColor(crop, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    return _describe_grey(grey, config) if config.kind == "grey" else _describe_gradient(grey, config)


def _describe_gradient(grey: Frame, config: ViewCellConfig) -> Int8Array:
    """Block-normalised histograms of the gradient's orientation on a grid of cells, (D,)."""
    rows, columns = config.gradient_px
    small = cv2.resize(grey, (columns, rows), interpolation=cv2.INTER_AREA)
    smooth = cv2.GaussianBlur(small, (3, 3), 0.0, borderType=cv2.BORDER_REPLICATE)
    dx = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, scale=0.25, borderType=cv2.BORDER_REPLICATE)
    dy = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, scale=0.25, borderType=cv2.BORDER_REPLICATE)
    histogram = _orientation_histogram(dx, dy, config.cell_px, config.bins)
    descriptor: Int8Array = _normalise_blocks(histogram, np.float32(config.contrast_floor))
    return descriptor


@njit(cache=True)
def _orientation_histogram(dx: NDArray[Any], dy: NDArray[Any], cell_px: int, bins: int) -> Float32Array:
    """Gradient magnitude per cell and orientation, (rows, columns, bins); a pixel is shared by the two nearest orientations."""
    rows, columns = dx.shape[0] // cell_px, dx.shape[1] // cell_px
    histogram = np.zeros((rows, columns, bins), dtype=np.float32)
    bins_per_rad = bins / np.pi
    for y in range(dx.shape[0]):
        for x in range(dx.shape[1]):
            gx, gy = dx[y, x], dy[y, x]
            magnitude = np.sqrt(gx * gx + gy * gy)
            if magnitude == 0.0:
                continue
            position = (np.arctan2(gy, gx) + np.pi) * bins_per_rad  # from 0 to 2 * bins; modulo bins, opposite directions are one
            low = int(position)
            share = np.float32(position - low)
            cell = histogram[y // cell_px, x // cell_px]
            cell[low % bins] += magnitude * (np.float32(1.0) - share)
            cell[(low + 1) % bins] += magnitude * share
    return histogram


@njit(cache=True)
def _normalise_blocks(histogram: Float32Array, contrast_floor: np.float32) -> Int8Array:
    """The descriptor (D,): histograms (rows, columns, bins) made independent of the local contrast, as in HOG.

    Each cell's histogram is divided by the norm of the block of 3 x 3 cells around it. The squared ``contrast_floor`` is part of
    the squared norm, so that noise is not amplified where there are no gradients. Entries are flattened column by column.
    """
    rows, columns, bins = histogram.shape
    energy = _cell_energies(histogram)
    flat = np.empty(rows * columns * bins, dtype=np.int8)
    floor = contrast_floor * contrast_floor
    for y in range(rows):
        for x in range(columns):
            gain = GRADIENT_SCALE / np.sqrt(_block_energy(energy, y, x, floor))
            for b in range(bins):
                flat[(x * rows + y) * bins + b] = np.int8(np.floor(histogram[y, x, b] * gain + 0.5))
    return flat


@njit(cache=True)
def _cell_energies(histogram: Float32Array) -> Float32Array:
    """Gradient energy of each cell, (rows, columns): the squared length of its histogram."""
    rows, columns, bins = histogram.shape
    energy = np.zeros((rows, columns), dtype=np.float32)
    for y in range(rows):
        for x in range(columns):
            for b in range(bins):
                energy[y, x] += histogram[y, x, b] ** 2
    return energy


@njit(cache=True)
def _block_energy(energy: Float32Array, y: int, x: int, floor: np.float32) -> np.float32:
    """Energy of the block around a cell, which normalises its histogram: ``floor`` plus that of the cell and its neighbours.

    ``energy`` (rows, columns) is that of each cell; at the border a block has fewer than eight neighbours.
    """
    rows, columns = energy.shape
    block = floor
    for v in range(max(0, y - 1), min(rows, y + 2)):
        for u in range(max(0, x - 1), min(columns, x + 2)):
            block += energy[v, u]
    return block


def _describe_grey(grey: Frame, config: ViewCellConfig) -> UInt8Array:
    """RatSLAM's descriptor (D,): a small image whose pixels are normalised, so that it does not depend on the light.

    From each pixel the mean of its neighbourhood is subtracted, and the difference is divided by the standard deviation there.
    Pixels are stored as bytes around 128, column by column.
    """
    rows, columns = config.grey_px
    small = cv2.resize(grey, (columns, rows), interpolation=cv2.INTER_AREA).astype(np.float32)
    patch = (config.grey_patch_px, config.grey_patch_px)
    mean = cv2.blur(small, patch, borderType=cv2.BORDER_REFLECT)
    variance = cv2.blur(small * small, patch, borderType=cv2.BORDER_REFLECT) - mean * mean
    normalised = (small - mean) / np.sqrt(np.maximum(variance, 1.0))
    levels: UInt8Array = np.clip(128.0 + GREY_LEVELS_PER_SIGMA * normalised, 0, 255).astype(np.uint8)
    return np.ascontiguousarray(levels.T).ravel()
