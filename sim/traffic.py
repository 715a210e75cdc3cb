"""Other road users: what they look like, and where they are at any time."""

from __future__ import annotations

from typing import Final

import numpy as np

from hippodrome.core.se2 import wrap
from hippodrome.core.types import FloatArray, IntArray, UInt8Array
from hippodrome.sim.spec import Spec
from hippodrome.sim.types import TrafficLog

# Length, width, height of a car, a van, a truck: usual European compact, panel van and rigid lorry.
VEHICLE_SIZES_M: Final[FloatArray] = np.array([[4.3, 1.8, 1.5], [5.9, 2.0, 2.6], [8.4, 2.5, 3.6]])


class TrafficSpec(Spec):
    """Background traffic."""

    vehicles: int = 20  # on the road at the same time, as far as they find room


def traffic_at(log: TrafficLog, t_s: float) -> tuple[FloatArray, UInt8Array, IntArray]:
    """Poses (K, 3), kinds and identities (K,) at ``t_s``, interpolated between the steps; a vehicle in one step only is held."""
    if len(log.t_s) == 0:
        return np.empty((0, 3)), np.empty(0, dtype=np.uint8), np.empty(0, dtype=np.int32)
    before = int(np.clip(np.searchsorted(log.t_s, t_s, side="right") - 1, 0, len(log.t_s) - 1))
    after = min(before + 1, len(log.t_s) - 1)
    here = slice(log.start[before], log.start[before + 1])
    there = slice(log.start[after], log.start[after + 1])
    poses, ids = log.poses_m[here].copy(), log.vehicle[here]
    _, i, j = np.intersect1d(ids, log.vehicle[there], assume_unique=True, return_indices=True)
    if after > before:
        share = float(np.clip((t_s - log.t_s[before]) / (log.t_s[after] - log.t_s[before]), 0.0, 1.0))
        step = log.poses_m[there][j] - poses[i]
        step[:, 2] = wrap(step[:, 2])
        poses[i] += share * step
        poses[:, 2] = wrap(poses[:, 2])
    return poses, log.kind[here], ids
