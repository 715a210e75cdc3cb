"""Where a semi-metric map lies on the road network: one similarity (scale, rotation, translation) from the start pose alone.

Section III.B of Li et al. 2025 measures vertices against roads in metres and does not say how the map came by metres. Here every
scale between wide limits, with every rotation near the start heading, is a hypothesis, held at the start pose. The hypotheses are
scored on a prefix of the drive, improved there by trimmed iterative closest points (ICP; Chetverikov et al. 2005), and thinned,
while the prefix doubles up to the whole map. A short prefix cannot tell scales apart (a straight road fits at any scale), so that
the early rounds keep many.

A hypothesis is a row (a, b, x, y) with a = s cos(r) and b = s sin(r), s being metres per map unit and r the rotation: a point
(u, v) of the map then lies at (a u - b v + x, b u + a v + y), which is linear in the hypothesis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from hippodrome.core import se2
from hippodrome.core.refinement.config import AlignmentConfig
from hippodrome.core.roads.geometry import RoadGeometry, poses_on_segments
from hippodrome.core.types import FloatArray, IntArray, StartPose

_ROAD_SPACING_M = 2.0  # spacing of the road samples: small against the truncation
_STEP_SHARE = 0.05  # sigma of an ICP step in a and b, as a share of the scale: it limits what the roads leave undetermined
_STEP_M = 30.0  # the same in translation
_OTHER_SCALE = 0.03  # relative difference in scale from which an alignment counts as another one
_OTHER_TURN_RAD = 0.05  # difference in rotation from which it does


@dataclass(frozen=True, slots=True, eq=False)
class Similarity:
    """The map's points p in the network's frame: ``scale_m R(rotation_rad) p + translation_m``."""

    scale_m: float  # metres per map unit
    rotation_rad: float
    translation_m: FloatArray  # (2,)


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """The best similarity, its cost, and the cost of the best one that differs from it."""

    similarity: Similarity
    cost: float  # as of ``_costs``; 0 is perfect
    runner_up_cost: float  # cost of the best hypothesis with another scale or rotation; 1 where none is left


def apply(similarity: Similarity, poses: FloatArray) -> FloatArray:
    """Poses (N, 3) of the map in the network's frame, metres."""
    cos, sin = np.cos(similarity.rotation_rad), np.sin(similarity.rotation_rad)
    xy = similarity.scale_m * poses[:, :2] @ np.array([[cos, sin], [-sin, cos]]) + similarity.translation_m
    return np.column_stack([xy, se2.wrap(poses[:, 2] + similarity.rotation_rad)])


def align(poses: FloatArray, start: StartPose, geometry: RoadGeometry, config: AlignmentConfig) -> Alignment:
    """Find the similarity that lays a map on the roads, from the start pose alone; the module describes the search.

    Args:
        poses: poses of the map's vertices, (V, 3) in map units.
        start: approximate pose of the first vertex in the network's frame.
        geometry: the roads.
        config: limits and steps of the search.

    Returns:
        The best similarity, with its cost and the cost of the best one that differs from it.
    """
    roads = _sampled_roads(geometry, config.heading_lever_m)
    hypotheses = _scan(start, poses[0], config)
    prefix = min(config.first_prefix, len(poses))
    for round_ in range(len(poses)):  # as the prefix doubles, it ends after a few rounds
        sample = poses[np.unique(np.linspace(0, prefix - 1, config.scored_vertices).astype(int))]
        costs = _costs(hypotheses, sample, roads, config)
        hypotheses = hypotheses[np.argsort(costs, kind="stable")[: config.kept[min(round_, len(config.kept) - 1)]]]
        for _ in range(config.icp_steps):
            hypotheses = _icp_step(hypotheses, sample, poses[0], start, roads, config)
        hypotheses = _distinct(hypotheses, _costs(hypotheses, sample, roads, config), config)
        if prefix == len(poses):
            break
        prefix = min(2 * prefix, len(poses))
    return _answer(hypotheses, _costs(hypotheses, sample, roads, config))


