"""The matched route as one line with arc length: what the refinement projects its vertices onto."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hippodrome.core.matching.search.route import Route
from hippodrome.core.roads.geometry import entry_position_m, number_pieces, poses_on_segments, road_geometry
from hippodrome.core.roads.lane_graph import SHORTEST_STEP_M
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, IntArray

SPACING_M = 0.5  # spacing of the line's samples: a polyline's chord over 0.5 m is within a millimetre of any drivable curve
_CHORD_SAMPLES = 3  # headings are taken over 1.5 m either way, as in the lane graph
_BACK_M = 1.5  # positions may step back this much by rounding; farther back on the same lane means that a loop was driven


class Leg(NamedTuple):
    """A part of the route on one lane, or (lane -1) straight ahead off the network."""

    lane: int
    begin_m: float  # arc length on the lane; off the network 0
    end_m: float  # arc length on the lane; off the network the leg's length
    begin_point_m: FloatArray  # (2,) used off the network only
    end_point_m: FloatArray  # (2,) used off the network only

    @property
    def length_m(self) -> float:
        return max(self.end_m - self.begin_m, 0.0)


class _Passage(NamedTuple):
    """A move from one lane to another: from its end to a successor, or by a lane change to an adjacent lane."""

    from_lane: int
    left_at_m: float  # arc length on the lane that is left
    to_lane: int
    entered_at_m: float  # arc length on the lane that is entered


class _OpenLane(NamedTuple):
    """A lane on the stack of the depth-first search of ``_passages``, and how it was reached."""

    lane: int
    begin_m: float  # distance from the start of the walk to the lane's beginning, negative for the first lanes
    passages: list[_Passage]


@dataclass(frozen=True, slots=True, eq=False)
class RouteLine:
    """A line of P samples in driving order."""

    arc_m: FloatArray  # (P,) strictly increasing
    points_m: FloatArray  # (P, 2)
    heading_rad: FloatArray  # (P,)
    lane: IntArray  # (P,) -1: off the network
    position_m: FloatArray  # (P,) arc length on the lane; 0 off the network


def route_line(route: Route, network: RoadNetwork) -> tuple[RouteLine, FloatArray]:
    """The line through all samples of a route, and the arc length (T,) of each sample on it."""
    legs, sample_arc = _legs(route, network)
    lane, position, arc, points = _samples(legs)
    on_lane = lane >= 0
    points[on_lane] = poses_on_segments(road_geometry(network), lane[on_lane], position[on_lane])[:, :2]
    return RouteLine(arc, points, _chord_headings(points), lane, position), sample_arc


def _legs(route: Route, network: RoadNetwork) -> tuple[list[Leg], FloatArray]:
    """The legs of the route in driving order, and the arc length (T,) on the line at each sample of the route."""
    lengths = network.lane_lengths_m()
    legs: list[Leg] = []
    done, sample_arc = 0.0, np.zeros(len(route.lane))
    for t in range(1, len(route.lane)):
        step = _step_legs(route, network, lengths, t)
        done += sum(leg.length_m for leg in step)
        legs.extend(step)
        sample_arc[t] = done
    return legs, sample_arc


def _step_legs(route: Route, network: RoadNetwork, lengths_m: FloatArray, t: int) -> list[Leg]:
    """The legs between the samples ``t - 1`` and ``t`` of the route."""
    from_lane, to_lane = int(route.lane[t - 1]), int(route.lane[t])
    from_point, to_point = route.points_m[t - 1], route.points_m[t]
    if from_lane < 0 or to_lane < 0:
        return [Leg(-1, 0.0, float(np.hypot(*(to_point - from_point))), from_point, to_point)]
    begin, end = float(route.position_m[t - 1]), float(route.position_m[t])
    if from_lane == to_lane and end >= begin - _BACK_M:
        return [Leg(from_lane, begin, end, from_point, to_point)]
    driven_m = route.track.step * float(np.exp(route.log_scale[t]))
    legs, lane = [], from_lane
    for passage in _passages(network, lengths_m, (from_lane, begin), (to_lane, end), driven_m):
        legs.append(Leg(passage.from_lane, begin, passage.left_at_m, from_point, to_point))
        lane, begin = passage.to_lane, passage.entered_at_m
    return [*legs, Leg(lane, begin, end, from_point, to_point)]


def _passages(
    network: RoadNetwork, lengths_m: FloatArray, start: tuple[int, float], end: tuple[int, float], driven_m: float
) -> list[_Passage]:
    """Find the passages from lane to lane on the path between two positions (lane, arc length).

    Several paths may connect the two; the one whose length is nearest to ``driven_m`` is returned. As in the lane graph, a lane
    change is possible at the beginning only. All paths up to about 1.5 times ``driven_m`` are searched depth-first.
    """
    open_ = _first_lanes(network, lengths_m, *start)
    best: list[_Passage] = []
    best_error = np.inf
    while open_:
        lane, begin_m, passages = open_.pop()
        ahead_m = begin_m + end[1]
        if lane == end[0] and ahead_m > -_BACK_M and abs(ahead_m - driven_m) < best_error:
            best, best_error = passages, abs(ahead_m - driven_m)
        end_m = begin_m + max(float(lengths_m[lane]), SHORTEST_STEP_M)
        if end_m < 1.5 * driven_m + 2.0:
            for successor in network.successors(lane).tolist():
                passage = _Passage(lane, float(lengths_m[lane]), successor, 0.0)
                open_.append(_OpenLane(successor, end_m, [*passages, passage]))
    return best


def _first_lanes(network: RoadNetwork, lengths_m: FloatArray, lane: int, position_m: float) -> list[_OpenLane]:
    """The lane on which a path begins, and the adjacent lanes that a lane change at once leads to."""
    open_ = [_OpenLane(lane, -position_m, [])]
    for side in network.adjacent_lanes(lane):
        entered_at_m = entry_position_m(position_m, lengths_m[lane], lengths_m[side])
        open_.append(_OpenLane(side, -entered_at_m, [_Passage(lane, position_m, side, entered_at_m)]))
    return open_


def _samples(legs: list[Leg]) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Samples of the line, ``SPACING_M`` apart along the legs.

    Returns:
        Lane (P,), arc length on it (P,), arc length on the line (P,), and the point (P, 2), valid off the network only.
    """
    lengths = np.array([leg.length_m for leg in legs])
    counts = np.where(lengths > 0.0, np.maximum(1, np.round(lengths / SPACING_M)), 0).astype(np.int64)
    leg, number = number_pieces(counts)
    share = (number + 0.5) / counts[leg]
    along = share * lengths[leg]
    lane = np.array([leg.lane for leg in legs], dtype=np.int32)[leg]
    position = np.where(lane >= 0, np.array([leg.begin_m for leg in legs])[leg] + along, 0.0)
    begins, ends = (np.array([getattr(leg, name) for leg in legs])[leg] for name in ("begin_point_m", "end_point_m"))
    return lane, position, (np.cumsum(lengths) - lengths)[leg] + along, begins + share[:, None] * (ends - begins)


def _chord_headings(points_m: FloatArray) -> FloatArray:
    """Direction (P,) of the chord over ``_CHORD_SAMPLES`` either side of each sample."""
    index = np.arange(len(points_m))
    chord = points_m[np.minimum(index + _CHORD_SAMPLES, len(index) - 1)] - points_m[np.maximum(index - _CHORD_SAMPLES, 0)]
    heading: FloatArray = np.arctan2(chord[:, 1], chord[:, 0])
    return heading
