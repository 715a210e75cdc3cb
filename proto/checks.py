"""What must hold in every stored map: finite values, indices that point at something."""

from __future__ import annotations

from collections.abc import Iterator
from math import prod

import numpy as np

from hippodrome.core.types import UNSEEN_PERCENT, CognitiveMap, EdgeKind, LaneReadings, MatchStatus, RoadMatch
from hippodrome.proto.arrays import Array, FieldError

MOST_SECONDS = 1e11  # of a time stamp: the year 5138
MOST_UNITS = 1e9  # of a position or a motion, in units of any length from a millimetre up; squares of it are still exact enough
LEAST_SIGMA = 1e-12  # of a motion: its inverse square is a weight
MOST_LOG_SCALE = 50.0  # ln of metres per unit
MOST_METRES_READ = 1e3  # of a place or an end of a lane that was read
MOST_END = 2  # kinds of ends of a lane
MAX_DESCRIPTOR_DIMENSIONS = 8  # rows, columns, bins and room to grow


def check_map(cognitive_map: CognitiveMap) -> None:
    """Raise ``FieldError`` naming the first field and row that no map can have."""
    vertices = len(cognitive_map.t_s)
    for name, array in _floats(cognitive_map):
        _require(np.isfinite(array), name, "not finite")
    cells, edges = cognitive_map.view_cells, cognitive_map.edges
    if len(cells.shape) > MAX_DESCRIPTOR_DIMENSIONS or prod(cells.shape) != len(cells.mean):
        raise FieldError(f"descriptor shape {cells.shape[:MAX_DESCRIPTOR_DIMENSIONS]} does not make {len(cells.mean)} values")
    views = len(cells.templates)
    lowest = 0 if views else -1  # a drive without frames has no view cell, and each vertex says so
    within = (cognitive_map.view_cell >= lowest) & (cognitive_map.view_cell < views)
    _require(within, "view_cell", f"outside {lowest}..{views - 1}")
    for name, index, count in (
        ("edges.source", edges.source, vertices),
        ("edges.target", edges.target, vertices),
        ("edges.kind", edges.kind, len(EdgeKind)),
        ("visits.vertex", cognitive_map.visits.vertex, vertices),
    ):
        _require((index >= 0) & (index < count), name, f"outside 0..{count - 1}")
    for name, array, most in _magnitudes(cognitive_map):
        _require(np.abs(array) <= most, name, f"beyond {most:g}, which no vehicle does")
    _require(np.diff(cognitive_map.visits.t_s) >= 0.0, "visits.t_s", "followed by an earlier one")
    _require(edges.sigma > 0.0, "edges.sigma", "not above zero")
    _require(edges.sigma >= LEAST_SIGMA, "edges.sigma", f"below {LEAST_SIGMA:g}, which nothing is known to")
    if cognitive_map.visits.lane is not None:
        _check_readings(cognitive_map.visits.lane)
    if cognitive_map.road_match is not None:
        _check_road_match(cognitive_map.road_match)


def _magnitudes(cognitive_map: CognitiveMap) -> Iterator[tuple[str, Array, float]]:
    """Arrays whose finite values may still be none, and the largest absolute value of each."""
    yield "t_s", cognitive_map.t_s, MOST_SECONDS
    yield "visits.t_s", cognitive_map.visits.t_s, MOST_SECONDS
    yield "poses", cognitive_map.poses, MOST_UNITS
    yield "edges.motion", cognitive_map.edges.motion, MOST_UNITS
    yield "edges.sigma", cognitive_map.edges.sigma, MOST_UNITS
    yield "visits.motion", cognitive_map.visits.motion, MOST_UNITS
    if cognitive_map.log_scale is not None:
        yield "log_scale", cognitive_map.log_scale, MOST_LOG_SCALE


def _check_readings(read: LaneReadings) -> None:
    """Raise ``FieldError`` where a variance is none, or where one is finite though its value is not, or is one of no vehicle."""
    for value, variance in (
        ("offset_m", "offset_variance_m2"),
        ("heading_rad", "heading_variance_rad2"),
        ("end_m", "end_variance_m2"),
    ):
        told, spread = getattr(read, value), getattr(read, variance)
        _require(spread > 0.0, f"visits.lane.{variance}", "not above zero")
        _require(np.isfinite(told) | np.isinf(spread), f"visits.lane.{value}", "not finite, though its variance is")
        _require((np.abs(told) <= MOST_METRES_READ) | ~np.isfinite(told), f"visits.lane.{value}", "farther than a camera reads")
    _require(read.end <= MOST_END, "visits.lane.end", f"outside 0..{MOST_END}")
    if read.edge_percent is not None:
        told = (read.edge_percent <= 100) | (read.edge_percent == UNSEEN_PERCENT)
        _require(told, "visits.lane.edge_percent", f"outside 0..100, and not {UNSEEN_PERCENT}")


def _check_road_match(match: RoadMatch) -> None:
    lanes = len(match.lane_ids)
    if any("\0" in lane_id for lane_id in match.lane_ids):
        raise FieldError("road_match.lane_ids holds a zero byte")
    _require((match.lane >= -1) & (match.lane < lanes), "road_match.lane", f"outside -1..{lanes - 1}")
    _require(np.isfinite(match.position_m) == (match.lane >= 0), "road_match.position_m", "finite without a lane or the reverse")
    _require(match.status < len(MatchStatus), "road_match.status", f"outside 0..{len(MatchStatus) - 1}")


def _floats(cognitive_map: CognitiveMap) -> Iterator[tuple[str, Array]]:
    """Every array of the map that must be finite, with its name."""
    yield "t_s", cognitive_map.t_s
    yield "poses", cognitive_map.poses
    yield "view_cells.mean", cognitive_map.view_cells.mean
    yield "edges.motion", cognitive_map.edges.motion
    yield "edges.sigma", cognitive_map.edges.sigma
    yield "edges.margin", cognitive_map.edges.margin
    yield "visits.t_s", cognitive_map.visits.t_s
    yield "visits.motion", cognitive_map.visits.motion
    for name in ("head_mean_rad", "head_reliability", "grid_period", "grid_mean_rad", "grid_reliability"):
        yield f"attractors.{name}", getattr(cognitive_map.attractors, name)
    if cognitive_map.log_scale is not None:
        yield "log_scale", cognitive_map.log_scale
    if cognitive_map.covariance is not None:
        yield "covariance", cognitive_map.covariance


def _require(holds: Array, name: str, complaint: str) -> None:
    if not holds.all():
        place = tuple(int(axis) for axis in np.argwhere(~holds)[0])
        raise FieldError(f"{name}{list(place)} is {complaint}")