def _scan(start: StartPose, first: FloatArray, config: AlignmentConfig) -> FloatArray:
    """The hypotheses (H, 4) that the search begins with: every scale with every rotation near the start heading.

    The translation of each is such that the first vertex, at the pose ``first`` (3,) of the map, lies at the start position.
    """
    steps = int(np.ceil(np.log(config.max_scale_m / config.min_scale_m) / np.log1p(config.scale_step)))
    scales = np.geomspace(config.min_scale_m, config.max_scale_m, steps + 1)
    turns = int(np.ceil(config.max_turn_rad / config.turn_step_rad))
    rotations = start.heading_rad - first[2] + config.turn_step_rad * np.arange(-turns, turns + 1)
    scale, rotation = (grid.ravel() for grid in np.meshgrid(scales, rotations, indexing="ij"))
    a, b = scale * np.cos(rotation), scale * np.sin(rotation)
    return np.column_stack([a, b, start.x_m - (a * first[0] - b * first[1]), start.y_m - (b * first[0] + a * first[1])])


def _moved(hypotheses: FloatArray, poses: FloatArray) -> FloatArray:
    """The poses (H, N, 3) in the network's frame at which each of H hypotheses puts the poses (N, 3) of the map."""
    a, b, tx, ty = (column[:, None] for column in hypotheses.T)
    x, y = a * poses[:, 0] - b * poses[:, 1] + tx, b * poses[:, 0] + a * poses[:, 1] + ty
    return np.stack([x, y, poses[:, 2] + np.arctan2(b, a)], axis=-1)


def _nearest(hypotheses: FloatArray, poses: FloatArray, roads: _Roads, config: AlignmentConfig) -> tuple[FloatArray, IntArray]:
    """Distance (H, N) of each pose to the nearest road sample, position and heading together, and the index of that sample.

    Without a sample within ``truncation_m`` the distance is infinite, and the index is one past the last sample.
    """
    lifted = _lifted(_moved(hypotheses, poses), config.heading_lever_m)
    distance, sample = roads.tree.query(lifted, distance_upper_bound=config.truncation_m)
    shape = (len(hypotheses), len(poses))
    return distance.reshape(shape), sample.reshape(shape)


def _costs(hypotheses: FloatArray, poses: FloatArray, roads: _Roads, config: AlignmentConfig) -> FloatArray:
    """Cost (H,) of each hypothesis: its mean truncated distance as a share of the truncation, divided by the root of the scale.

    If distances were measured in metres, a map shrunk into one junction would fit best; in map units, one blown up would.
    Division by the root of the scale lies half-way between the two and favours neither. Hypotheses outside the limits of scale or
    misfit cost infinity.
    """
    distance, _ = _nearest(hypotheses, poses, roads, config)
    scale = np.hypot(hypotheses[:, 0], hypotheses[:, 1])
    misfit = np.mean(np.minimum(distance, config.truncation_m), axis=1) / config.truncation_m
    outside = (scale < config.min_scale_m) | (scale > config.max_scale_m) | (misfit > config.max_misfit)
    return np.where(outside, np.inf, misfit / np.sqrt(scale))


def _icp_step(
    hypotheses: FloatArray, poses: FloatArray, first: FloatArray, start: StartPose, roads: _Roads, config: AlignmentConfig
) -> FloatArray:
    """Every hypothesis (H, 4) after one trimmed point-to-line step of ICP: a linear least squares problem in (a, b, x, y).

    Its terms: the distance of every used pose from the line of its nearest road sample (``road_sigma_m``), of the first vertex
    from the start pose, and of the new hypothesis from the old, so that it stays put where the roads leave it free.
    """
    distance, sample = _nearest(hypotheses, poses, roads, config)
    trim = np.quantile(distance, config.trimmed_share, axis=1, method="higher")
    used = np.isfinite(distance) & (distance <= trim[:, None])
    sample = np.where(used, sample, 0)
    normal, offset = roads.normal[sample], np.sum(roads.normal[sample] * roads.xy[sample], axis=-1)
    rows = _rows(normal, poses[:, 0], poses[:, 1]) * used[..., None]
    normal_matrix = np.einsum("hni,hnj->hij", rows, rows) / config.road_sigma_m**2
    right = np.einsum("hni,hn->hi", rows, offset * used) / config.road_sigma_m**2
    held = _rows(np.eye(2), first[0], first[1]) / np.hypot(start.sigma_m, config.bend_sigma_m)
    target = np.array([start.x_m, start.y_m]) / np.hypot(start.sigma_m, config.bend_sigma_m)
    sigma = np.stack([_STEP_SHARE * np.hypot(hypotheses[:, 0], hypotheses[:, 1])] * 2 + [np.full(len(hypotheses), _STEP_M)] * 2)
    prior = sigma.T**-2.0
    normal_matrix += held.T @ held + prior[:, :, None] * np.eye(4)
    right += held.T @ target + prior * hypotheses
    return np.linalg.solve(normal_matrix, right[..., None])[..., 0]


