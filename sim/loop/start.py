"""Where a drive in the loop begins, and that there is room."""

from __future__ import annotations

from typing import Final

import libsumo
import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import HippodromeError, IntArray
from hippodrome.sim.ego_spec import REAR_AXLE_TO_FRONT_M, WHEELBASE_M
from hippodrome.sim.loop.car import ahead_of
from hippodrome.sim.loop.types import LanePlace
from hippodrome.sim.loop.users import Users

ROOM_M: Final = 12.0  # at the start the road is clear this far before and behind the ego
ENDS_M: Final = 3.0  # a drawn start keeps this far from its lane's ends


def lane_and_position(network: RoadNetwork, place: LanePlace) -> tuple[int, float]:
    """A place as a lane and an arc length on it. Raises HippodromeError where it is not on the network."""
    if place.lane_id not in network.lane_ids:
        raise HippodromeError(f"start: the network has no lane {place.lane_id!r} for cars; its lanes are named as in SUMO's file")
    lane = network.lane_ids.index(place.lane_id)
    length = float(network.lane_lengths_m()[lane])
    if not 0.0 <= place.position_m <= length:
        raise HippodromeError(f"start: {place.position_m:g} m is not on lane {place.lane_id!r}, which is {length:.2f} m long")
    return lane, float(place.position_m)


def drawn_start(network: RoadNetwork, edges: IntArray, rng: np.random.Generator) -> tuple[int, float]:
    """A lane of some edges, the longer the likelier, and a place on it that leaves room for the car."""
    room = REAR_AXLE_TO_FRONT_M + 2.0 * ENDS_M
    lengths = network.lane_lengths_m()
    inside = np.isin(network.lane_edge, edges) & ~network.is_internal
    long = np.flatnonzero(inside & (lengths > room))
    lanes = long if len(long) else np.flatnonzero(inside)
    spare = np.maximum(lengths[lanes] - room, 0.1)
    lane = int(rng.choice(lanes, p=spare / spare.sum()))
    return lane, min(ENDS_M, 0.5 * float(lengths[lane])) + float(rng.uniform(0.0, max(lengths[lane] - room, 0.0)))


def clear_room(users: Users, pose_m: tuple[float, float, float]) -> int:
    """Takes the vehicles off SUMO's road that are where the ego begins; how many."""
    middle = ahead_of(pose_m, 0.5 * WHEELBASE_M)
    near = np.hypot(*(users.poses_m[:, :2] - middle).T) < ROOM_M
    for k in np.flatnonzero(near):
        libsumo.vehicle.remove(users.names[k])
    return int(near.sum())
