"""Map matching of the vertices of a metric map, III.B.2 of Li et al. 2025.

The noise of the model, sigma_z and beta, is estimated from the match that it leads to, in a few rounds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hippodrome.core.matching.hmm.config import PaperMatchConfig
from hippodrome.core.matching.hmm.emission import estimate_sigma_z_m, log_emission
from hippodrome.core.matching.hmm.transition import distance_difference_m, estimate_beta_m, log_transition
from hippodrome.core.matching.hmm.viterbi import viterbi
from hippodrome.core.roads.geometry import Projections, RoadGeometry, project
from hippodrome.core.roads.network import BoolArray
from hippodrome.core.roads.routing import route_distances_m, route_table
from hippodrome.core.types import FloatArray, IntArray, MatchBreak, MatchStatus, UInt8Array


@dataclass(frozen=True, slots=True, eq=False)
class MatchedPath:
    """Positions of V vertices on the roads, in parts between breaks. Unmatched vertices have lane -1 and nan elsewhere."""

    lane: IntArray  # (V,)
    position_m: FloatArray  # (V,) arc length on the lane
    matched_m: FloatArray  # (V, 2) matched position, z_t of Li et al. 2025
    status: UInt8Array  # (V,) MatchStatus
    breaks: tuple[MatchBreak, ...]
    sigma_z_m: float  # as estimated
    beta_m: float  # as estimated


class _Transitions(NamedTuple):
    """d_t of Eq. (9) for all pairs of candidates of consecutive vertices; vertex ``t`` owns rows first[t]:first[t + 1]."""

    first: NDArray[np.int64]  # (V,)
    difference_m: FloatArray  # infinite where no drive is short enough


def match(poses_m: FloatArray, geometry: RoadGeometry, config: PaperMatchConfig) -> MatchedPath:
    """Most likely lane positions of consecutive vertices.

    Args:
        poses_m: (V, 3) poses of the vertices in the network frame.
        geometry: the road network.
        config: radius of the candidates and noise to start from.
    """
    candidates = project(geometry, poses_m[:, :2], config.radius_m)
    transitions = _transitions(poses_m, candidates, geometry, config)
    sigma_z_m, beta_m = config.first_sigma_z_m, config.first_beta_m
    for _ in range(config.estimations):
        path, part = _most_likely_path(candidates, transitions, sigma_z_m, beta_m)
        sigma_z_m, beta_m = _estimated_noise(path, part, candidates, transitions, config)
    path, part = _most_likely_path(candidates, transitions, sigma_z_m, beta_m)
    status = _status(path, part, config)
    lane, position_m, matched_m = _matched_positions(path, status, candidates)
    return MatchedPath(lane, position_m, matched_m, status, _breaks(path, part, status, config), sigma_z_m, beta_m)


def _transitions(poses_m: FloatArray, candidates: Projections, geometry: RoadGeometry, config: PaperMatchConfig) -> _Transitions:
    """Compute d_t of Eq. (9), measured against driving distance, for all pairs of candidates of consecutive vertices."""
    measured_m = np.linalg.norm(np.diff(poses_m[:, :2], axis=0), axis=1)
    table = route_table(geometry, candidates.lane, config.route_slack_m + float(np.max(measured_m, initial=0.0)))
    first, route_m = route_distances_m(table, candidates.start, candidates.lane, candidates.position_m)
    difference_m = distance_difference_m(np.repeat(measured_m, np.diff(first)), route_m)
    return _Transitions(first, np.where(difference_m > config.route_slack_m, np.inf, difference_m))


def _most_likely_path(
    candidates: Projections, transitions: _Transitions, sigma_z_m: float, beta_m: float
) -> tuple[IntArray, IntArray]:
    """Candidate (V,) of each vertex and part (V,) of the path, as ``viterbi`` returns them, for the given noise."""
    emission = log_emission(candidates.distance_m, sigma_z_m)
    return viterbi(candidates.start, emission, transitions.first, log_transition(transitions.difference_m, beta_m))


def _estimated_noise(
    path: IntArray, part: IntArray, candidates: Projections, transitions: _Transitions, config: PaperMatchConfig
) -> tuple[float, float]:
    """Estimate sigma_z of Eq. (8) and beta of Eq. (9) from the present match, not below their lower bounds."""
    matched = path >= 0
    linked = np.flatnonzero(matched[:-1] & matched[1:] & (part[:-1] == part[1:]))  # vertices with a transition to the next one
    if not len(linked):
        return config.first_sigma_z_m, config.first_beta_m
    width = np.diff(candidates.start)
    own = path - candidates.start[:-1]
    chosen = transitions.first[linked] + own[linked].astype(np.int64) * width[linked + 1] + own[linked + 1]
    sigma_z_m = estimate_sigma_z_m(candidates.distance_m[path[matched]])
    beta_m = estimate_beta_m(transitions.difference_m[chosen])
    return max(sigma_z_m, config.min_sigma_z_m), max(beta_m, config.min_beta_m)


def _status(path: IntArray, part: IntArray, config: PaperMatchConfig) -> UInt8Array:
    """MatchStatus (V,): ``OFF_NETWORK`` for a vertex without candidates, ``NO_ROUTE`` in a part of too few vertices."""
    status = np.where(path >= 0, MatchStatus.MATCHED, MatchStatus.OFF_NETWORK).astype(np.uint8)
    size = np.bincount(part[part >= 0], minlength=1)
    status[(part >= 0) & (size[part] < config.min_part_vertices)] = MatchStatus.NO_ROUTE
    return status


def _matched_positions(path: IntArray, status: UInt8Array, candidates: Projections) -> tuple[IntArray, FloatArray, FloatArray]:
    """Lane (V,), arc length on it (V,) and point (V, 2) of the matched vertices; -1 and nan for the others."""
    kept = status == MatchStatus.MATCHED
    row = np.where(kept, path, 0)
    lane, position, foot = np.full(len(path), -1, np.int32), np.full(len(path), np.nan), np.full((len(path), 2), np.nan)
    if len(candidates.lane):
        lane, position = np.where(kept, candidates.lane[row], lane), np.where(kept, candidates.position_m[row], position)
        foot = np.where(kept[:, None], candidates.foot_m[row], foot)
    return lane, position, foot


def _breaks(path: IntArray, part: IntArray, status: UInt8Array, config: PaperMatchConfig) -> tuple[MatchBreak, ...]:
    """Report, in the order of the drive, where and why the match is broken.

    A break is a run of vertices without candidates, a part of too few vertices, or a step between two vertices without a route.
    """
    off = f"no road within {config.radius_m:g} m"
    short = f"fewer than {config.min_part_vertices} vertices between two breaks"
    found = [MatchBreak(a, b, MatchStatus.OFF_NETWORK, off) for a, b in _runs(status == MatchStatus.OFF_NETWORK)]
    found += [MatchBreak(a, b, MatchStatus.NO_ROUTE, short) for a, b in _runs(status == MatchStatus.NO_ROUTE)]
    apart = (path[:-1] >= 0) & (path[1:] >= 0) & (part[:-1] != part[1:])
    cause = f"no route between their roads is within {config.route_slack_m:g} m of their distance"
    found += [MatchBreak(int(t), int(t) + 1, MatchStatus.NO_ROUTE, cause) for t in np.flatnonzero(apart)]
    return tuple(sorted(found, key=lambda item: (item.first_vertex, item.last_vertex)))


def _runs(marked: BoolArray) -> list[tuple[int, int]]:
    """First and last index of each run of consecutive True values."""
    edge = np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8))
    return [(int(a), int(b) - 1) for a, b in zip(np.flatnonzero(edge == 1), np.flatnonzero(edge == -1), strict=True)]
