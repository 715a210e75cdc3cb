"""Sharp corners, driven as people drive them: a little wide before, round the inner edge, and a little wide after.

A town's corner can be sharper than the turning circle. The way round it is straight, a bend whose curvature rises, holds and
falls again, and straight: its offsets from the lanes' middles before and after, and its curvature, are those that keep all wheels
best within the lanes and the ways through the junction. What is found is kept, as every plan over the corner asks for it again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import Final

import numpy as np

from hippodrome.core.navigation.config import VehicleShape
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.roads.paths import STEP_M, Path, Piece, centreline, piece_starts
from hippodrome.core.se2 import wrap
from hippodrome.core.types import FloatArray

TURNS_RAD: Final = (math.radians(35.0), math.radians(150.0))  # straighter ways need no help, and turning round has no room
OUTWARD_M: Final = (-0.2, 0.0, 0.2, 0.4, 0.6)  # offsets that are tried, away from the inside of the turn
CURVATURES_1PM: Final = (0.18, 0.22, 0.26, 0.30, 0.32)  # and curvatures; full lock is .33, the rest is for corrections
RAMP_M: Final = 1.6  # the curvature rises over it: at .5 rad/s round the bend the wheels turn by .85 rad/s, and manage .9
FINE_M: Final = 0.1  # integration of the bend
MARGIN_M: Final = 0.25  # of the wheels from the edges: .3 m of error along the way are .2 m sideways in mid-turn
SWING_M: Final = 9.0  # length over which an offset is taken up: .6 m in it are a bend of 22 m radius
LEAST_SWING_M: Final = 5.0
STRAIGHT_M: Final = 0.15  # a lane that leaves its last direction by more within the bend is no straight one
SEEN_M: Final = 20.0  # of the lanes before and after
FINER_M: Final = (-0.1, 0.0, 0.1)  # the best offsets are looked for again so near to those found
WORST_M: Final = 3.0  # the worst place counts as if it were so long: a kerb is short, and is a kerb
OFFSET_COST: Final = 2e-3  # per square metre: of two ways that keep clear the straighter one


@dataclass(frozen=True, slots=True, eq=False)
class Corner:
    """The way round a corner.

    Args:
        before_m: from the beginning of the bend to the end of the lane before the junction; negative beyond it.
        after_m: from the beginning of the lane after it to the end of the bend.
        offsets_m: from the lanes' middles before and after, left positive.
        bend: (n, 4) x, y, heading and curvature of the bend, ``FINE_M`` apart.
        cost: how badly the wheels keep within the edges; 0 is clear.
    """

    before_m: float
    after_m: float
    offsets_m: tuple[float, float]
    bend: FloatArray
    cost: float


def with_corners(network: RoadNetwork, pieces: Sequence[Piece], path: Path, vehicle: VehicleShape) -> Path:
    """The path with its sharp corners driven as ``Corner`` says, where that keeps the wheels better within the lanes."""
    starts, inside = piece_starts(pieces), network.is_internal
    k = 1
    while k < len(pieces):
        end = k
        while end < len(pieces) and inside[pieces[end].lane]:
            end += 1
        if k < end < len(pieces) and not inside[pieces[k - 1].lane] and not any(one.side_step for one in pieces[k : end + 1]):
            lanes = tuple(piece.lane for piece in pieces[k - 1 : end + 1])
            room_m = pieces[k - 1].length_m, pieces[end].length_m
            path = _with_corner(network, lanes, path, (float(starts[k]), float(starts[end])), room_m, vehicle)
        k = max(end, k + 1)
    return path


def _with_corner(
    network: RoadNetwork,
    lanes: tuple[int, ...],
    path: Path,
    at_m: tuple[float, float],
    room_m: tuple[float, float],
    vehicle: VehicleShape,
) -> Path:
    """The path with one corner, between the distances ``at_m`` along it; ``room_m`` is what is driven of the lanes beside it."""
    corner = best_corner(network, lanes, vehicle)
    if corner is None:
        return path
    begin_m, end_m = at_m[0] - corner.before_m, at_m[1] + corner.after_m
    swings_m = (
        min(SWING_M, 0.5 * float(_length_m(network, lanes[0])) - corner.before_m),
        min(SWING_M, 0.5 * float(_length_m(network, lanes[-1])) - corner.after_m),
    )
    last_m = STEP_M * (len(path.heading_rad) - 1)
    if end_m - begin_m < 1.0 or begin_m < 0.0 or end_m > last_m or room_m[1] < corner.after_m:
        return path
    rows = np.arange(max(int((begin_m - SEEN_M) / STEP_M), 0), min(int((end_m + SEEN_M) / STEP_M) + 1, len(path.heading_rad)))
    now = np.column_stack([path.points_m, path.heading_rad])[rows]
    if _cost(now, _edges(network, lanes), vehicle) <= corner.cost:
        return path
    u = STEP_M * rows.astype(np.float64)
    new = _rows_round(network, lanes, corner, u, (begin_m, end_m), at_m, swings_m)
    points, heading, curvature = path.points_m.copy(), path.heading_rad.copy(), path.curvature_1pm.copy()
    mine = np.isfinite(new[:, 0])
    points[rows[mine]] = new[mine, :2]
    heading[rows[mine]] += wrap(new[mine, 2] - heading[rows[mine]])
    curvature[rows[mine]] = new[mine, 3]
    stretch = np.maximum(np.linalg.norm(np.gradient(points, STEP_M, axis=0), axis=1), 0.05)
    return replace(path, points_m=points, heading_rad=heading, curvature_1pm=curvature, stretch=stretch)


def _rows_round(
    network: RoadNetwork,
    lanes: tuple[int, ...],
    corner: Corner,
    u_m: FloatArray,
    bend_m: tuple[float, float],
    at_m: tuple[float, float],
    swings_m: tuple[float, float],
) -> FloatArray:
    """Position, heading and curvature (n, 4) at distances along the path; nan where the path stays as it is."""
    rows = np.full((len(u_m), 4), np.nan)
    length_m = _length_m(network, lanes[0])
    first = (u_m >= bend_m[0] - swings_m[0]) & (u_m < bend_m[0])
    share = (u_m[first] - bend_m[0]) / max(swings_m[0], 1e-6) + 1.0
    rows[first] = _beside(network, lanes[0], length_m + u_m[first] - at_m[0], corner.offsets_m[0], share, swings_m[0])
    turn = (u_m >= bend_m[0]) & (u_m <= bend_m[1])
    along = (u_m[turn] - bend_m[0]) / (bend_m[1] - bend_m[0]) * (len(corner.bend) - 1)
    for column in range(4):
        rows[turn, column] = np.interp(along, np.arange(len(corner.bend)), corner.bend[:, column])
    last = (u_m > bend_m[1]) & (u_m <= bend_m[1] + swings_m[1])
    share = 1.0 - (u_m[last] - bend_m[1]) / max(swings_m[1], 1e-6)
    rows[last] = _beside(network, lanes[-1], u_m[last] - at_m[1], corner.offsets_m[1], share, -swings_m[1])
    return rows


def _beside(
    network: RoadNetwork, lane: int, along_m: FloatArray, offset_m: float, share: FloatArray, swing_m: float
) -> FloatArray:
    """Beside a lane's middle, an offset that has been taken up to ``share``, as a quintic: no jerk at its ends."""
    middle, heading = _along(network, lane, along_m)
    aside = offset_m * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    slope = offset_m * 30.0 * share**2 * (1.0 - share) ** 2 / swing_m
    bend = offset_m * 60.0 * share * (1.0 - share) * (1.0 - 2.0 * share) / swing_m**2
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    return np.column_stack([middle + aside[:, None] * left, heading + np.arctan(slope), bend])


