"""The place map: a topometric map in the form for place recognition. It tells where each view cell was seen and which follow it.

Cells are linked by geometry, not by the order of the mapping drive: a turn that the mapping drive never took, from one mapped
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
from hippodrome.core.roads.geometry import RoadGeometry, project, road_geometry
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, Float32Array, FloatArray, IntArray, MatchStatus
from hippodrome.core.views.graph import Paths, Predecessors
from hippodrome.core.views.peaks import peak_of_drops
from hippodrome.core.views.scoring import ViewCellBank, bank_of

LINK_REACH_M = 15.0  # longest step between two query frames that links allow; at 30 km/h query frames are 5 m apart
LINK_BEND_RAD = 0.35  # the chord of a link must point half its turn ahead, as that of a circular arc does, within this
LINK_TURN_RAD = 1.2  # no vehicle turns more within one link
BESIDE_M = 2.0  # cells closer than this are two visits of one place
SAME_PLACE_M = 15.0  # cells closer than this show the same place and are no rivals
SURE_SIGMAS = 2.0  # the true position is taken to lie within this many standard deviations of the believed one
SAME_WAY_RAD = math.radians(30.0)  # lanes and cells whose headings differ by less than this lead the same way
LANE_REACH_M = 5.0  # with a second lane of the same way within this distance it is unknown which of them is driven


@dataclass(frozen=True, slots=True, eq=False)
class PlaceMap:
    """C view cells with metric poses, and the links between them. Made by ``make_place_map``."""

    bank: ViewCellBank
    poses_m: FloatArray  # (C, 3) where each cell was seen; metres and rad
    map_covariance: FloatArray  # (C, 3, 3) error of the map itself at each cell; m, m, rad
    tree: cKDTree  # over the positions of the cells
    roads: RoadGeometry | None  # all roads of the network, mapped or not; None: no network was given
    usable: NDArray[np.bool_]  # (C,) whether the refinement vouches for the pose
    before: IntArray  # (C,) cell of the visit before, -1: none near
    after: IntArray  # (C,) cell of the visit after, -1: none near
    predecessors: Predecessors  # links by the cell that they lead to: lengths in m, one step of driving at most
    at_end: NDArray[np.bool_]  # (C,) no cell leads here, or none leads on from here: where a mapped road ends
    successor_start: IntArray  # (C + 1,) the same links by the cell that they come from, in CSR form:
    successor: IntArray  # (K,) cell ``i`` leads to the rows ``successor_start[i]`` to ``successor_start[i + 1]`` of this


def make_place_map(cognitive_map: CognitiveMap, network: RoadNetwork | None, lane_sigma_m: float, map_sigma_m: float) -> PlaceMap:
    """Prepare a topometric map for recognition: where each view cell was seen, and which cells lead to which.

    Args:
        cognitive_map: a map in the network frame.
        network: its road network. Where a single lane fits, poses are drawn towards the centre of that lane.
        lane_sigma_m: standard deviation of drivers about the centre of their lane; 0: poses stay as they are.
        map_sigma_m: standard deviation of the map's error along the road, on top of what the map's own covariance states.
    """
    cells = len(cognitive_map.view_cells.templates)
    vertex = first_vertex(cognitive_map.view_cell, cells)
    poses_m, map_covariance = cognitive_map.poses[vertex], _map_covariance(cognitive_map, vertex, map_sigma_m)
    roads = None if network is None else road_geometry(network)
    if roads is not None and lane_sigma_m > 0.0:
        sq_lateral = lateral_variance(map_covariance, poses_m[:, 2])
        poses_m = drawn_to_lanes(poses_m, roads, sq_lateral / (sq_lateral + lane_sigma_m**2))
    match = cognitive_map.road_match
    usable = np.ones(cells, dtype=np.bool_) if match is None else match.status[vertex] == MatchStatus.MATCHED
    before, after = _neighbours(vertex, cognitive_map, poses_m)
    tree = cKDTree(poses_m[:, :2])
    links = _links(poses_m, tree)
    successor_start, successor = _by_source(links)
    return PlaceMap(
        bank=bank_of(cognitive_map.view_cells),
        poses_m=poses_m,
        map_covariance=map_covariance,
        tree=tree,
        roads=roads,
        usable=usable,
        before=before,
        after=after,
        predecessors=links,
        at_end=_ends(links),
        successor_start=successor_start,
        successor=successor,
    )


def _map_covariance(cognitive_map: CognitiveMap, vertex: IntArray, sigma_m: float) -> FloatArray:
    """Covariance (C, 3, 3) of the map's error at each cell: that of the cell's vertex, plus ``sigma_m`` along the road.

    In a map without covariances the error is ``sigma_m`` both along and across the road.
    """
    if cognitive_map.covariance is None:
        return np.tile(np.diag([sigma_m**2, sigma_m**2, 0.0]), (len(vertex), 1, 1))
    heading_rad = cognitive_map.poses[vertex, 2]
    ahead = np.stack([np.cos(heading_rad), np.sin(heading_rad), np.zeros(len(vertex))], axis=1)
    covariance: FloatArray = cognitive_map.covariance[vertex] + sigma_m**2 * ahead[:, :, None] * ahead[:, None, :]
    return covariance


def lateral_variance(covariance: FloatArray, heading_rad: FloatArray) -> FloatArray:
    """Variance (N,) in m^2 of positions across their headings (N,), from the covariances (N, 3, 3) of the poses."""
    left = np.stack([-np.sin(heading_rad), np.cos(heading_rad)], axis=1)
    variance: FloatArray = np.einsum("ni,nij,nj->n", left, covariance[:, :2, :2], left)
    return variance


def is_same_place(pose_m: FloatArray, other_m: FloatArray) -> bool:
    """Whether two poses (3,) are near each other and face the same way, so that noise alone may explain their difference."""
    turn_rad = abs(float(se2.wrap(other_m[2] - pose_m[2])))
    return math.dist(pose_m[:2], other_m[:2]) < SAME_PLACE_M and turn_rad < LINK_TURN_RAD


def cells_around(places: PlaceMap, pose_m: FloatArray, sigma_m: float) -> IntArray:
    """Cells that show the place of ``pose_m`` (3,), or may show it, as the position is known to ``sigma_m`` only.

    An empty result means that the map does not reach there.
    """
    near = np.array(places.tree.query_ball_point(pose_m[:2], SAME_PLACE_M + SURE_SIGMAS * sigma_m), dtype=np.int32)
    turn_rad = np.abs(se2.wrap(places.poses_m[near, 2] - pose_m[2]))
    same_way: IntArray = near[turn_rad < LINK_TURN_RAD]
    return same_way


def may_be_on_road(places: PlaceMap, pose_m: FloatArray, sigma_m: float) -> bool:
    """Whether the pose ``pose_m`` (3,) may be on a road, as its position is known to ``sigma_m`` only.

    It may be if a lane of about the same direction lies near enough, and always without a network.
    """
    if places.roads is None:
        return True
    lanes = project(places.roads, pose_m[None, :2], LANE_REACH_M + SURE_SIGMAS * sigma_m)
    return bool((np.abs(se2.wrap(lanes.heading_rad - pose_m[2])) < LINK_TURN_RAD).any())


def first_vertex(view_cell: IntArray, cells: int) -> IntArray:
    """Vertex (C,) at which each view cell was stored: the first of the vertices that share the cell.

    ``view_cell`` (V,) has the cell of each vertex, ``cells`` is their number C.
    """
    vertex = np.zeros(cells, dtype=np.int32)
    vertex[view_cell[::-1]] = np.arange(len(view_cell) - 1, -1, -1)
    return vertex


def _neighbours(vertex: IntArray, cognitive_map: CognitiveMap, poses_m: FloatArray) -> tuple[IntArray, IntArray]:
    """Cells of the vertices before and after each cell's own ``vertex`` (C,), between which its pose can be interpolated.

    They are -1 where there is no such vertex, or where its cell is far away, lies on the wrong side or faces another way.
    """
    neighbours = []
    for step in (-1, 1):
        other = vertex + step
        exists = (other >= 0) & (other < len(cognitive_map.view_cell))
        cell = cognitive_map.view_cell[np.where(exists, other, 0)]
        relative = se2.between(poses_m, poses_m[cell])
        near = np.hypot(relative[:, 0], relative[:, 1]) < LINK_REACH_M
        in_order = (step * relative[:, 0] > 0.0) & (np.abs(relative[:, 2]) < LINK_TURN_RAD)
        neighbours.append(np.where(exists & near & in_order, cell, -1).astype(np.int32))
    return neighbours[0], neighbours[1]


def _links(poses_m: FloatArray, tree: cKDTree) -> Predecessors:
    """Links between the cells that one step of driving may connect.

    Each cell is linked with itself, for a step shorter than the spacing. Two cells are linked if a circular arc leads from one to
    the other, or if they lie side by side: then they are two visits of one place, and the bearing between them means nothing.
    """
    pairs = tree.query_pairs(LINK_REACH_M, output_type="ndarray")
    own = np.arange(len(poses_m))
    source = np.concatenate([pairs[:, 0], pairs[:, 1], own])
    target = np.concatenate([pairs[:, 1], pairs[:, 0], own])
    relative = se2.between(poses_m[source], poses_m[target])
    length = np.hypot(relative[:, 0], relative[:, 1])
    bend = np.abs(se2.wrap(np.arctan2(relative[:, 1], relative[:, 0]) - 0.5 * relative[:, 2]))
    beside = (length < BESIDE_M) & (np.abs(relative[:, 1]) < 1.0)
    possible = (np.abs(relative[:, 2]) < LINK_TURN_RAD) & ((bend < LINK_BEND_RAD) | beside)
    source, target, length, turn_rad = source[possible], target[possible], length[possible], relative[possible, 2]
    order = np.lexsort((source, target))
    start = np.searchsorted(target[order], np.arange(len(poses_m) + 1))
    return Predecessors(start.astype(np.int32), Paths(source[order].astype(np.int32), length[order], turn_rad[order]))


def _ends(links: Predecessors) -> NDArray[np.bool_]:
    """Cells (C,) that no link reaches, or that no link leaves; links between two visits of one place do not count."""
    cells, leads_on = len(links.start) - 1, links.paths.length > BESIDE_M
    target = np.repeat(np.arange(cells), np.diff(links.start))
    no_link_in, no_link_out = np.ones((2, cells), dtype=np.bool_)
    no_link_in[target[leads_on]] = False
    no_link_out[links.paths.source[leads_on]] = False
    ends: NDArray[np.bool_] = no_link_in | no_link_out
    return ends


def _by_source(links: Predecessors) -> tuple[IntArray, IntArray]:
    """The links sorted by the cell that they come from, in CSR form: row starts (C + 1,), and the cells (K,) that they lead to.

    ``links`` is sorted by the cells that the links lead to; this is the transposed table, for ``likely_cells``.
    """
    target = np.repeat(np.arange(len(links.start) - 1, dtype=np.int32), np.diff(links.start))
    order = np.argsort(links.paths.source, kind="stable")
    start = np.searchsorted(links.paths.source[order], np.arange(len(links.start))).astype(np.int32)
    return start, target[order]


def likely_cells(places: PlaceMap, filtered: Float32Array, hypotheses: int) -> IntArray:
    """Cells that one step of driving leads to from the ``hypotheses`` cells with the most evidence, with repetitions.

    ``filtered`` (C,) is the evidence after the query frame before.
    """
    best = np.flatnonzero(filtered > 0.0)
    if len(best) > hypotheses:
        best = best[np.argpartition(-filtered[best], hypotheses)[:hypotheses]]
    successors: IntArray = _rows(best.astype(np.int32), places.successor_start, places.successor)
    return successors


@njit(cache=True)
def _rows(numbers: IntArray, start: IntArray, values: IntArray) -> IntArray:
    """The rows ``numbers`` (n,) of a table in CSR form (row starts ``start``, entries ``values``), one after the other."""
    total = 0
    for i in numbers:
        total += start[i + 1] - start[i]
    gathered = np.empty(total, dtype=np.int32)
    end = 0
    for i in numbers:
        for k in range(start[i], start[i + 1]):
            gathered[end] = values[k]
            end += 1
    return gathered


def margin(places: PlaceMap, filtered: Float32Array, best: int) -> float:
    """Evidence of the best cell minus that of the best one at another place; 0 if there is no other place.

    It says how clearly the place of the cell ``best`` stands out.
    """
    rival = _best_elsewhere(places.poses_m, filtered, best)
    return float(filtered[best]) - rival if rival > -math.inf else 0.0


@njit(cache=True)
def _best_elsewhere(poses_m: FloatArray, filtered: Float32Array, best: int) -> float:
    """The evidence of the strongest rival of the cell ``best``, one farther away than SAME_PLACE_M; minus infinity without any.

    ``poses_m`` (C, 3) are the poses of the cells, ``filtered`` (C,) is their evidence.
    """
    rival = -math.inf
    for j in range(len(filtered)):
        sq_apart = (poses_m[j, 0] - poses_m[best, 0]) ** 2 + (poses_m[j, 1] - poses_m[best, 1]) ** 2
        if filtered[j] > rival and sq_apart > SAME_PLACE_M**2:
            rival = filtered[j]
    return rival


def interpolated_pose(places: PlaceMap, similarity: Float32Array, cell: int) -> FloatArray:
    """Pose (3,) between views: the peak of the parabola through the similarities of a cell and of its two neighbours.

    ``similarity`` (C,) is nan for cells that were not scored; without both neighbours it is the cell's own pose.
    """
    before, after = places.before[cell], places.after[cell]
    own: FloatArray = places.poses_m[cell]
    if before < 0 or after < 0 or np.isnan(similarity[before] + similarity[after]):
        return own
    back_m = math.dist(own[:2], places.poses_m[before, :2])
    ahead_m = math.dist(own[:2], places.poses_m[after, :2])
    drop_back = float(similarity[cell] - similarity[before])
    drop_ahead = float(similarity[cell] - similarity[after])
    along_m = peak_of_drops(back_m, ahead_m, drop_back, drop_ahead)
    neighbour, share = (after, along_m / ahead_m) if along_m > 0.0 else (before, -along_m / back_m)
    difference = places.poses_m[neighbour] - own
    difference[2] = se2.wrap(difference[2])
    between: FloatArray = own + share * difference
    return between


def drawn_to_lanes(poses_m: FloatArray, roads: RoadGeometry, share: FloatArray) -> FloatArray:
    """Poses (N, 3) moved by a ``share`` (N,) of their way to the lane's centreline, to correct lateral errors of the map.

    Drivers keep to about the middle of their lane. A pose is moved only if exactly one lane of its direction is near: with
    several, it is unknown which of them was driven.
    """
    lanes = project(roads, poses_m[:, :2], LANE_REACH_M)
    same_way = np.abs(se2.wrap(lanes.heading_rad - poses_m[lanes.point, 2])) < SAME_WAY_RAD
    single = np.bincount(lanes.point[same_way], minlength=len(poses_m)) == 1
    row = np.flatnonzero(same_way & single[lanes.point])
    drawn = poses_m.copy()
    drawn[lanes.point[row], :2] += share[lanes.point[row], None] * (lanes.foot_m[row] - poses_m[lanes.point[row], :2])
    return drawn
