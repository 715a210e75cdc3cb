"""Places of a topometric map, laid out for recognition: where each view cell was seen, and which cells lead to which.

Cells are linked by geometry, not by the mapping drive's order: a turn that the mapping drive never took, from one mapped
street into another, is a path all the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from hippodrome.core import se2
from hippodrome.core.roads import geometry as road_geometry
from hippodrome.core.roads.geometry import RoadGeometry
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, Float32Array, FloatArray, IntArray, MatchStatus
from hippodrome.core.views.scoring import ViewCellBank, bank_of

LINK_REACH_M = 15.0  # longest step between two looks; at 30 km/h they are 5 m apart
LINK_BEND_RAD = 0.35  # the chord of a link points half its turn ahead, within this
LINK_TURN_RAD = 1.2  # no vehicle turns more within one link
BESIDE_M = 2.0  # cells closer than this are two visits of one place
SAME_PLACE_M = 15.0  # cells closer than this show the same place and are no rivals
SURE_SIGMAS = 2.0  # a position is taken to be within these of where it is believed
SAME_WAY_RAD = math.radians(30.0)  # lanes and cells that lead the same way
LANE_REACH_M = 5.0  # a second lane of the same way within this: which one is driven is unknown


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """C view cells with metric poses. ``link_*`` in CSR form: cell ``j`` is reached from ``link_from[start[j]:start[j + 1]]``."""

    bank: ViewCellBank
    poses_m: FloatArray  # (C, 3)
    sq_map: FloatArray  # (C, 3, 3) error of the map itself, m, m, rad
    tree: cKDTree  # over the positions
    roads: RoadGeometry | None  # mapped or not
    usable: NDArray[np.bool_]  # (C,) the refinement vouches for the pose
    before: IntArray  # (C,) cell of the visit before, -1: none near
    after: IntArray  # (C,)
    link_start: IntArray  # (C + 1,)
    link_from: IntArray  # (K,)
    link_length_m: FloatArray  # (K,)
    link_turn_rad: FloatArray  # (K,)
    end: NDArray[np.bool_]  # (C,) no cell leads here, or none on from here: from beyond, this is what looks most like it
    onward_start: IntArray  # (C + 1,) the same links from their source: cell ``i`` leads to ``onward[start[i]:start[i + 1]]``
    onward: IntArray  # (K,)


def places_of(cognitive_map: CognitiveMap, network: RoadNetwork | None, lane_sigma_m: float, map_sigma_m: float) -> Places:
    """The places of a topometric map; its poses are drawn to the lane's centre where a single lane fits."""
    cells = len(cognitive_map.view_cells.templates)
    vertex = first_vertex(cognitive_map.view_cell, cells)
    poses, sq_map = cognitive_map.poses[vertex], _map_covariance(cognitive_map, vertex, map_sigma_m)
    roads = None if network is None else road_geometry.road_geometry(network)
    if roads is not None and lane_sigma_m > 0.0:
        sq_across = across(sq_map, poses[:, 2])
        poses = centred(poses, roads, sq_across / (sq_across + lane_sigma_m**2))
    match = cognitive_map.road_match
    usable = np.ones(cells, dtype=np.bool_) if match is None else match.status[vertex] == MatchStatus.MATCHED
    before, after = _neighbours(vertex, cognitive_map, poses)
    tree = cKDTree(poses[:, :2])
    links = _links(poses, tree)
    bank, onward = bank_of(cognitive_map.view_cells), _onward(*links[:2])
    return Places(bank, poses, sq_map, tree, roads, usable, before, after, *links, _ends(links), *onward)


def _map_covariance(cognitive_map: CognitiveMap, vertex: IntArray, sigma_m: float) -> FloatArray:
    """(C, 3, 3) what the refinement states of each cell's vertex and ``sigma_m`` along the road; or that alone."""
    if cognitive_map.covariance is None:
        return np.tile(np.diag([sigma_m**2, sigma_m**2, 0.0]), (len(vertex), 1, 1))
    heading_rad = cognitive_map.poses[vertex, 2]
    ahead = np.stack([np.cos(heading_rad), np.sin(heading_rad), np.zeros(len(vertex))], axis=1)
    covariance: FloatArray = cognitive_map.covariance[vertex] + sigma_m**2 * ahead[:, :, None] * ahead[:, None, :]
    return covariance


def across(covariance: FloatArray, heading_rad: FloatArray) -> FloatArray:
    """Variance (N,) across the heading, of covariances (N, 3, 3)."""
    left = np.stack([-np.sin(heading_rad), np.cos(heading_rad)], axis=1)
    variance: FloatArray = np.einsum("ni,nij,nj->n", left, covariance[:, :2, :2], left)
    return variance


def is_same_place(pose_m: FloatArray, other_m: FloatArray) -> bool:
    """Whether two poses (3,) show the same street from the same side: what divides them is noise, not another hypothesis."""
    turn_rad = abs(float(se2.wrap(other_m[2] - pose_m[2])))
    return math.dist(pose_m[:2], other_m[:2]) < SAME_PLACE_M and turn_rad < LINK_TURN_RAD


