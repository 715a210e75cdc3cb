"""What else it could have been: stored views that resemble a frame, and lanes that lie beside a vertex."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from shapely import LineString, Point

from hippodrome.core.localization.config import LocalizerConfig
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, FloatArray, Trajectory
from hippodrome.core.views.descriptors import describe
from hippodrome.core.views.index import search
from hippodrome.core.views.scoring import bank_of, start_query_mean
from hippodrome.eval.report.evidence import DECIMALS_M, EvidenceModel, frame_times_s
from hippodrome.sim.recording import Recording

COUNT: Final = 3  # candidates that are named
ELSEWHERE_M: Final = 15.0  # views nearer to a better one than this are of the same place
BESIDE_M: Final = 20.0  # a lane farther from a vertex than this is no candidate for it


class ViewCandidate(EvidenceModel):
    """A stored view, and how much the frame resembles it."""

    view_s: float  # when it was first stored on the mapping drive
    score: float  # standard deviations of its similarity above the mean of all views'
    off_m: float | None  # from where the car truly was; None where there is no truth


class Look(EvidenceModel):
    """One moment of the second drive, and the views that its frame resembles most, the best first, each of another place."""

    method: str
    t_s: float
    views: list[ViewCandidate]


class LaneCandidate(EvidenceModel):
    """A lane beside a vertex."""

    lane: str
    apart_m: float


def looks_at(
    method: str,
    times_s: Sequence[float],
    drive: Recording,
    truth: Trajectory,
    cognitive_map: CognitiveMap,
    config: LocalizerConfig,
) -> list[Look]:
    """The candidates at some moments of a drive, each judged by its frame alone, without the frames before.

    Args:
        method: Label of the method.
        times_s: The moments.
        drive: The drive's recording.
        truth: Where the car truly was.
        cognitive_map: The map that the drive was localized in.
        config: The localizer's, which says how views are compared. A map whose views are of another kind has no candidates.
    """
    if not len(cognitive_map.view_cells.templates):
        return []
    bank = bank_of(cognitive_map.view_cells)
    if (bank.kind, tuple(bank.shape)) != (config.views.kind, config.views.shape):
        return []
    frames_s, looks = frame_times_s(drive), []
    for t_s in times_s:
        number = max(int(np.searchsorted(frames_s, t_s, "right")) - 1, 0)
        query = describe(drive.frame(number), config.views), start_query_mean(bank.mean, config.mean_trust)
        scored = search(bank, None, np.zeros(0, dtype=np.int32), query, config.views, config.search)
        scores = np.full(len(bank.templates), -np.inf)
        scores[scored.cells] = (scored.similarity - scored.mean) / max(scored.spread, config.sequence.floor(bank.kind))
        looks.append(Look(method=method, t_s=t_s, views=_best(scores, cognitive_map, _true_m(truth, t_s))))
    return looks


def _best(scores: FloatArray, cognitive_map: CognitiveMap, true_m: FloatArray | None) -> list[ViewCandidate]:
    """The best views of different places."""
    cells, first = np.unique(cognitive_map.view_cell, return_index=True)
    vertex_of = dict(zip(cells.tolist(), first.tolist(), strict=True))
    found: list[ViewCandidate] = []
    taken_m: list[FloatArray] = []
    for cell in np.argsort(-scores, kind="stable"):
        if len(found) == COUNT or not np.isfinite(scores[cell]):
            break
        if (vertex := vertex_of.get(int(cell))) is None:
            continue
        place_m = cognitive_map.poses[vertex, :2]
        if any(np.hypot(*(place_m - other)) < ELSEWHERE_M for other in taken_m):
            continue
        taken_m.append(place_m)
        off_m = None if true_m is None else round(float(np.hypot(*(place_m - true_m))), DECIMALS_M)
        view_s, score = (round(float(value), DECIMALS_M) for value in (cognitive_map.t_s[vertex], scores[cell]))
        found.append(ViewCandidate(view_s=view_s, score=score, off_m=off_m))
    return found


def _true_m(truth: Trajectory, t_s: float) -> FloatArray | None:
    if not truth.t_s[0] <= t_s <= truth.t_s[-1]:
        return None
    return np.array([np.interp(t_s, truth.t_s, truth.poses[:, axis]) for axis in (0, 1)])


def lanes_beside(place_m: FloatArray, roads: RoadNetwork, own: int) -> tuple[LaneCandidate, ...]:
    """The lanes nearest to a place (2,), but for the one it lies on, number ``own``."""
    first = roads.point_start[:-1]
    least_m, most_m = (bound.reduceat(roads.points_m, first, axis=0) for bound in (np.minimum, np.maximum))
    outside_m = np.maximum(np.maximum(least_m - place_m, place_m - most_m), 0.0)
    found = []
    for lane in np.flatnonzero(np.hypot(*outside_m.T) <= BESIDE_M).tolist():
        apart_m = LineString(roads.lane_points_m(lane)).distance(Point(place_m))
        if lane != own and apart_m <= BESIDE_M:
            found.append(LaneCandidate(lane=roads.lane_ids[lane], apart_m=round(float(apart_m), DECIMALS_M)))
    return tuple(sorted(found, key=lambda one: (one.apart_m, one.lane))[:COUNT])
