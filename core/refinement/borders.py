"""Which of several parallel lanes was driven, as the borders that the camera read tell it: where they have no lane beyond."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from hippodrome.core.reading.borders import CONTRADICTS, FITS, fit_of_borders
from hippodrome.core.roads.geometry import project, road_geometry
from hippodrome.core.roads.network import BoolArray, RoadNetwork
from hippodrome.core.se2 import wrap
from hippodrome.core.types import UNSEEN_PERCENT, FloatArray, UInt8Array

REACH_M: Final = 12.0  # two lanes aside, and the lane beyond the second
ASIDE_M: Final = 8.0  # lanes farther aside than two are not the vehicle's
BESIDE_M: Final = 0.3  # by which the nearest place of a lane lies ahead of or behind a vehicle that is beside it
SAME_WAY_RAD: Final = math.radians(30.0)  # lanes whose direction differs less from the vehicle's heading lead the same way


def places_by_borders(poses: FloatArray, edge_percent: UInt8Array, network: RoadNetwork) -> tuple[FloatArray, BoolArray]:
    """The places (S, 2) of keyframes on the lanes that their borders tell, and a mask (S,) of those that they tell.

    Of the lanes that lie beside a pose and lead its way, those are told from whose borders the reading differs. If there are
    some, the place is the nearest one on a lane that fits the reading. All other places are those of the poses.

    Args:
        poses: (S, 3) of the keyframes, right to about a lane.
        edge_percent: (S, 2) as in ``LaneReadings``.
        network: the roads.
    """
    near = project(road_geometry(network), poses[:, :2], REACH_M)
    pose = poses[near.point]
    off_rad = wrap(near.heading_rad - pose[:, 2])
    away = near.foot_m - pose[:, :2]
    left = np.cos(pose[:, 2]) * away[:, 1] - np.sin(pose[:, 2]) * away[:, 0]  # by which the lane lies left of the vehicle
    beside = (np.abs(left) > near.distance_m - BESIDE_M) & ~network.is_internal[near.lane]
    of_road = beside & (np.abs(np.sin(off_rad)) < math.sin(SAME_WAY_RAD))
    own = beside & (np.abs(off_rad) < SAME_WAY_RAD) & (np.abs(left) < ASIDE_M)
    edges = np.where(edge_percent == UNSEEN_PERCENT, np.nan, 0.01 * edge_percent)
    several = np.bincount(near.point[own], minlength=len(poses)) > 1
    places, told = poses[:, :2].copy(), np.zeros(len(poses), dtype=np.bool_)
    for keyframe in np.flatnonzero(several & np.isfinite(edges).any(axis=1)):
        rows = np.arange(near.start[keyframe], near.start[keyframe + 1])
        others_m, rows = left[rows[of_road[rows]]], rows[own[rows]]
        width_m = network.width_m[near.lane[rows]]
        to_left, to_right = edges[keyframe].tolist()
        fits = np.array([fit_of_borders(to_left, to_right, left[k], others_m, w) for k, w in zip(rows, width_m, strict=True)])
        if fits.max() > FITS and fits.min() < CONTRADICTS:
            fitting = rows[fits > FITS]
            nearest = fitting[np.argmin(near.distance_m[fitting])]
            places[keyframe], told[keyframe] = near.foot_m[nearest], True
    return places, told
