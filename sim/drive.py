"""Drives: SUMO's ego among SUMO's traffic, then the car's own motion along the path that SUMO's ego took."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from hippodrome.core.roads.network import BoolArray, RoadNetwork
from hippodrome.core.se2 import wrap
from hippodrome.core.types import FloatArray, UInt8Array
from hippodrome.sim.ego_spec import LENGTH_M, REAR_AXLE_TO_FRONT_M, WHEELBASE_M, EgoSpec
from hippodrome.sim.lane_log import driven_edges, lane_pieces
from hippodrome.sim.net_heights import heights_along_m, pitch_rad
from hippodrome.sim.path import Piece, piece_starts, sample_count, smooth_path
from hippodrome.sim.pilot import DriveLog, Pilot
from hippodrome.sim.sumo_run import SUMO_STEP_S, BackgroundTraffic, sumo_run
from hippodrome.sim.tour import TourGraph, coverage_and_revisits, tour_graph, toured_area
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.traffic import VEHICLE_SIZES_M, vehicle_types_xml
from hippodrome.sim.traffic_spec import TrafficSpec
from hippodrome.sim.types import Drive, Town, TrafficLog

if TYPE_CHECKING:
    from hippodrome.sim.ego import Track

DRIVE_STEP_S: Final = 0.05  # of the ego's car; two steps to one of SUMO's
ROAM_PER_VEHICLE_M: Final = 200.0  # traffic uses the tour's area and as much around it as keeps queues at signals short
CLEAR_AFTER_STEPS: Final = 20  # of SUMO: two seconds, within which one that turns has gone by
TOUCHING_M: Final = 0.4  # boxes that overlap by less touch: the car's motion is not SUMO's to the last decimetre
REACH_M: Final = 11.0  # between the ego's rear axle and the middle of the longest vehicle, when their boxes touch
SAME_ROAD_M: Final = 2.0  # of height between vehicles on one road; bridges are higher
SAMPLES: Final = round(SUMO_STEP_S / DRIVE_STEP_S)  # of the drive to a step of SUMO
WIDTH_M: Final = 1.8  # of the ego
NEARBY_M: Final = 15.0  # the pose's projection on its lane lies within this of where the path says


def simulate_drive(town: Town, tour: TourSpec, traffic: TrafficSpec, ego: EgoSpec, seed: int) -> Drive:
    """A drive through the town, the same for the same seed. One at a time per process, as many as wanted one after the other."""
    graph = tour_graph(town.network)
    area = toured_area(graph, (1.0 - tour.revisit_share) * tour.planned_length_m())
    rng_tour, rng_traffic, rng_wander = (np.random.default_rng([seed, stream]) for stream in range(3))
    with sumo_run(town.net_file, vehicle_types_xml(ego.accel_mps2, ego.decel_mps2, LENGTH_M), seed):
        roamed_m = max(float(graph.length_m[area].sum()), ROAM_PER_VEHICLE_M * traffic.vehicles)
        roamed, climbs = toured_area(graph, roamed_m), town.heights_m is not None
        others = BackgroundTraffic(traffic, town.network, graph, roamed, rng_traffic, climbs)
        log = Pilot(town.network, graph, area, tour, ego, rng_tour).drive(others)
    return _as_drive(town, graph, log, ego, rng_wander)


def _as_drive(town: Town, graph: TourGraph, log: DriveLog, ego: EgoSpec, rng: np.random.Generator) -> Drive:
    """The car's motion along SUMO's path, and where on the lanes it was.

    The bicycle is driven seen from above; SUMO's speeds are along the slope, and so are the drive's.
    """
    from hippodrome.sim.ego import follow, wander_m  # takes seconds to load, and who reads a recording drives nothing

    network = town.network
    pieces, front_m = lane_pieces(network, log.lanes(), from_lane_start=True)
    aside = wander_m(sample_count(pieces), ego.lateral_wander_m, rng) if ego.lateral_wander_m > 0.0 else None
    t_s: FloatArray = np.arange(round((len(front_m) - 1) * SUMO_STEP_S / DRIVE_STEP_S) + 1, dtype=np.float64) * DRIVE_STEP_S
    rear_m = np.interp(t_s, SUMO_STEP_S * np.arange(len(front_m)), front_m) - REAR_AXLE_TO_FRONT_M
    track = follow(smooth_path(network, pieces, aside), rear_m, DRIVE_STEP_S)
    owner = _owners(pieces, track)
    number = {int(edge): k for k, edge in enumerate(graph.edges)}
    edges = [number[edge] for edge in driven_edges(network, pieces) if edge in number]
    coverage, revisit_share = coverage_and_revisits(edges, graph)
    lane = np.array([piece.lane for piece in pieces], dtype=np.int32)[owner]
    position_m = _lane_positions_m(network, pieces, track, owner)
    heights_m = None if town.heights_m is None else heights_along_m(network, town.heights_m, lane, position_m)
    return Drive(
        t_s=t_s,
        poses_m=np.concatenate([track.poses_m[:, :2], wrap(track.poses_m[:, 2:])], axis=1),
        speed_mps=track.speed_mps if heights_m is None else track.speed_mps / np.cos(drive_pitch_rad(track.poses_m, heights_m)),
        yaw_rate_radps=track.yaw_rate_radps,
        lane=lane,
        lane_position_m=position_m,
        traffic=_clear_traffic(log.traffic(), track.poses_m[::SAMPLES], None if heights_m is None else heights_m[::SAMPLES]),
        coverage=coverage,
        revisit_share=revisit_share,
        heights_m=heights_m,
    )


def clear_at_start(log: TrafficLog, poses_m: FloatArray, heights_m: FloatArray | None = None) -> TrafficLog:
    """The traffic without those who are inside the ego when it begins, until they have left it.

    SUMO sets the ego down on a lane in which the rear of one that turns across it still stands: it knows no vehicle's outline.

    Args:
        log: SUMO's steps.
        poses_m: poses (n, 3) of the ego's rear axle at each of them.
        heights_m: its heights (n,), where roads climb: who passes above or below it is not inside.
    """
    left_out = np.zeros(len(log.vehicle), dtype=bool)
    inside = None
    for step in range(min(CLEAR_AFTER_STEPS, len(log.t_s), len(poses_m))):
        rows = np.arange(log.start[step], log.start[step + 1])
        within = _are_inside(poses_m[step], log.poses_m[rows], log.kind[rows])
        if heights_m is not None and len(rows):
            within &= np.abs(log.poses_m[rows, 3] - heights_m[step]) < SAME_ROAD_M
        hit = rows[within]
        inside = set(log.vehicle[hit]) if inside is None else inside & set(log.vehicle[hit])
        if not inside:
            break
        left_out[rows[np.isin(log.vehicle[rows], list(inside))]] = True
    return _without(log, left_out)


def clear_on_the_way(log: TrafficLog, poses_m: FloatArray, heights_m: FloatArray | None = None) -> TrafficLog:
    """The traffic without the visits of those who come inside the ego on its way, from when they come into sight to when they
    leave it.

    Where the ego turns round or the junction is tight, the car swings wider than SUMO's ego, which turns on the spot, and whom
    SUMO let pass beside that one would drive through it.

    Args:
        log: SUMO's steps.
        poses_m: poses (n, 3) of the ego's rear axle at each of them.
        heights_m: its heights (n,), where roads climb: who passes above or below it is not inside.
    """
    step = np.repeat(np.arange(len(log.t_s)), np.diff(log.start))
    rows = np.flatnonzero(step < len(poses_m))
    gap_m = np.linalg.norm(log.poses_m[rows, :2] - poses_m[step[rows], :2], axis=1)
    inside = np.zeros(len(step), dtype=bool)
    for row in rows[gap_m < REACH_M].tolist():
        inside[row] = _are_inside(poses_m[step[row]], log.poses_m[[row]], log.kind[[row]])[0]
    if heights_m is not None:
        inside[rows] &= np.abs(log.poses_m[rows, 3] - heights_m[step[rows]]) < SAME_ROAD_M
    left_out = np.zeros(len(step), dtype=bool)
    for vehicle in np.unique(log.vehicle[inside]):
        seen = np.flatnonzero(log.vehicle == vehicle)
        for visit in np.split(seen, np.flatnonzero(np.diff(step[seen]) > 1) + 1):
            left_out[visit] = inside[visit].any()
    return _without(log, left_out)


def _clear_traffic(log: TrafficLog, poses_m: FloatArray, heights_m: FloatArray | None) -> TrafficLog:
    return clear_on_the_way(clear_at_start(log, poses_m, heights_m), poses_m, heights_m)


def _without(log: TrafficLog, left_out: BoolArray) -> TrafficLog:
    """The traffic without some of its rows (k,)."""
    if not left_out.any():
        return log
    gone = np.concatenate([[0], np.cumsum(left_out)])
    kept = ~left_out
    start = (log.start - gone[log.start]).astype(log.start.dtype)
    return TrafficLog(log.t_s, start, log.vehicle[kept], log.poses_m[kept], log.kind[kept])


def _are_inside(pose_m: FloatArray, others_m: FloatArray, kind: UInt8Array) -> BoolArray:
    """Which vehicles (k,) overlap the ego, seen from above: no side of either box, made a little smaller, parts them."""
    ahead = REAR_AXLE_TO_FRONT_M - 0.5 * LENGTH_M
    middle = pose_m[:2] + ahead * np.array([np.cos(pose_m[2]), np.sin(pose_m[2])])
    apart = others_m[:, :2] - middle
    half = 0.5 * (VEHICLE_SIZES_M[kind, :2] - TOUCHING_M)
    own = 0.5 * (np.array([LENGTH_M, WIDTH_M]) - TOUCHING_M)
    turn = others_m[:, 2] - pose_m[2]
    cos, sin = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    inside: BoolArray = np.ones(len(others_m), dtype=bool)
    for heading, size, other in ((np.full(len(turn), pose_m[2]), np.tile(own, (len(turn), 1)), half),
                                 (others_m[:, 2], half, np.tile(own, (len(turn), 1)))):  # fmt: skip
        along = apart[:, 0] * np.cos(heading) + apart[:, 1] * np.sin(heading)
        across = apart[:, 1] * np.cos(heading) - apart[:, 0] * np.sin(heading)
        inside &= np.abs(along) < size[:, 0] + other[:, 0] * cos + other[:, 1] * sin
        inside &= np.abs(across) < size[:, 1] + other[:, 0] * sin + other[:, 1] * cos
    return inside


def drive_pitch_rad(poses_m: FloatArray, heights_m: FloatArray) -> FloatArray:
    """Pitch (N,) of the ego, nose up positive, along poses (N, 3) and the road's heights (N,)."""
    steps = np.linalg.norm(np.diff(poses_m[:, :2], axis=0), axis=1)
    return pitch_rad(np.concatenate([[0.0], np.cumsum(steps)]), heights_m, WHEELBASE_M)


