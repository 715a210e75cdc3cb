"""What travels inside ``sim``: the town that is driven and the drive through it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, IntArray, UInt8Array


@dataclass(frozen=True, slots=True, eq=False)
class Town:
    """A road network ready to drive and to draw."""

    name: str  # the generator's kind, or the network file's stem
    net_file: Path  # the SUMO network that libsumo loads
    network: RoadNetwork  # lanes open to passenger cars, internal lanes included
    junction_polygons_m: tuple[FloatArray, ...]  # (n, 2) outlines of the junctions' paved area
    signals_m: FloatArray  # (K, 3) x, y, heading of traffic lights and priority signs, to be drawn as poles
    left_hand: bool  # driving side
    notes: tuple[str, ...]  # what the network check found but could live with
    rural: bool = False  # scattered houses among fields, and few lamps
    other_lanes_m: tuple[FloatArray, ...] = ()  # (n, 2) outlines of lanes that are closed to cars: rails, cycleways, pavements
    turning_places_m: tuple[FloatArray, ...] = ()  # (n, 2) outlines of the paving at dead ends, where cars turn round
    heights_m: FloatArray | None = None  # (P,) of the network's points; None: the town is flat
    junction_heights_m: tuple[FloatArray, ...] | None = None  # (n,) of the junctions' outlines; None: the town is flat


@dataclass(frozen=True, slots=True, eq=False)
class TrafficLog:
    """Vehicles near the ego at each of T SUMO steps, in CSR form: step ``i`` owns rows ``start[i]:start[i + 1]``.

    ``sim.traffic.traffic_at`` interpolates it.
    """

    t_s: FloatArray  # (T,)
    start: IntArray  # (T + 1,)
    vehicle: IntArray  # (K,) identity, stable over time
    poses_m: FloatArray  # (K, 3) centre of the vehicle, network frame; (K, 5), with height [m] and pitch [rad], where roads climb
    kind: UInt8Array  # (K,) index into VEHICLE_SIZES_M of the scene


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """The ego's motion through a town, N samples of a fixed step. Poses are the rear axle's, network frame."""

    t_s: FloatArray  # (N,)
    poses_m: FloatArray  # (N, 3)
    speed_mps: FloatArray  # (N,) along the slope
    yaw_rate_radps: FloatArray  # (N,)
    lane: IntArray  # (N,) index into the town's network.lane_ids
    lane_position_m: FloatArray  # (N,) arc length of the pose's projection on that lane's centreline
    traffic: TrafficLog
    coverage: float  # share of the town's drivable directed edges (by length) that were driven
    revisit_share: float  # share of the driven length on directed edges that had been driven before
    heights_m: FloatArray | None = None  # (N,) of the road below the rear axle; None: the town is flat
