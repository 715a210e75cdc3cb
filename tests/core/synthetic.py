"""Synthetic towns and semi-metric maps with known truth, shared by the tests of the refinement's two modes."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.spatial import cKDTree

from hippodrome.core import se2
from hippodrome.core.roads.geometry import poses_on_segments, road_geometry
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.solvers.gauss_newton import gauss_newton
from hippodrome.core.solvers.pose_costs import local_residual
from hippodrome.core.types import AttractorStates, CognitiveMap, EdgeKind, Edges, ViewCells, Visits

LANE_OFFSET_M = 1.6
JUNCTION_RADIUS_M = 8.0
CLOSURE_SIGMA = np.array([1.0, 0.5, 0.08])  # m, m, rad: what view cells give
ODOMETRY_SIGMA = np.array([0.15, 0.05, 0.01])  # m, m, rad over one step of 5 m


@dataclass(frozen=True)
class SyntheticDrive:
    """A semi-metric map and what is true of each of its vertices."""

    cognitive_map: CognitiveMap
    true_poses: np.ndarray  # (V, 3) network frame, metres
    true_lane: np.ndarray  # (V,) index into the network's lanes
    metres_per_unit: np.ndarray  # (V,) over the motion that ends at the vertex


def grid_network(rng, columns=6, rows=5, spacing_m=120.0, jitter_m=25.0, missing=0.15):
    """Two-way curved roads, one lane each way, driven on the right, between jittered crossings; internal lanes at crossings."""
    nodes = np.array([(c, r) for r in range(rows) for c in range(columns)], dtype=float) * spacing_m
    nodes += rng.uniform(-jitter_m, jitter_m, nodes.shape)
    links = [(i, i + 1) for i in range(rows * columns) if (i + 1) % columns]
    links += [(i, i + columns) for i in range((rows - 1) * columns)]
    keep = rng.random(len(links)) >= missing
    roads = [(a, b, rng.uniform(-12.0, 12.0)) for (a, b), kept in zip(links, keep, strict=True) if kept]
    return network_of_roads(nodes, roads)


def lanes_of(*lines, successor=()):
    """A network of the given centrelines; ``successor``: pairs (lane, lane)."""
    starts = np.cumsum([0] + [len(line) for line in lines]).astype(np.int32)
    onward = [[b for a, b in successor if a == lane] for lane in range(len(lines))]
    count = len(lines)
    return RoadNetwork(
        lane_ids=tuple(f"e{i}_0" for i in range(count)),
        edge_ids=tuple(f"e{i}" for i in range(count)),
        lane_edge=np.arange(count, dtype=np.int32),
        is_internal=np.zeros(count, dtype=bool),
        width_m=np.full(count, 3.2),
        speed_limit_mps=np.full(count, 10.0),
        points_m=np.concatenate([np.asarray(line, dtype=float) for line in lines]),
        point_start=starts,
        successor=np.array([b for after in onward for b in after], dtype=np.int32),
        successor_start=np.cumsum([0] + [len(after) for after in onward]).astype(np.int32),
        left_lane=np.full(count, -1, dtype=np.int32),
        right_lane=np.full(count, -1, dtype=np.int32),
    )


def network_of_roads(nodes, roads):
    """RoadNetwork of two-way roads (node, node, bow in metres) between nodes (n, 2)."""
    lanes, begins, ends = [], [], []
    for a, b, bow in roads:
        for sign, (start, stop) in ((1.0, (a, b)), (-1.0, (b, a))):
            lanes.append(_road_lane(nodes[start], nodes[stop], sign * bow))
            begins.append(start)
            ends.append(stop)
    roads_count, successor = len(lanes), [[] for _ in lanes]
    for i in range(roads_count):
        onward = [j for j in range(roads_count) if begins[j] == ends[i] and ends[j] != begins[i]]
        onward = onward or [j for j in range(roads_count) if begins[j] == ends[i]]  # a dead end turns back
        for j in onward:
            successor[i].append(len(lanes))
            successor.append([j])
            lanes.append(_junction_lane(lanes[i], lanes[j]))
    return _network(lanes, successor, roads_count)


def _road_lane(a, b, bow):
    """Lane from near ``a`` to near ``b`` on the right of a road that bows ``bow`` metres to its left."""
    along = (b - a) / np.linalg.norm(b - a)
    left = np.array([-along[1], along[0]])
    share = np.linspace(0.0, 1.0, 41)
    centre = a + share[:, None] * (b - a) + (bow * np.sin(np.pi * share) ** 2)[:, None] * left
    reach = np.linalg.norm(centre - a, axis=1), np.linalg.norm(centre - b, axis=1)
    centre = centre[(reach[0] > JUNCTION_RADIUS_M) & (reach[1] > JUNCTION_RADIUS_M)]
    tangent = np.gradient(centre, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    return centre + LANE_OFFSET_M * np.column_stack([tangent[:, 1], -tangent[:, 0]])


def _junction_lane(before, after):
    """Cubic from the end of one lane to the beginning of the next, tangent to both."""
    p, q = before[-1], after[0]
    reach = max(np.linalg.norm(q - p), 6.0) / 2.5
    out, into = _unit(before[-1] - before[-2]), _unit(after[1] - after[0])
    s = np.linspace(0.0, 1.0, 12)[:, None]
    c = [(1 - s) ** 3, 3 * s * (1 - s) ** 2, 3 * s**2 * (1 - s), s**3]
    return c[0] * p + c[1] * (p + reach * out) + c[2] * (q - reach * into) + c[3] * q


def _unit(vector):
    return vector / np.linalg.norm(vector)


def _network(lanes, successor, roads_count):
    count = len(lanes)
    starts = np.concatenate([[0], np.cumsum([len(lane) for lane in lanes])]).astype(np.int32)
    ids = [f"r{i}_0" if i < roads_count else f":j{i}_0" for i in range(count)]
    return RoadNetwork(
        lane_ids=tuple(ids),
        edge_ids=tuple(name[:-2] for name in ids),
        lane_edge=np.arange(count, dtype=np.int32),
        is_internal=np.arange(count) >= roads_count,
        width_m=np.full(count, 3.2),
        speed_limit_mps=np.full(count, 13.9),
        points_m=np.concatenate(lanes),
        point_start=starts,
        successor=np.array([j for onward in successor for j in onward], dtype=np.int32),
        successor_start=np.concatenate([[0], np.cumsum([len(onward) for onward in successor])]).astype(np.int32),
        left_lane=np.full(count, -1, dtype=np.int32),
        right_lane=np.full(count, -1, dtype=np.int32),
    )


def random_route(network, rng, length_m):
    """Lanes of a drive that prefers roads driven least, until ``length_m`` is reached or the road ends."""
    lengths, visits = network.lane_lengths_m(), np.zeros(network.lane_count)
    lane = int(rng.choice(np.flatnonzero(~network.is_internal)))
    route, driven = [lane], lengths[lane]
    while driven < length_m and len(network.successors(lane)):
        onward = network.successors(lane)
        beyond = np.array([visits[network.successors(k)].min(initial=visits[k]) + visits[k] for k in onward])
        lane = int(onward[np.argmin(beyond + rng.random(len(onward)))])
        visits[lane] += 1
        route.append(lane)
        driven += lengths[lane]
    return np.array(route)


def true_path(network, route, rng, step_m=5.0, wander_m=0.2):
    """Poses (V, 3) every ~``step_m`` along a route, wandering slowly about the lane's centre, and their lanes (V,)."""
    geometry = road_geometry(network)
    ends = np.cumsum(geometry.lane_length_m[route])
    arc = np.cumsum(step_m * rng.uniform(0.8, 1.2, int(ends[-1] / step_m)))
    arc = arc[arc < ends[-1]]
    leg = np.searchsorted(ends, arc, side="right")
    poses = poses_on_segments(geometry, route[leg], arc - (ends - geometry.lane_length_m[route])[leg])
    side = wander_m * np.sin(2.0 * np.pi * (arc / 90.0 + rng.random()))
    poses[:, :2] += side[:, None] * np.column_stack([-np.sin(poses[:, 2]), np.cos(poses[:, 2])])
    return poses, route[leg]