def _owners(pieces: Sequence[Piece], track: Track) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """The piece (N,) that each pose lies on."""
    starts = piece_starts(pieces)
    return np.clip(np.searchsorted(starts, track.u_m, side="right") - 1, 0, len(pieces) - 1)


def _lane_positions_m(
    network: RoadNetwork, pieces: Sequence[Piece], track: Track, owner: np.ndarray[tuple[int], np.dtype[np.int64]]
) -> FloatArray:
    """Arc length (N,) of each pose's projection on its lane's centreline, near where the path says it is."""
    starts = piece_starts(pieces)
    positions = np.empty(len(owner))
    bounds = [0, *(np.flatnonzero(np.diff(owner)) + 1).tolist(), len(owner)]
    for first, end in pairwise(bounds):
        k = int(owner[first])
        expected = pieces[k].begin_m + track.u_m[first:end] - starts[k]
        positions[first:end] = project_m(network.lane_points_m(pieces[k].lane), track.poses_m[first:end, :2], expected)
    return positions


def project_m(line_m: FloatArray, points_m: FloatArray, expected_m: FloatArray) -> FloatArray:
    """Arc length (n,) of the nearest place on a polyline to each point, within ``NEARBY_M`` of ``expected_m`` along it."""
    steps = np.diff(line_m, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    begins = np.concatenate([[0.0], np.cumsum(lengths)])[:-1]
    share = ((points_m[:, None] - line_m[None, :-1]) * steps).sum(-1) / lengths**2
    share = np.clip(share, 0.0, 1.0)
    gap = np.linalg.norm(line_m[None, :-1] + share[..., None] * steps - points_m[:, None], axis=-1)
    along = begins + share * lengths
    near = np.abs(along - expected_m[:, None]) <= NEARBY_M
    best = np.argmin(np.where(near, gap, np.inf), axis=1)
    nearest: FloatArray = along[np.arange(len(points_m)), best]
    return nearest
