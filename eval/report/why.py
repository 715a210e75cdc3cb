"""What is known about each of the places at which a refined map is worst, as a file beside the results: ``why.json``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hippodrome._files import write_atomically
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, EdgeKind, FloatArray, MatchStatus
from hippodrome.eval.methods.materials import Outcome
from hippodrome.eval.methods.method import Method
from hippodrome.eval.report.candidates import LaneCandidate, lanes_beside
from hippodrome.eval.report.evidence import DECIMALS_M, MAP_JSON, EvidenceModel, Layer, read_map_evidence
from hippodrome.eval.results.kept import read_kept

WHY_JSON: Final = "why.json"
NEIGHBOURS: Final = 3  # vertices of other passes that are named
NEAR_M: Final = 15.0  # a vertex of another pass that is this near lies in the same street
OTHER_PASS: Final = 10  # vertices (about 50 m) between two passes of the same place at least
WITHIN_95: Final = 2.4477  # half axis of the ellipse that holds 95 % of a belief in the plane, in standard deviations


class Neighbour(EvidenceModel):
    """A vertex of another pass of the same street."""

    vertex: int
    apart_m: float
    error_m: float | None  # None where there is no truth at its time


class Place(EvidenceModel):
    """One vertex of a refined map, and what the map says of it."""

    method: str
    vertex: int
    status: str  # name of core.types.MatchStatus, in small letters
    lane: str | None  # None where no lane was matched
    position_m: float | None  # on that lane
    sure_m: float | None  # half axis of the ellipse that holds 95 %, as the map states it
    since_closure_m: float | None  # driven since the last loop closure; None if there was none before
    closed_with_s: float | None  # when the place of that closure had been stored
    neighbours: list[Neighbour]
    lanes: tuple[LaneCandidate, ...] = ()  # that it might have been matched to as well


class Places(EvidenceModel):
    """The content of ``why.json``."""

    places: list[Place]


def write_why(folder: Path, localized: Mapping[Method, Outcome], roads: RoadNetwork | None = None) -> None:
    """Write what the refined maps say of the worst places that ``map.json`` in a scenario's folder names."""
    maps = {method.label: outcome.refined for method, outcome in localized.items() if outcome.refined is not None}
    layers = [layer for layer in read_map_evidence(folder / MAP_JSON).methods if layer.name in maps]
    places = [place_of(layer, vertex, maps[layer.name], roads) for layer in layers for vertex in layer.worst]
    write_atomically(folder / WHY_JSON, f"{Places(places=places).model_dump_json()}\n".encode())


def read_why(path: Path) -> Places:
    """Read and validate ``why.json``. Raises ResultsError."""
    places: Places = read_kept(path, Places, "not readable", "run `hippodrome eval` again")
    return places


def place_of(layer: Layer, vertex: int, cognitive_map: CognitiveMap, roads: RoadNetwork | None = None) -> Place:
    """What a refined map says of one vertex.

    Args:
        layer: The method's vertices with their errors, as many as the map's.
        vertex: Number of the vertex.
        cognitive_map: The refined map.
        roads: The network that it was refined with, whose lanes nearby are named.
    """
    match = cognitive_map.road_match
    lane = int(match.lane[vertex]) if match is not None else -1
    closed = _closures(cognitive_map) & (np.arange(len(cognitive_map.t_s)) <= vertex)
    last = int(np.flatnonzero(closed)[-1]) if closed.any() else None
    return Place(
        method=layer.name,
        vertex=vertex,
        status="unknown" if match is None else MatchStatus(int(match.status[vertex])).name.lower().replace("_", " "),
        lane=match.lane_ids[lane] if match is not None and lane >= 0 else None,
        position_m=_number(match.position_m[vertex]) if match is not None and lane >= 0 else None,
        sure_m=None if cognitive_map.covariance is None else _half_axis_m(cognitive_map.covariance[vertex]),
        since_closure_m=None if last is None else _driven_m(cognitive_map.poses[last : vertex + 1]),
        closed_with_s=None if last is None else _partner_s(cognitive_map, last),
        neighbours=_neighbours(layer, vertex, cognitive_map.poses),
        lanes=() if roads is None else lanes_beside(cognitive_map.poses[vertex, :2], roads, lane),
    )


def _closures(cognitive_map: CognitiveMap) -> NDArray[np.bool_]:
    """Whether each vertex (V,) closed a loop with an earlier one."""
    edges = cognitive_map.edges
    later = np.maximum(edges.source, edges.target)[edges.kind == EdgeKind.CLOSURE]
    closed = np.zeros(len(cognitive_map.t_s), dtype=np.bool_)
    closed[later] = True
    return closed


def _partner_s(cognitive_map: CognitiveMap, vertex: int) -> float:
    """Time of the vertex with which a vertex closed a loop; of several, the earliest."""
    edges = cognitive_map.edges
    own = (edges.kind == EdgeKind.CLOSURE) & (np.maximum(edges.source, edges.target) == vertex)
    return round(float(cognitive_map.t_s[np.minimum(edges.source, edges.target)[own].min()]), DECIMALS_M)


def _neighbours(layer: Layer, vertex: int, poses: FloatArray) -> list[Neighbour]:
    """The nearest vertices of other passes of the same street."""
    apart_m = np.hypot(*(poses[:, :2] - poses[vertex, :2]).T)
    apart_m[max(vertex - OTHER_PASS + 1, 0) : vertex + OTHER_PASS] = np.inf
    nearest = [int(other) for other in np.argsort(apart_m, kind="stable")[:NEIGHBOURS] if apart_m[other] <= NEAR_M]
    return [
        Neighbour(vertex=other, apart_m=round(float(apart_m[other]), DECIMALS_M), error_m=layer.error_m[other])
        for other in nearest
    ]


def _driven_m(poses: FloatArray) -> float:
    return round(float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum()), DECIMALS_M)


def _half_axis_m(covariance: FloatArray) -> float | None:
    if not np.isfinite(covariance[:2, :2]).all():
        return None
    return _number(WITHIN_95 * np.sqrt(max(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]), 0.0)))


def _number(value: float) -> float | None:
    return round(float(value), DECIMALS_M) if np.isfinite(value) else None