def semi_metric_drive(
    network,
    rng,
    *,
    length_m=7000.0,
    units_per_metre=0.5,
    scale_wander=0.07,
    drift_rad=1.0,
    closures=150,
    false_share=0.0,
    relaxed=True,
):
    """A drive through a network as a mapper with an unknown scale and a drifting heading would have mapped it.

    ``relaxed``: poses after robust pose-graph optimisation over the closures; otherwise dead reckoning.
    """
    truth, lane = true_path(network, random_route(network, rng, length_m), rng)
    motion = np.concatenate([np.zeros((1, 3)), se2.between(truth[:-1], truth[1:])])
    driven_m = np.cumsum(np.hypot(motion[:, 0], motion[:, 1]))
    scale = units_per_metre * (1.0 + scale_wander * np.sin(2.0 * np.pi * (driven_m / 2300.0 + rng.random())))
    motion[:, :2] *= scale[:, None]
    motion[1:, :2] *= 1.0 + 0.02 * rng.standard_normal((len(motion) - 1, 1))
    motion[1:, 2] += drift_rad * np.diff(driven_m) / 7000.0 + 0.004 * rng.standard_normal(len(motion) - 1)
    edges = _edges(truth, motion, units_per_metre, closures, false_share, rng)
    poses = se2.integrate(np.zeros(3), motion)
    poses = _relax(poses, edges) if relaxed else poses
    return SyntheticDrive(_map(poses, motion, edges, driven_m), truth, lane, 1.0 / scale)


