"""Local view cells: a frame becomes a small template, and one dense operation scores it against all stored ones.

Kind "gradient" (default) is a light-tolerant histogram of oriented gradients: unsigned orientations ignore the direction of the
sun, block normalisation ignores exposure, the subtracted mean ignores what all views of a town share (road, horizon, haze).
Kind "grey" is RatSLAM's: a patch-normalised 60x10 grey image, compared by mean absolute difference over horizontal shifts.

A mapper and a localizer use the same pieces: ``describe`` a frame, ``update_query_mean``, ``score`` against a ``ViewCellBank``.
Descriptors are flattened column by column, so that a sideways shift is an offset.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal, TypeAlias

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from hippodrome.core.types import Float32Array, Frame, Int8Array, IntArray, UInt8Array, ViewCells

Kind: TypeAlias = Literal["gradient", "grey"]
Descriptor: TypeAlias = Int8Array | UInt8Array  # (D,)

GRADIENT_SCALE = 127.0  # a block-normalised histogram entry lies in [0, 1]; this is its int8 one
QUERY_SCALE = 2047.0  # 127 * 2047 * D stays within int32 for D <= 8000
GREY_LEVELS_PER_SIGMA = 42.0  # a patch-normalised pixel of +-3 sigma spans the byte


@dataclass(frozen=True)
class ViewCellConfig:
    """How a frame becomes a template and how two are compared."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    kind: Kind = "gradient"
    top: float = 0.2  # share of the frame's height above the crop: sky
    bottom: float = 0.7  # share of the height where the crop ends: below is road, alike everywhere
    gradient_px: tuple[int, int] = (32, 64)  # rows, columns that gradients are taken on
    cell_px: int = 4  # side of a histogram cell
    bins: int = 8  # unsigned orientations
    contrast_floor: float = 4.0  # grey levels: gradients below it are noise and are not amplified by the normalisation
    gradient_shift: int = 1  # cells: tolerates about 6 deg of yaw at 90 deg field of view
    grey_px: tuple[int, int] = (10, 60)  # rows, columns (RatSLAM)
    grey_patch_px: int = 7  # side of the neighbourhood that a grey pixel is normalised by
    grey_shift: int = 4  # columns
    mean_horizon: int = 128  # views that the running mean of the queries remembers: about 600 m, longer than a street

    def __post_init__(self) -> None:
        if not 0.0 <= self.top < self.bottom <= 1.0:
            raise ValueError(f"view cells: crop must satisfy 0 <= top < bottom <= 1, got top {self.top}, bottom {self.bottom}")
        if self.cell_px < 1 or any(side % self.cell_px or side <= 0 for side in self.gradient_px):
            raise ValueError(f"view cells: cell_px {self.cell_px} must divide gradient_px {self.gradient_px}")
        if self.bins < 2 or self.mean_horizon < 1 or min(self.gradient_shift, self.grey_shift) < 0:
            raise ValueError("view cells: bins >= 2, mean_horizon >= 1 and shifts >= 0 are required")

    @property
    def shape(self) -> tuple[int, ...]:
        """The descriptor before flattening: (columns, rows, bins) or (columns, rows)."""
        if self.kind == "grey":
            return self.grey_px[1], self.grey_px[0]
        return self.gradient_px[1] // self.cell_px, self.gradient_px[0] // self.cell_px, self.bins

    @property
    def max_shift(self) -> int:
        """Columns of ``shape`` that a template may be off sideways."""
        return self.grey_shift if self.kind == "grey" else self.gradient_shift


@dataclass(frozen=True, slots=True, eq=False)
class ViewCellBank:
    """Stored views, ready to be scored against a query."""

    kind: Kind
    shape: tuple[int, ...]
    templates: Descriptor  # (C, D)
    mean: Float32Array  # (D,)
    inverse_norm: Float32Array  # (C,) 1/|template - mean|; ones for "grey"


@dataclass(frozen=True, slots=True, eq=False)
class QueryMean:
    """Running mean of the descriptors seen lately: what the present light adds to all of them."""

    mean: Float32Array  # (D,)
    count: int


