"""Map matching of a metric map's vertices, III.B.2 of Li et al. 2025: sigma_z and beta estimated from the match itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hippodrome.core.matching.hmm.emission import estimate_sigma_z_m, log_emission
from hippodrome.core.matching.hmm.transition import distance_difference_m, estimate_beta_m, log_transition
from hippodrome.core.matching.hmm.viterbi import viterbi
from hippodrome.core.roads.geometry import Projections, RoadGeometry, project
from hippodrome.core.roads.routing import route_distances_m, route_table
from hippodrome.core.types import FloatArray, IntArray, MatchBreak, MatchStatus, UInt8Array


@dataclass(frozen=True, slots=True)
class PaperMatchConfig:
    """Candidates, and the noise of Eqs. (8) and (9) to start from."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    radius_m: float = 45.0  # r: several times the error of a map after loop closure and alignment
    route_slack_m: float = 120.0  # a route this much longer than the motion has no likelihood left (beta is a few metres)
    first_sigma_z_m: float = 15.0  # wide, so that the first match can be wrong by a road's width and mend itself
    first_beta_m: float = 5.0
    min_sigma_z_m: float = 1.0  # below a lane's half width the emission would only tell lanes apart by the driver's wander
    min_beta_m: float = 0.5  # beta falls to nothing on clean maps and would outweigh every emission
    estimations: int = 4  # the medians are taken over the match that they shape; it settles in 2-3
    min_part_vertices: int = 3  # a shorter stretch between two breaks has no route to vouch for it


@dataclass(frozen=True, slots=True, eq=False)
class MatchedPath:
    """Positions of V vertices on the roads, in parts between breaks. Unmatched: lane -1, nan elsewhere."""

    lane: IntArray  # (V,)
    position_m: FloatArray  # (V,) arc length on the lane
    matched_m: FloatArray  # (V, 2) z_t
    status: UInt8Array  # (V,) MatchStatus
    breaks: tuple[MatchBreak, ...]
    sigma_z_m: float
    beta_m: float


def match(poses_m: FloatArray, geometry: RoadGeometry, config: PaperMatchConfig) -> MatchedPath:
    """Most likely lane positions of consecutive vertices (V, 3), given in the network frame."""
    candidates = project(geometry, poses_m[:, :2], config.radius_m)
    measured_m = np.linalg.norm(np.diff(poses_m[:, :2], axis=0), axis=1)
    table = route_table(geometry, candidates.lane, config.route_slack_m + float(np.max(measured_m, initial=0.0)))
    first, route_m = route_distances_m(table, candidates.start, candidates.lane, candidates.position_m)
    difference_m = distance_difference_m(np.repeat(measured_m, np.diff(first)), route_m)
    difference_m = np.where(difference_m > config.route_slack_m, np.inf, difference_m)
    sigma_z_m, beta_m = config.first_sigma_z_m, config.first_beta_m
    for _ in range(config.estimations):
        path, part = _search(candidates, first, difference_m, sigma_z_m, beta_m)
        sigma_z_m, beta_m = _noise(path, part, candidates, first, difference_m, config)
    path, part = _search(candidates, first, difference_m, sigma_z_m, beta_m)
    return _answer(path, part, candidates, sigma_z_m, beta_m, config)


def _search(
    candidates: Projections, first: IntArray, difference_m: FloatArray, sigma_z_m: float, beta_m: float
) -> tuple[IntArray, IntArray]:
    emission, transition = log_emission(candidates.distance_m, sigma_z_m), log_transition(difference_m, beta_m)
    return viterbi(candidates.start, emission, first, transition)


def _noise(
    path: IntArray, part: IntArray, candidates: Projections, first: IntArray, difference_m: FloatArray, config: PaperMatchConfig
) -> tuple[float, float]:
    """sigma_z of Eq. (8) and beta of Eq. (9) over the present match, not below their floors."""
    matched = path >= 0
    linked = np.flatnonzero(matched[:-1] & matched[1:] & (part[:-1] == part[1:]))
    if not len(linked):
        return config.first_sigma_z_m, config.first_beta_m
    width = np.diff(candidates.start)
    own = path - candidates.start[:-1]
    chosen = first[linked] + own[linked].astype(np.int64) * width[linked + 1] + own[linked + 1]
    sigma_z_m = estimate_sigma_z_m(candidates.distance_m[path[matched]])
    return max(sigma_z_m, config.min_sigma_z_m), max(estimate_beta_m(difference_m[chosen]), config.min_beta_m)


def _answer(
    path: IntArray, part: IntArray, candidates: Projections, sigma_z_m: float, beta_m: float, config: PaperMatchConfig
) -> MatchedPath:
    status = np.where(path >= 0, MatchStatus.MATCHED, MatchStatus.OFF_NETWORK).astype(np.uint8)
    size = np.bincount(part[part >= 0], minlength=1)
    status[(part >= 0) & (size[part] < config.min_part_vertices)] = MatchStatus.NO_ROUTE
    kept = status == MatchStatus.MATCHED
    row = np.where(kept, path, 0)
    rows = len(candidates.lane)
    lane, position, foot = np.full(len(path), -1, np.int32), np.full(len(path), np.nan), np.full((len(path), 2), np.nan)
    if rows:
        lane, position = np.where(kept, candidates.lane[row], lane), np.where(kept, candidates.position_m[row], position)
        foot = np.where(kept[:, None], candidates.foot_m[row], foot)
    return MatchedPath(lane, position, foot, status, _breaks(path, part, status, config), sigma_z_m, beta_m)


def _breaks(path: IntArray, part: IntArray, status: UInt8Array, config: PaperMatchConfig) -> tuple[MatchBreak, ...]:
    """Stretches without candidates, stretches too short to trust, and steps without a route, in the order of the drive."""
    off = f"no road within {config.radius_m:g} m"
    short = f"fewer than {config.min_part_vertices} vertices between two breaks"
    found = [MatchBreak(a, b, MatchStatus.OFF_NETWORK, off) for a, b in _runs(status == MatchStatus.OFF_NETWORK)]
    found += [MatchBreak(a, b, MatchStatus.NO_ROUTE, short) for a, b in _runs(status == MatchStatus.NO_ROUTE)]
    apart = (path[:-1] >= 0) & (path[1:] >= 0) & (part[:-1] != part[1:])
    cause = f"no route between their roads is within {config.route_slack_m:g} m of their distance"
    found += [MatchBreak(int(t), int(t) + 1, MatchStatus.NO_ROUTE, cause) for t in np.flatnonzero(apart)]
    return tuple(sorted(found, key=lambda item: (item.first_vertex, item.last_vertex)))


def _runs(marked: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> list[tuple[int, int]]:
    """First and last index of each run of True."""
    edge = np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8))
    return [(int(a), int(b) - 1) for a, b in zip(np.flatnonzero(edge == 1), np.flatnonzero(edge == -1), strict=True)]