def cells_here(places: Places, pose_m: FloatArray, sigma_m: float) -> IntArray:
    """Cells that show the place of ``pose_m`` (3,), or may for all that is known; none: the map does not reach here."""
    near = np.array(places.tree.query_ball_point(pose_m[:2], SAME_PLACE_M + SURE_SIGMAS * sigma_m), dtype=np.int32)
    turn_rad = np.abs(se2.wrap(places.poses_m[near, 2] - pose_m[2]))
    same_way: IntArray = near[turn_rad < LINK_TURN_RAD]
    return same_way


def is_on_road(places: Places, pose_m: FloatArray, sigma_m: float) -> bool:
    """Whether a road that leads the way of ``pose_m`` (3,) is where the pose may be for all that is known."""
    if places.roads is None:
        return True
    lanes = road_geometry.project(places.roads, pose_m[None, :2], LANE_REACH_M + SURE_SIGMAS * sigma_m)
    return bool((np.abs(se2.wrap(lanes.heading_rad - pose_m[2])) < LINK_TURN_RAD).any())


def first_vertex(view_cell: IntArray, cells: int) -> IntArray:
    """Vertex (C,) at which each cell's template was taken: the first that has the cell."""
    vertex = np.zeros(cells, dtype=np.int32)
    vertex[view_cell[::-1]] = np.arange(len(view_cell) - 1, -1, -1)
    return vertex


def _neighbours(vertex: IntArray, cognitive_map: CognitiveMap, poses: FloatArray) -> tuple[IntArray, IntArray]:
    """Cells of the vertices before and after each cell's own, where they are near and face the same way."""
    around = []
    for step in (-1, 1):
        other = vertex + step
        inside = (other >= 0) & (other < len(cognitive_map.view_cell))
        cell = cognitive_map.view_cell[np.where(inside, other, 0)]
        gap = se2.between(poses, poses[cell])
        near = (np.hypot(gap[:, 0], gap[:, 1]) < LINK_REACH_M) & (step * gap[:, 0] > 0.0) & (np.abs(gap[:, 2]) < LINK_TURN_RAD)
        around.append(np.where(inside & near, cell, -1).astype(np.int32))
    return around[0], around[1]


