"""The course: the path over a route, with the speed that each place of it allows and the junctions that lie on it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hippodrome.core.navigation.config import DriveConfig, VehicleShape
from hippodrome.core.navigation.corners import with_corners
from hippodrome.core.navigation.types import Indicator
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.roads.paths import STEP_M, Path, Piece, piece_of_samples, piece_starts, smooth_path
from hippodrome.core.types import FloatArray, IntArray

INDICATED_RAD = math.radians(30.0)  # a way through a junction that turns more is indicated
SEARCH_BEHIND_M, SEARCH_AHEAD_M = 6.0, 10.0  # where the place on the path is looked for, about the last one
STEERING_SHARE = 0.9  # of the rate at which the wheels turn: the rest is for corrections
WHEELS_OVER_M = 1.0  # a step in a path's curvature is taken as one over this way, about where the wheels can be early and late
NEAR_M = 1.5  # ways through a junction that come so near to one another cross or meet: lanes side by side are 3 m apart
TURN_IN_M = 1.2  # before a bend the wheels begin to turn: with it most sharp corners are driven within the lanes


@dataclass(frozen=True, slots=True)
class Gate:
    """A junction on the course: places on it as distances ``u`` along the path."""

    entry_u_m: float  # where the lane before it ends
    exit_u_m: float  # where the next road begins
    edge: int  # the road after it, an index into ``edge_ids``; -1 if the path ends before
    indicator: Indicator
    meets_others: bool = True  # False where one road merely goes on as another one: nobody has to be waited for


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """A path of n samples, ``STEP_M`` apart, with all that is driven by."""

    path: Path
    lane: IntArray  # (n,) the planned lane
    position_m: FloatArray  # (n,) arc length on that lane
    speed_mps: FloatArray  # (n,) the highest speed: limits, bends, and braking in time for both
    gates: tuple[Gate, ...]
    goal_u_m: float  # where the goal is
    changes_u_m: tuple[float, ...]  # where lanes are changed: the middles of the changes
    changes_left: tuple[bool, ...]

    @property
    def last_u_m(self) -> float:
        return STEP_M * (len(self.lane) - 1)


def make_course(
    network: RoadNetwork,
    pieces: Sequence[Piece],
    goal_lane: int,
    goal_m: float,
    config: DriveConfig,
    vehicle: VehicleShape,
) -> Course:
    """The course over the stretches of lanes of a route that ends at or beyond the goal."""
    starts, owner = piece_starts(pieces), piece_of_samples(pieces)
    path = with_corners(network, pieces, smooth_path(network, pieces, look_ahead_m=TURN_IN_M), vehicle)
    begin_m = np.array([piece.begin_m for piece in pieces])
    lanes = np.array([piece.lane for piece in pieces], dtype=np.int32)
    u = STEP_M * np.arange(len(owner))
    last = max(k for k, piece in enumerate(pieces) if piece.lane == goal_lane and piece.begin_m <= goal_m + 1e-6)
    limit_mps = config.speed_share * network.speed_limit_mps[lanes[owner]]
    sides = [k for k, piece in enumerate(pieces) if piece.side_step]
    return Course(
        path=path,
        lane=lanes[owner],
        position_m=begin_m[owner] + u - starts[owner],
        speed_mps=_comfortable_mps(path, limit_mps, config, vehicle),
        gates=_gates(network, path, lanes, starts),
        goal_u_m=float(starts[last] + goal_m - pieces[last].begin_m),
        changes_u_m=tuple(float(starts[k]) for k in sides),
        changes_left=tuple(int(network.left_lane[pieces[k - 1].lane]) == pieces[k].lane for k in sides),
    )


def _comfortable_mps(path: Path, limit_mps: FloatArray, config: DriveConfig, vehicle: VehicleShape) -> FloatArray:
    """The highest speed (n,) along a path, with braking in time for what is to come.

    v^2 kappa <= a_lateral, v kappa <= the yaw rate, and v d delta/ds <= the rate at which the wheels, at the angle delta, turn.
    """
    bend = np.maximum(np.abs(path.curvature_1pm), 1e-6)
    bends_mps = np.minimum(np.sqrt(config.lateral_mps2 / bend), config.yaw_rate_radps / bend)
    bends_mps = np.minimum(bends_mps, STEERING_SHARE * vehicle.steering_rate_radps / _wheels_radpm(path, vehicle))
    allowed = np.minimum(limit_mps, np.maximum(bends_mps, config.creep_mps))
    braking = 2.0 * config.braking_mps2 * STEP_M * np.arange(len(allowed))
    latest = np.minimum.accumulate((allowed**2 + braking)[::-1])[::-1]  # v(i)^2 <= v(j)^2 + 2 b (u_j - u_i) for all j >= i
    speed: FloatArray = np.sqrt(latest - braking)
    return speed


def _wheels_radpm(path: Path, vehicle: VehicleShape) -> FloatArray:
    """By how much (n,) the road wheels turn per metre along a path, over ``WHEELS_OVER_M``; at least a little."""
    wheels = np.arctan(vehicle.wheelbase_m * path.curvature_1pm)
    half = round(0.5 * WHEELS_OVER_M / STEP_M)
    rows = np.arange(len(wheels))
    after, before = np.minimum(rows + half, len(rows) - 1), np.maximum(rows - half, 0)
    rate: FloatArray = np.abs(wheels[after] - wheels[before]) / (2 * half * STEP_M)
    return np.maximum(rate, 1e-6)


def _gates(network: RoadNetwork, path: Path, lanes: IntArray, starts: FloatArray) -> tuple[Gate, ...]:
    """The junctions on the way: runs of stretches inside junctions, with what is to be indicated there."""
    inside = network.is_internal[lanes]
    gates, k = [], 0
    while k < len(lanes):
        if not inside[k] or k == 0:  # a path that begins inside a junction has passed its mouth
            k += 1
            continue
        end = k
        while end < len(lanes) and inside[end]:
            end += 1
        first, last = (min(int(starts[i] / STEP_M), len(path.heading_rad) - 1) for i in (k, end))
        turn_rad = float(path.heading_rad[min(last + 8, len(path.heading_rad) - 1)] - path.heading_rad[max(first - 8, 0)])
        edge = int(network.lane_edge[lanes[end]]) if end < len(lanes) else -1
        after = int(lanes[end]) if end < len(lanes) else -1
        meets = meets_others(network, int(lanes[k - 1]), lanes[k:end].tolist(), after)
        gates.append(Gate(float(starts[k]), float(starts[end]), edge, indicated(turn_rad), meets))
        k = end
    return tuple(gates)


def meets_others(network: RoadNetwork, before: int, inside: Sequence[int], after: int) -> bool:
    """Whether others may cross or meet the way ``inside`` a junction between two lanes; ``after`` is -1 where it is unknown."""
    if after < 0 or len(network.successors(before)) > 1 or np.count_nonzero(network.successor == after) > 1:
        return True
    own = np.concatenate([network.lane_points_m(lane) for lane in inside])
    length_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(own, axis=0).T))])
    along = np.arange(0.0, length_m[-1] + STEP_M, STEP_M)
    way = np.column_stack([np.interp(along, length_m, own[:, axis]) for axis in (0, 1)])
    others = np.setdiff1d(np.flatnonzero(network.is_internal), inside)
    return any(_is_near(way, network.lane_points_m(int(lane))) for lane in others)


def _is_near(way_m: FloatArray, line_m: FloatArray) -> bool:
    """Whether points (n, 2) come near to a line (k, 2)."""
    low, high = way_m.min(axis=0) - NEAR_M, way_m.max(axis=0) + NEAR_M
    if (line_m.max(axis=0) < low).any() or (line_m.min(axis=0) > high).any():
        return False
    begin, step = line_m[:-1], np.diff(line_m, axis=0)
    apart = way_m[:, None] - begin
    share = np.einsum("nkj,kj->nk", apart, step) / np.maximum(np.einsum("kj,kj->k", step, step), 1e-9)
    off = apart - np.clip(share, 0.0, 1.0)[..., None] * step
    return bool((np.einsum("nkj,nkj->nk", off, off) < NEAR_M**2).any())


def indicated(turn_rad: float) -> Indicator:
    """What to indicate for a way that turns so much, left positive."""
    if abs(turn_rad) < INDICATED_RAD:
        return Indicator.STRAIGHT
    return Indicator.LEFT if turn_rad > 0.0 else Indicator.RIGHT


def at(values: FloatArray, u_m: float) -> float:
    """A sampled quantity of the path, linear between samples."""
    place = min(max(u_m / STEP_M, 0.0), len(values) - 1.001)
    k = int(place)
    return float(values[k] + (place - k) * (values[k + 1] - values[k]))


def place_on(course: Course, pose_m: FloatArray, u_m: float) -> float:
    """The distance along the path of the place nearest to a pose, looked for about the last one, ``u_m``."""
    points = course.path.points_m
    low = max(int((u_m - SEARCH_BEHIND_M) / STEP_M), 0)
    high = min(int((u_m + SEARCH_AHEAD_M) / STEP_M) + 2, len(points))
    apart = points[low:high] - pose_m[:2]
    cost = np.einsum("ij,ij->i", apart, apart)
    k = low + int(np.argmin(cost))
    heading = float(course.path.heading_rad[k])
    along = math.cos(heading) * (pose_m[0] - points[k, 0]) + math.sin(heading) * (pose_m[1] - points[k, 1])
    return float(np.clip(STEP_M * k + np.clip(along, -STEP_M, STEP_M), 0.0, course.last_u_m))


def offset_and_turn(course: Course, pose_m: FloatArray, u_m: float) -> tuple[float, float]:
    """Where a pose is beside the path, left positive, and its heading against the path's."""
    x, y = (at(course.path.points_m[:, axis], u_m) for axis in (0, 1))
    heading = at(course.path.heading_rad, u_m)
    dx, dy = pose_m[0] - x, pose_m[1] - y
    turn = math.remainder(pose_m[2] - heading, 2.0 * math.pi)
    return math.cos(heading) * dy - math.sin(heading) * dx, turn


def next_gate(course: Course, u_m: float) -> Gate | None:
    """The junction that the place ``u_m`` is before or in."""
    return next((gate for gate in course.gates if gate.exit_u_m > u_m), None)


def next_mouth(course: Course, u_m: float) -> Gate | None:
    """The same, of the junctions where others may have to be waited for: that is the one of which the radar tells."""
    return next((gate for gate in course.gates if gate.exit_u_m > u_m and gate.meets_others), None)


def path_poses(course: Course, from_u_m: float, to_u_m: float) -> FloatArray:
    """Poses (n, 3) of the path between two distances along it, two samples apart."""
    last = len(course.path.points_m) - 1
    rows = np.arange(min(int(from_u_m / STEP_M), last), min(int(to_u_m / STEP_M), last) + 1, 2)
    poses: FloatArray = np.column_stack([course.path.points_m[rows], course.path.heading_rad[rows]])
    return poses
