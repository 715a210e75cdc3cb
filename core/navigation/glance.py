"""What hypotheses of the place are compared with: points of the ground, what they cost on a paving, places on lanes."""

from __future__ import annotations

import math

import numpy as np

from hippodrome.core.navigation.paving import LEVEL_M, MOST_LEVEL
from hippodrome.core.roads.geometry import RoadGeometry
from hippodrome.core.types import FloatArray, IntArray

EDGE_M, BLUR_M, OUTLIER = 0.2, 0.3, 0.2  # the paving's edge is seen so far inside, so blurred; and what is seen wrongly
FORWARD_M, ASIDE_M, GRID_M = (-3.0, 13.0), 7.0, 1.0  # of the ground that is compared


def mean_rad(angles: FloatArray, share: FloatArray) -> float:
    """The mean of angles (n,) with weights (n,)."""
    return math.atan2(float(share @ np.sin(angles)), float(share @ np.cos(angles)))


def segment_at(roads: RoadGeometry, lane: IntArray, position_m: FloatArray) -> IntArray:
    """The segment (n,) of each lane at an arc length."""
    offset = np.concatenate([[0.0], np.cumsum(roads.lane_length_m)])
    begins = roads.segment_position_m + offset[roads.segment_lane]
    segment = np.searchsorted(begins, position_m + offset[lane], side="right") - 1
    clipped: IntArray = np.clip(segment, roads.segment_start[lane], roads.segment_start[lane + 1] - 1).astype(np.int32)
    return clipped


def ground_points() -> tuple[FloatArray, FloatArray]:
    """The places ahead of the vehicle that are compared, in two lots that take turns, as the colours of a chess board do."""
    x, y = np.meshgrid(np.arange(*FORWARD_M, GRID_M), np.arange(-ASIDE_M, ASIDE_M + 0.1, GRID_M), indexing="ij")
    parity = (np.arange(x.shape[0])[:, None] + np.arange(x.shape[1])[None, :]) % 2
    points = np.stack([x, y], axis=-1)
    return np.ascontiguousarray(points[parity == 0]), np.ascontiguousarray(points[parity == 1])


def ground_cost() -> FloatArray:
    """What it costs (2, 2 * MOST_LEVEL + 1) to see road, and to see none, at each level of the raster: -ln of its probability."""
    distance = LEVEL_M * np.arange(-MOST_LEVEL, MOST_LEVEL + 1)
    paved = 1.0 / (1.0 + np.exp((EDGE_M - distance) / BLUR_M))
    road = 0.5 * OUTLIER + (1.0 - OUTLIER) * paved
    return np.stack([-np.log(road), -np.log(1.0 - road)])