def _links(poses: FloatArray, tree: cKDTree) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Pairs of cells that one step of driving connects, a cell and itself included (a step shorter than the spacing)."""
    pairs = tree.query_pairs(LINK_REACH_M, output_type="ndarray")
    own = np.arange(len(poses))
    source = np.concatenate([pairs[:, 0], pairs[:, 1], own])
    target = np.concatenate([pairs[:, 1], pairs[:, 0], own])
    gap = se2.between(poses[source], poses[target])
    length = np.hypot(gap[:, 0], gap[:, 1])
    bend = np.abs(se2.wrap(np.arctan2(gap[:, 1], gap[:, 0]) - 0.5 * gap[:, 2]))
    beside = np.abs(gap[:, 1]) < 1.0  # two visits of one place: no step between them, the bearing means nothing
    possible = (np.abs(gap[:, 2]) < LINK_TURN_RAD) & ((bend < LINK_BEND_RAD) | ((length < BESIDE_M) & beside))
    source, target, length, turn = source[possible], target[possible], length[possible], gap[possible, 2]
    order = np.lexsort((source, target))
    start = np.searchsorted(target[order], np.arange(len(poses) + 1))
    return start.astype(np.int32), source[order].astype(np.int32), length[order], turn[order]


def _ends(links: tuple[IntArray, IntArray, FloatArray, FloatArray]) -> NDArray[np.bool_]:
    """Cells (C,) that no link reaches, or that no link leaves; one to another visit of the same place does not count."""
    start, source, length, _ = links
    target = np.repeat(np.arange(len(start) - 1), np.diff(start))[length > BESIDE_M]
    end = np.ones((2, len(start) - 1), dtype=np.bool_)
    end[0, target], end[1, source[length > BESIDE_M]] = False, False
    ends: NDArray[np.bool_] = np.logical_or(end[0], end[1])
    return ends


def _onward(start: IntArray, source: IntArray) -> tuple[IntArray, IntArray]:
    """The links in the order of their sources."""
    target = np.repeat(np.arange(len(start) - 1, dtype=np.int32), np.diff(start))
    order = np.argsort(source, kind="stable")
    onward_start = np.searchsorted(source[order], np.arange(len(start))).astype(np.int32)
    return onward_start, target[order]


def expected(places: Places, filtered: Float32Array, hypotheses: int) -> IntArray:
    """Cells that the best ``hypotheses`` cells of the look before lead to, with repetitions."""
    likely = np.flatnonzero(filtered > 0.0)
    if len(likely) > hypotheses:
        likely = likely[np.argpartition(-filtered[likely], hypotheses)[:hypotheses]]
    onward: IntArray = _onward_of(likely.astype(np.int32), places.onward_start, places.onward)
    return onward


@njit(cache=True)
def _onward_of(cells: IntArray, start: IntArray, onward: IntArray) -> IntArray:
    """The rows of ``cells`` in CSR form, one after the other."""
    total = 0
    for i in cells:
        total += start[i + 1] - start[i]
    gathered = np.empty(total, dtype=np.int32)
    end = 0
    for i in cells:
        for k in range(start[i], start[i + 1]):
            gathered[end] = onward[k]
            end += 1
    return gathered


@njit(cache=True)
def propagate(
    before: Float32Array,
    cells: IntArray,
    z: Float32Array,
    links: tuple[IntArray, IntArray, FloatArray, FloatArray],
    step: tuple[float, float],
    tolerance: tuple[float, float],
    memory: np.float32,
) -> Float32Array:
    """Sequence evidence (C,): F_t(j) = (1 - memory) z_t(j) + memory max(0, max F_{t-1}(i) over the i that lead to j).

    ``z`` (K,) belongs to ``cells``; the others have no evidence. ``step`` and ``tolerance``: length in m and turn in rad, of the
    motion since the last look.
    """
    start, source, length, turn = links
    filtered = np.zeros_like(before)
    for n in range(len(cells)):
        j, best = cells[n], np.float32(0.0)
        for k in range(start[j], start[j + 1]):
            fits = abs(length[k] - step[0]) <= tolerance[0] and abs(turn[k] - step[1]) <= tolerance[1]
            if fits and before[source[k]] > best:
                best = before[source[k]]
        filtered[j] = (np.float32(1.0) - memory) * z[n] + memory * best
    return filtered


def margin(places: Places, filtered: Float32Array, best: int) -> float:
    """How far the best cell stands out from the best one elsewhere; 0 when there is no elsewhere."""
    rival = _best_elsewhere(places.poses_m, filtered, best)
    return float(filtered[best]) - rival if rival > -math.inf else 0.0


@njit(cache=True)
def _best_elsewhere(poses_m: FloatArray, filtered: Float32Array, best: int) -> float:
    rival = -math.inf
    for j in range(len(filtered)):
        apart = (poses_m[j, 0] - poses_m[best, 0]) ** 2 + (poses_m[j, 1] - poses_m[best, 1]) ** 2
        if filtered[j] > rival and apart > SAME_PLACE_M**2:
            rival = filtered[j]
    return rival


def interpolated_pose(places: Places, similarity: Float32Array, cell: int) -> FloatArray:
    """Pose (3,) between views: the peak of the parabola through the similarity of a cell and its two neighbours.

    ``similarity`` (C,) is nan where it was not looked at.
    """
    before, after = places.before[cell], places.after[cell]
    own: FloatArray = places.poses_m[cell]
    if before < 0 or after < 0 or np.isnan(similarity[before] + similarity[after]):
        return own
    back_m = math.dist(own[:2], places.poses_m[before, :2])
    ahead_m = math.dist(own[:2], places.poses_m[after, :2])
    fall_back = float(similarity[cell] - similarity[before])
    fall_ahead = float(similarity[cell] - similarity[after])
    along_m = peak_offset(back_m, ahead_m, fall_back, fall_ahead)
    other, share = (after, along_m / ahead_m) if along_m > 0.0 else (before, -along_m / back_m)
    gap = places.poses_m[other] - own
    gap[2] = se2.wrap(gap[2])
    between: FloatArray = own + share * gap
    return between


def peak_offset(back_m: float, ahead_m: float, fall_back: float, fall_ahead: float) -> float:
    """Where the parabola through (-back_m, -fall_back), (0, 0), (ahead_m, -fall_ahead) peaks, at most half way to a neighbour."""
    curvature = (fall_ahead * back_m + fall_back * ahead_m) / (back_m * ahead_m * (back_m + ahead_m))
    if curvature <= 0.0:
        return 0.0
    slope = (fall_back * ahead_m**2 - fall_ahead * back_m**2) / (back_m * ahead_m * (back_m + ahead_m))
    return min(max(0.5 * slope / curvature, -0.5 * back_m), 0.5 * ahead_m)


def centred(poses_m: FloatArray, roads: RoadGeometry, share: FloatArray) -> FloatArray:
    """Poses drawn sideways by ``share`` (N,) of the way to the lane's centre, where exactly one lane of their way is near."""
    lanes = road_geometry.project(roads, poses_m[:, :2], LANE_REACH_M)
    same_way = np.abs(se2.wrap(lanes.heading_rad - poses_m[lanes.point, 2])) < SAME_WAY_RAD
    fits = np.bincount(lanes.point[same_way], minlength=len(poses_m)) == 1
    row = np.flatnonzero(same_way & fits[lanes.point])
    pulled = poses_m.copy()
    pulled[lanes.point[row], :2] += share[lanes.point[row], None] * (lanes.foot_m[row] - poses_m[lanes.point[row], :2])
    return pulled