def _edges(truth, motion, units_per_metre, closures, false_share, rng):
    """Odometry and ``closures`` closures; ``false_share`` of these join places that are not the same."""
    count = len(truth)
    a, b = _revisits(truth, closures, rng)
    false = rng.random(len(a)) < false_share
    b = np.where(false, np.clip(rng.integers(0, count, len(a)), 0, np.maximum(a - 30, 0)), b)
    seen = se2.between(truth[a], truth[b]) + CLOSURE_SIGMA * rng.standard_normal((len(a), 3))
    seen[false] = CLOSURE_SIGMA * rng.standard_normal((int(false.sum()), 3))
    units = np.array([units_per_metre, units_per_metre, 1.0])
    odometry = np.arange(count - 1)
    return Edges(
        source=np.concatenate([odometry, a]).astype(np.int32),
        target=np.concatenate([odometry + 1, b]).astype(np.int32),
        motion=np.concatenate([motion[1:], seen * units]),
        sigma=np.concatenate([np.tile(ODOMETRY_SIGMA * units, (count - 1, 1)), np.tile(CLOSURE_SIGMA * units, (len(a), 1))]),
        kind=np.repeat([EdgeKind.ODOMETRY, EdgeKind.CLOSURE], [count - 1, len(a)]).astype(np.uint8),
        margin=np.repeat([0.0, 3.0], [count - 1, len(a)]).astype(np.float32),
    )


def _revisits(truth, closures, rng):
    """Pairs (later, earlier) of vertices at one place and heading, at least 30 vertices apart."""
    pairs = cKDTree(truth[:, :2]).query_pairs(3.0, output_type="ndarray")
    b, a = np.sort(pairs, axis=1).T
    alike = (a - b >= 30) & (np.abs(se2.wrap(truth[a, 2] - truth[b, 2])) < 0.35)
    order = np.lexsort((b[alike], a[alike]))
    a, b = a[alike][order], b[alike][order]
    pick = np.sort(rng.permutation(len(a))[:closures])
    return a[pick], b[pick]


def _relax(poses, edges):
    """Robust pose graph: Geman-McClure weights on the closures, the first pose held."""

    def linearise(state):
        residual, jacobian = local_residual(state.reshape(-1, 3), edges.source, edges.target, edges.motion, edges.sigma)
        return residual * root, csr_array(diags_array(root) @ jacobian)

    scale_sq = 400.0  # a drifted map starts far from its closures: begin wide, end at 3 sigma
    while scale_sq >= 9.0:
        residual, _ = local_residual(poses, edges.source, edges.target, edges.motion, edges.sigma)
        weight = (scale_sq / (scale_sq + np.sum(residual.reshape(-1, 3) ** 2, axis=1))) ** 2
        root = np.repeat(np.sqrt(np.where(edges.kind == EdgeKind.CLOSURE, weight, 1.0)), 3)
        poses = gauss_newton(linearise, poses.ravel(), max_iterations=3, damping=1e-6).state.reshape(-1, 3)
        scale_sq /= 2.0
    poses = se2.between(poses[0], poses)
    return np.column_stack([poses[:, :2], se2.wrap(poses[:, 2])])


def _map(poses, motion, edges, driven_m):
    count = len(poses)
    t_s = driven_m / 8.0
    return CognitiveMap(
        frame="semi-metric",
        t_s=t_s,
        poses=poses,
        view_cell=np.arange(count, dtype=np.int32),
        view_cells=ViewCells("gradient", np.zeros((count, 4), np.int8), np.zeros(4, np.float32), (4,)),
        edges=edges,
        visits=Visits(t_s, np.arange(count, dtype=np.int32), motion),
        attractors=AttractorStates(
            np.zeros((count, 2), np.float32),
            np.ones((count, 2), np.float32),
            np.array([97.0], np.float32),
            np.zeros((count, 1, 2, 2), np.float32),
            np.ones((count, 1, 2, 2), np.float32),
        ),
    )