def _rows(normal: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Derivatives (..., 4) of normal . p by the hypothesis (a, b, x, y), where p is the place at which it puts a map's point.

    ``normal`` (..., 2) is the line's normal, ``x`` and ``y`` (...) are the point in map units.
    """
    n_x, n_y = normal[..., 0], normal[..., 1]
    return np.stack([n_x * x + n_y * y, n_y * x - n_x * y, n_x, n_y], axis=-1)


def _distinct(hypotheses: FloatArray, costs: FloatArray, config: AlignmentConfig) -> FloatArray:
    """Sort the hypotheses by cost, and keep only the cheapest of those that ICP has brought together.

    Two of them count as one if their scales and their rotations are equal when rounded to half a step of the first scan.
    """
    order = np.argsort(costs, kind="stable")
    log_scale = np.log(np.hypot(hypotheses[order, 0], hypotheses[order, 1]))
    cell = np.column_stack([log_scale / config.scale_step, _rotation(hypotheses[order]) / config.turn_step_rad])
    _, first = np.unique(np.round(2.0 * cell).astype(int), axis=0, return_index=True)
    return hypotheses[order[np.sort(first)]]


def _rotation(hypotheses: FloatArray) -> FloatArray:
    """Rotation (H,) from map to network frame of each hypothesis (H, 4), in rad."""
    return np.arctan2(hypotheses[:, 1], hypotheses[:, 0])


def _answer(hypotheses: FloatArray, costs: FloatArray) -> Alignment:
    """The cheapest hypothesis as a similarity, its cost, and the cost of the cheapest one with another scale or rotation."""
    order = np.argsort(costs, kind="stable")
    best, scale, rotation = order[0], np.hypot(hypotheses[:, 0], hypotheses[:, 1]), _rotation(hypotheses)
    turn = np.abs(se2.wrap(rotation - rotation[best]))
    other = (np.abs(np.log(scale / scale[best])) > _OTHER_SCALE) | (turn > _OTHER_TURN_RAD)
    similarity = Similarity(float(scale[best]), float(rotation[best]), hypotheses[best, 2:])
    return Alignment(similarity, float(costs[best]), float(np.min(costs[other], initial=1.0)))


@dataclass(frozen=True, slots=True, eq=False)
class _Roads:
    """Samples of all lanes, with a spatial index."""

    xy: FloatArray  # (R, 2)
    normal: FloatArray  # (R, 2) unit vectors to the left of the lane
    tree: cKDTree  # over the lifted poses of the samples


def _sampled_roads(geometry: RoadGeometry, lever_m: float) -> _Roads:
    """Samples of all lanes, at most ``_ROAD_SPACING_M`` apart; each is the middle of an equal piece of its lane."""
    pieces = np.maximum(1, np.ceil(geometry.lane_length_m / _ROAD_SPACING_M).astype(np.int32))
    lane = np.repeat(np.arange(len(pieces), dtype=np.int32), pieces)
    piece = np.arange(len(lane)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    pose = poses_on_segments(geometry, lane, (piece + 0.5) / pieces[lane] * geometry.lane_length_m[lane])
    normal = np.column_stack([-np.sin(pose[:, 2]), np.cos(pose[:, 2])])
    return _Roads(pose[:, :2], normal, cKDTree(_lifted(pose, lever_m)))


def _lifted(poses: FloatArray, lever_m: float) -> FloatArray:
    """Poses (..., 3) as points (N, 4) (x, y, lever cos heading, lever sin heading): their distance mixes position and heading."""
    flat = poses.reshape(-1, 3)
    return np.column_stack([flat[:, :2], lever_m * np.cos(flat[:, 2]), lever_m * np.sin(flat[:, 2])])
