"""Lanes cut into short straight pieces, and what lies beside each: the base of the road's surface, markings and edges."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

import numpy as np
from scipy.spatial import KDTree

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, IntArray, UInt8Array

PIECE_M: Final = 3.0  # the length of a painted dash
PROBE_M: Final = 0.5  # how far beyond a lane's border one looks for another lane
LEVEL_M: Final = 2.0  # of height between them, beyond which one lane passes above another and does not lie beside it


class Beside(IntEnum):
    """What a lane's border separates it from."""

    NOTHING = 0
    SAME_DIRECTION = 1
    OPPOSITE = 2
    JUNCTION = 3


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """P pieces of lanes, each from ``start_m`` to ``end_m`` on the centreline; normals point left and keep borders joined."""

    lane: IntArray  # (P,)
    start_m: FloatArray  # (P, 2)
    end_m: FloatArray  # (P, 2)
    start_normal: FloatArray  # (P, 2) scaled for a mitred joint
    end_normal: FloatArray  # (P, 2)
    along_m: FloatArray  # (P,) arc length of the middle
    half_width_m: FloatArray  # (P,)
    start_z_m: FloatArray  # (P,)
    end_z_m: FloatArray  # (P,)

    def select(self, rows: np.ndarray) -> Pieces:
        return Pieces(*(getattr(self, name)[rows] for name in self.__slots__))

    def middle_z_m(self) -> FloatArray:
        """Height (P,) halfway along."""
        return 0.5 * (self.start_z_m + self.end_z_m)

    def middle_m(self) -> FloatArray:
        return 0.5 * (self.start_m + self.end_m)

    def left_normal(self) -> FloatArray:
        """Unit normal (P, 2) of the piece itself."""
        step = self.end_m - self.start_m
        normal = np.stack([-step[:, 1], step[:, 0]], axis=1)
        unit: FloatArray = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        return unit


def cut_lanes(network: RoadNetwork, origin_m: FloatArray, heights_m: FloatArray | None = None) -> Pieces:
    """All lanes in pieces of at most ``PIECE_M``, relative to the origin; ``heights_m`` (P,) of the network's points."""
    counts = np.diff(network.point_start)
    owner = np.repeat(np.arange(network.lane_count, dtype=np.int32), counts)
    points = network.points_m - origin_m
    normal = _mitred_normals(points, owner)
    first = np.flatnonzero(owner[:-1] == owner[1:])
    length = np.linalg.norm(points[first + 1] - points[first], axis=1)
    share = np.maximum(np.ceil(length / PIECE_M), 1.0).astype(np.int64)
    row = np.repeat(first, share)
    step = np.arange(len(row)) - np.repeat(np.cumsum(share) - share, share)
    count = np.repeat(share, share)
    low, high = (step / count)[:, None], ((step + 1) / count)[:, None]
    arc = _arc_lengths(points, owner)
    z = np.zeros(len(points)) if heights_m is None else heights_m
    return Pieces(
        lane=owner[row].astype(np.int32),
        start_m=(1 - low) * points[row] + low * points[row + 1],
        end_m=(1 - high) * points[row] + high * points[row + 1],
        start_normal=(1 - low) * normal[row] + low * normal[row + 1],
        end_normal=(1 - high) * normal[row] + high * normal[row + 1],
        along_m=arc[row] + (step + 0.5) / count * np.repeat(length, share),
        half_width_m=0.5 * network.width_m[owner[row]],
        start_z_m=(1 - low[:, 0]) * z[row] + low[:, 0] * z[row + 1],
        end_z_m=(1 - high[:, 0]) * z[row] + high[:, 0] * z[row + 1],
    )


def _arc_lengths(points: FloatArray, owner: IntArray) -> FloatArray:
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1) * (owner[:-1] == owner[1:])
    along = np.concatenate([[0.0], np.cumsum(steps)])
    starts = np.flatnonzero(np.diff(owner, prepend=-1))
    lengths: FloatArray = along - along[starts][np.cumsum(np.diff(owner, prepend=-1) != 0) - 1]
    return lengths


def _mitred_normals(points: FloatArray, owner: IntArray) -> FloatArray:
    """Left normals (n, 2) at the points of polylines, as long as a joint needs to keep the strip's width, at most twice."""
    step = np.diff(points, axis=0)
    step /= np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-9)
    joined = (owner[:-1] == owner[1:])[:, None]
    unit = np.where(joined, np.stack([-step[:, 1], step[:, 0]], axis=1), 0.0)
    before, after = np.concatenate([np.zeros((1, 2)), unit]), np.concatenate([unit, np.zeros((1, 2))])
    mean = before + after
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-9)
    reference = np.where(np.any(after != 0.0, axis=1, keepdims=True), after, before)
    cosine = np.clip(np.sum(mean * reference, axis=1, keepdims=True), 0.5, 1.0)
    normals: FloatArray = mean / cosine
    return normals


def beside(pieces: Pieces, is_internal: np.ndarray, side: int, probe_m: float = PROBE_M) -> tuple[UInt8Array, IntArray]:
    """What lies ``probe_m`` beyond the left (+1) or right (-1) border of each piece, and the lane there (-1: none)."""
    tree = KDTree(pieces.middle_m())
    probe = pieces.middle_m() + side * pieces.left_normal() * (pieces.half_width_m + probe_m)[:, None]
    neighbours = min(16, len(probe))
    near = tree.query(probe, k=neighbours, distance_upper_bound=6.0)[1].reshape(len(probe), neighbours)
    found = near < len(probe)
    other = np.where(found, near, 0)
    middle, normal = pieces.middle_m(), pieces.left_normal()
    half_length = 0.5 * np.linalg.norm(pieces.end_m - pieces.start_m, axis=1)
    covers = found & (pieces.lane[other] != pieces.lane[:, None])
    here, place = np.nonzero(covers)  # few of the neighbours: most pieces near by are of the same lane
    there = other[here, place]
    offset = probe[here] - middle[there]
    across = np.abs(offset[:, 0] * normal[there, 0] + offset[:, 1] * normal[there, 1])
    along = np.abs(offset[:, 0] * normal[there, 1] - offset[:, 1] * normal[there, 0])
    level = np.abs(pieces.middle_z_m()[there] - pieces.middle_z_m()[here]) < LEVEL_M
    covers[here, place] = level & (across <= pieces.half_width_m[there] + 0.1) & (along <= half_length[there] + 0.3)
    hit = np.argmax(covers, axis=1)
    row = other[np.arange(len(probe)), hit]
    lane = np.where(np.any(covers, axis=1), pieces.lane[row], -1)
    facing = np.sum(normal * normal[row], axis=1) > 0.0
    kind = np.where(facing, Beside.SAME_DIRECTION, Beside.OPPOSITE)
    kind = np.where(is_internal[lane], Beside.JUNCTION, kind)
    return np.where(lane < 0, Beside.NOTHING, kind).astype(np.uint8), lane.astype(np.int32)
