"""Other road users: what they look like, and where they are at any time."""

from __future__ import annotations

from typing import Final

import numpy as np

from hippodrome.core.se2 import wrap
from hippodrome.core.types import FloatArray, IntArray, UInt8Array
from hippodrome.sim.tour import U_TURN_COST_M, TourGraph
from hippodrome.sim.types import TrafficLog

# Length, width, height of a car, a van, a truck: usual European compact, panel van and rigid lorry.
VEHICLE_SIZES_M: Final[FloatArray] = np.array([[4.3, 1.8, 1.5], [5.9, 2.0, 2.6], [8.4, 2.5, 3.6]])
KIND_SHARES: Final = (0.7, 0.2, 0.1)
KIND_ACCEL_MPS2: Final = (2.4, 1.8, 1.2)
TRIP_EDGES: Final = 40  # some kilometres, so that most vehicles are seen more than once


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


def random_trip(graph: TourGraph, area: IntArray, rng: np.random.Generator) -> list[int]:
    """Edges of the network for another road user: a random walk within ``area`` that turns round only where it must."""
    inside = np.zeros(len(graph.edges), dtype=bool)
    inside[area] = True
    trip = [int(rng.choice(area))]
    for _ in range(TRIP_EDGES - 1):
        row = slice(graph.cost_m.indptr[trip[-1]], graph.cost_m.indptr[trip[-1] + 1])
        after, cost = graph.cost_m.indices[row], graph.cost_m.data[row]
        if not inside[after].any():
            break
        after, cost = after[inside[after]], cost[inside[after]]
        forward = after[cost - graph.length_m[after] < U_TURN_COST_M]
        trip.append(int(rng.choice(forward if len(forward) else after)))
    return [int(edge) for edge in graph.edges[trip]]


def vehicle_types_xml(accel_mps2: float, decel_mps2: float, ego_length_m: float) -> str:
    """SUMO's vehicle types: the kinds of traffic, and the ego, which is never moved by teleport."""
    kinds = [
        f'<vType id="kind{i}" vClass="passenger" length="{length}" width="{width}" height="{height}" accel="{accel}" decel="3.5" '
        f'speedDev="0.1" sigma="0.3"/>'
        for i, ((length, width, height), accel) in enumerate(zip(VEHICLE_SIZES_M, KIND_ACCEL_MPS2, strict=True))
    ]
    ego = (
        f'<vType id="ego" vClass="passenger" length="{ego_length_m}" width="1.8" accel="{accel_mps2}" decel="{decel_mps2 + 1.0}" '
        f'sigma="0" speedDev="0" lcStrategic="10" lcSpeedGain="0" lcKeepRight="0" lcOpposite="0" timeToTeleport="-1"/>'
    )
    return "\n".join(["<additional>", *kinds, ego, "</additional>", ""])