def _along(network: RoadNetwork, lane: int, along_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (n, 2) and headings (n,) on a lane's middle, which goes straight on beyond its ends."""
    length_m = _length_m(network, lane)
    on_lane_m = np.clip(along_m, 0.5, length_m - 0.5)
    step = centreline(network, lane, on_lane_m + 0.5) - centreline(network, lane, on_lane_m - 0.5)
    heading = np.arctan2(step[:, 1], step[:, 0])
    inside_m = np.clip(along_m, 0.0, length_m)
    ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    return centreline(network, lane, inside_m) + (along_m - inside_m)[:, None] * ahead, heading


@lru_cache(maxsize=4096)
def best_corner(network: RoadNetwork, lanes: tuple[int, ...], vehicle: VehicleShape) -> Corner | None:
    """The best way from the first of these lanes through the junction to the last; None where none need be looked for."""
    begin, end = _end_pose(network, lanes[0], at_end=True), _end_pose(network, lanes[-1], at_end=False)
    turn_rad = float(wrap(end[2] - begin[2]))
    if not TURNS_RAD[0] < abs(turn_rad) < TURNS_RAD[1]:
        return None
    edges, best = _edges(network, lanes), None
    outward = -math.copysign(1.0, turn_rad)

    def better(best: Corner | None, curvature_1pm: float, first_m: float, second_m: float) -> Corner | None:
        """The corner with these offsets, outward positive, if it is the better one; else the best one so far."""
        corner = _corner(begin, end, turn_rad, curvature_1pm, (outward * first_m, outward * second_m))
        if corner is None or not _fits(network, lanes, corner):
            return best
        cost = _cost(corner.bend[:, :3], edges, vehicle) + OFFSET_COST * (first_m**2 + second_m**2)
        return replace(corner, cost=cost) if best is None or cost < best.cost else best

    for curvature, first, second in product(CURVATURES_1PM, OUTWARD_M, OUTWARD_M):
        best = better(best, curvature, first, second)
    if best is not None:
        first, second = (outward * offset for offset in best.offsets_m)
        for curvature, more, further in product(CURVATURES_1PM, FINER_M, FINER_M):
            best = better(best, curvature, first + more, second + further)
    return best


def _corner(
    begin: FloatArray, end: FloatArray, turn_rad: float, curvature_1pm: float, offsets_m: tuple[float, float]
) -> Corner | None:
    """The bend from the line of the lane before to that of the lane after, each at its offset."""
    ramp_m = RAMP_M
    hold_m = abs(turn_rad) / curvature_1pm - ramp_m
    if hold_m < 0.0:
        return None
    u = np.arange(0.0, 2.0 * ramp_m + hold_m + FINE_M, FINE_M)
    bend = math.copysign(1.0, turn_rad) * np.interp(
        u, [0.0, ramp_m, ramp_m + hold_m, 2.0 * ramp_m + hold_m], [0.0, curvature_1pm, curvature_1pm, 0.0]
    )
    heading = begin[2] + np.concatenate([[0.0], np.cumsum(0.5 * (bend[1:] + bend[:-1]) * FINE_M)])
    chord = 0.5 * (heading[1:] + heading[:-1])
    xy = np.concatenate([np.zeros((1, 2)), np.cumsum(FINE_M * np.stack([np.cos(chord), np.sin(chord)], axis=1), axis=0)])
    ahead, left = np.array([math.cos(begin[2]), math.sin(begin[2])]), np.array([-math.sin(begin[2]), math.cos(begin[2])])
    out, aside = np.array([math.cos(end[2]), math.sin(end[2])]), np.array([-math.sin(end[2]), math.cos(end[2])])
    start = begin[:2] + offsets_m[0] * left  # shifted back by before_m so that the end lies on the line of the lane after
    before_m = float(((start + xy[-1] - end[:2]) @ aside - offsets_m[1]) / (ahead @ aside))
    xy = xy + start - before_m * ahead
    return Corner(before_m, float((xy[-1] - end[:2]) @ out), offsets_m, np.column_stack([xy, heading, bend]), 0.0)


def _fits(network: RoadNetwork, lanes: tuple[int, ...], corner: Corner) -> bool:
    """Whether the lanes before and after are long enough, and straight, as far as the bend reaches into them."""
    for lane, reach_m, at_end in ((lanes[0], corner.before_m, True), (lanes[-1], corner.after_m, False)):
        length_m = _length_m(network, lane)
        if not -3.0 < reach_m < 0.5 * length_m - LEAST_SWING_M:
            return False
        pose = _end_pose(network, lane, at_end)
        along = length_m - max(reach_m, 0.0) if at_end else max(reach_m, 0.0)
        apart = centreline(network, lane, np.array([along]))[0] - pose[:2]
        if abs(-math.sin(pose[2]) * apart[0] + math.cos(pose[2]) * apart[1]) > STRAIGHT_M:
            return False
    return True


def _cost(poses: FloatArray, edges: FloatArray, vehicle: VehicleShape) -> float:
    """How far (n, 3) poses' wheels come beyond the edges less the margin, squared, summed over the way [m^3], and at worst."""
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    wheels = np.concatenate([
        np.stack([poses[:, 0] + ahead * cos - aside * sin, poses[:, 1] + ahead * sin + aside * cos], axis=1)
        for ahead in (0.0, vehicle.wheelbase_m)
        for aside in (-vehicle.half_track_m, vehicle.half_track_m)
    ])  # fmt: skip
    a, step, half_m = edges[:, :2], edges[:, 2:4], edges[:, 4]
    apart = wheels[:, None, :] - a
    share = np.clip(np.einsum("pkj,kj->pk", apart, step) / np.maximum(np.einsum("kj,kj->k", step, step), 1e-9), 0.0, 1.0)
    distance = np.linalg.norm(apart - share[:, :, None] * step, axis=2)
    beyond = np.maximum((distance - half_m).min(axis=1) + MARGIN_M, 0.0)
    spacing = float(np.mean(np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1)))
    return float(np.sum(beyond**2)) * spacing + WORST_M * float(beyond.max(initial=0.0)) ** 2