def describe(frame: Frame, config: ViewCellConfig) -> Descriptor:
    """Template (D,) of a frame of any size: int8 for "gradient", uint8 for "grey"."""
    height = frame.shape[0]
    crop = frame[round(config.top * height) : round(config.bottom * height)]
    grey: Frame = crop if crop.ndim == 2 else np.asarray(cv2.cvtColor(crop, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    return _describe_grey(grey, config) if config.kind == "grey" else _describe_gradient(grey, config)


def _describe_gradient(grey: Frame, config: ViewCellConfig) -> Int8Array:
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
    """Gradient magnitude (rows, columns, bins) per cell, shared linearly between the two nearest unsigned orientations."""
    rows, columns = dx.shape[0] // cell_px, dx.shape[1] // cell_px
    histogram = np.zeros((rows, columns, bins), dtype=np.float32)
    bins_per_rad = bins / np.pi
    for y in range(dx.shape[0]):
        for x in range(dx.shape[1]):
            gx, gy = dx[y, x], dy[y, x]
            magnitude = np.sqrt(gx * gx + gy * gy)
            if magnitude == 0.0:
                continue
            position = (np.arctan2(gy, gx) + np.pi) * bins_per_rad
            low = int(position)
            share = np.float32(position - low)
            cell = histogram[y // cell_px, x // cell_px]
            cell[low % bins] += magnitude * (np.float32(1.0) - share)
            cell[(low + 1) % bins] += magnitude * share
    return histogram


@njit(cache=True)
def _normalise_blocks(histogram: Float32Array, contrast_floor: np.float32) -> Int8Array:
    """Each cell's histogram divided by the length of its 3x3 block, flattened (D,) and quantised."""
    rows, columns, bins = histogram.shape
    energy = np.zeros((rows, columns), dtype=np.float32)
    for y in range(rows):
        for x in range(columns):
            for b in range(bins):
                energy[y, x] += histogram[y, x, b] ** 2
    flat = np.empty(rows * columns * bins, dtype=np.int8)
    floor = contrast_floor * contrast_floor
    for y in range(rows):
        for x in range(columns):
            block = floor
            for v in range(max(0, y - 1), min(rows, y + 2)):
                for u in range(max(0, x - 1), min(columns, x + 2)):
                    block += energy[v, u]
            gain = GRADIENT_SCALE / np.sqrt(block)
            for b in range(bins):
                flat[(x * rows + y) * bins + b] = np.int8(np.floor(histogram[y, x, b] * gain + 0.5))
    return flat


def _describe_grey(grey: Frame, config: ViewCellConfig) -> UInt8Array:
    rows, columns = config.grey_px
    small = cv2.resize(grey, (columns, rows), interpolation=cv2.INTER_AREA).astype(np.float32)
    patch = (config.grey_patch_px, config.grey_patch_px)
    mean = cv2.blur(small, patch, borderType=cv2.BORDER_REFLECT)
    variance = cv2.blur(small * small, patch, borderType=cv2.BORDER_REFLECT) - mean * mean
    normalised = (small - mean) / np.sqrt(np.maximum(variance, 1.0))
    levels: UInt8Array = np.clip(128.0 + GREY_LEVELS_PER_SIGMA * normalised, 0, 255).astype(np.uint8)
    return np.ascontiguousarray(levels.T).ravel()


def bank_of(cells: ViewCells) -> ViewCellBank:
    """The stored views of a map, ready to be scored."""
    return make_bank(cells.kind, cells.shape, cells.templates, cells.mean)


def make_bank(kind: Kind, shape: tuple[int, ...], templates: Descriptor, mean: Float32Array) -> ViewCellBank:
    """Templates (C, D) with the lengths that a cosine needs once their common ``mean`` (D,) is subtracted."""
    inverse = np.ones(len(templates), dtype=np.float32)
    if kind == "gradient":
        norm = np.array([np.linalg.norm(template - mean) for template in templates])
        inverse = (1.0 / np.maximum(norm, 1.0)).astype(np.float32)
    return ViewCellBank(kind, shape, templates, mean, inverse)


def template_mean(kind: Kind, templates: Descriptor) -> Float32Array:
    """What all views share (D,): their mean for "gradient", nothing for "grey"."""
    if kind == "grey" or len(templates) == 0:
        return np.zeros(templates.shape[1], dtype=np.float32)
    mean: Float32Array = templates.mean(axis=0, dtype=np.float32)
    return mean


def start_query_mean(mean: Float32Array, count: int = 0) -> QueryMean:
    """A running mean that trusts ``mean`` (D,) as much as ``count`` views."""
    return QueryMean(mean, count)


def update_query_mean(state: QueryMean, descriptor: Descriptor, config: ViewCellConfig) -> QueryMean:
    """The mean with one more view: an average at first, forgetting exponentially after ``mean_horizon`` views."""
    weight = np.float32(1.0 / min(state.count + 1, config.mean_horizon))
    return QueryMean(state.mean + weight * (descriptor - state.mean), state.count + 1)


def score(bank: ViewCellBank, descriptor: Descriptor, query_mean: QueryMean, config: ViewCellConfig) -> Float32Array:
    """Similarity (C, 2 max_shift + 1) of one query to all C templates at each sideways shift; higher is more alike.

    Column ``max_shift + s`` compares the query moved ``s`` columns to the right: positive when it looks further right.
    "gradient": cosine of the mean-free descriptors. "grey": minus the mean absolute difference, grey levels.
    """
    if bank.kind == "grey":
        grey: Float32Array = _negative_absolute_difference(bank.templates, descriptor, config.max_shift, bank.shape[1])
        return grey
    queries = shifted_queries(descriptor - query_mean.mean, bank.shape, config.max_shift)
    scale = QUERY_SCALE / np.maximum(np.abs(queries).max(), 1e-6)
    whole = np.rint(queries * scale).astype(np.int16)
    offset = (whole @ bank.mean) / scale
    cosine: Float32Array = (_dot_products(bank.templates, whole) / np.float32(scale) - offset) * bank.inverse_norm[:, None]
    return cosine.astype(np.float32, copy=False)


def best_over_shifts(scores: Float32Array, max_shift: int) -> tuple[Float32Array, IntArray]:
    """Per template the best score (C,) and the shift (C,) in columns that reached it; the smaller shift wins a tie."""
    order = np.argsort(np.abs(np.arange(-max_shift, max_shift + 1)), kind="stable")
    column = order[np.argmax(scores[:, order], axis=1)]
    return scores[np.arange(len(scores)), column], (column - max_shift).astype(np.int32)


def shifted_queries(query: Float32Array, shape: tuple[int, ...], max_shift: int) -> Float32Array:
    """Unit-length copies (2 max_shift + 1, D) of a mean-free query, moved sideways; the columns that open up are the mean."""
    image, columns = query.reshape(shape), shape[0]
    moved = np.zeros((2 * max_shift + 1, *shape), dtype=np.float32)
    for row, shift in enumerate(range(-max_shift, max_shift + 1)):
        moved[row, max(0, shift) : columns + min(0, shift)] = image[max(0, -shift) : columns - max(0, shift)]
    flat = moved.reshape(len(moved), -1)
    norm = np.linalg.norm(flat, axis=1, keepdims=True)
    unit: Float32Array = flat / np.maximum(norm, np.float32(1e-6))
    return unit


@njit(cache=True)
def _dot_products(templates: Descriptor, queries: NDArray[np.int16]) -> Float32Array:
    """(C, S) products of int8 templates (C, D) and int16 queries (S, D): integers, so that the order of summation is free."""
    count, size = templates.shape
    products = np.empty((count, queries.shape[0]), dtype=np.float32)
    for i in range(count):
        for s in range(queries.shape[0]):
            total = np.int32(0)
            for d in range(size):
                total = np.int32(total + np.int16(templates[i, d]) * queries[s, d])
            products[i, s] = total
    return products


@njit(cache=True)
def _negative_absolute_difference(templates: Descriptor, query: Descriptor, max_shift: int, rows: int) -> Float32Array:
    """(C, 2 max_shift + 1) minus mean absolute difference of images (C, columns * rows) to one, over the columns that overlap."""
    count, size = templates.shape
    scores = np.empty((count, 2 * max_shift + 1), dtype=np.float32)
    for i in range(count):
        for s in range(-max_shift, max_shift + 1):
            template = templates[i, max(0, s) * rows : size + min(0, s) * rows]
            image = query[max(0, -s) * rows : size - max(0, s) * rows]
            total = np.int32(0)
            for d in range(len(template)):
                total = np.int32(total + abs(np.int32(template[d]) - np.int32(image[d])))
            scores[i, s + max_shift] = -np.float32(total) / np.float32(len(template))
    return scores