def _edges(network: RoadNetwork, lanes: tuple[int, ...]) -> FloatArray:
    """What may be driven on, the two lanes and ways into the junction beside them: segments (k, 5), start, step, half width."""
    entry, leave = int(network.lane_edge[lanes[0]]), int(network.lane_edge[lanes[-1]])
    ways = set(lanes[1:-1])
    for lane in np.flatnonzero(network.lane_edge == entry).tolist():
        ways.update(int(one) for one in network.successors(lane) if network.is_internal[one])
    for lane in np.flatnonzero(network.is_internal).tolist():
        if any(int(network.lane_edge[one]) == leave for one in network.successors(lane)):
            ways.add(lane)
    length_m = _length_m(network, lanes[0])
    parts = [centreline(network, lanes[0], np.linspace(max(length_m - SEEN_M, 0.0), length_m, 6))]
    parts.append(centreline(network, lanes[-1], np.linspace(0.0, min(SEEN_M, _length_m(network, lanes[-1])), 6)))
    parts += [network.lane_points_m(lane) for lane in sorted(ways)]
    owners = [lanes[0], lanes[-1], *sorted(ways)]
    return np.concatenate([
        np.column_stack([part[:-1], np.diff(part, axis=0), np.full(len(part) - 1, 0.5 * float(network.width_m[lane]))])
        for lane, part in zip(owners, parts, strict=True)
    ])  # fmt: skip


def _end_pose(network: RoadNetwork, lane: int, at_end: bool) -> FloatArray:
    """The pose (3,) at a lane's end, or at its beginning."""
    points = network.lane_points_m(lane)
    step = points[-1] - points[-2] if at_end else points[1] - points[0]
    return np.array([*(points[-1] if at_end else points[0]), math.atan2(step[1], step[0])])


def _length_m(network: RoadNetwork, lane: int) -> float:
    return float(np.sum(np.linalg.norm(np.diff(network.lane_points_m(lane), axis=0), axis=1)))
