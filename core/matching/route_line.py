"""The matched route as one line with arc length: what the refinement projects its vertices onto."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hippodrome.core.matching.search.route import Route
from hippodrome.core.roads.geometry import poses_on_segments, road_geometry
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, IntArray

BoolArray: TypeAlias = NDArray[np.bool_]

SPACING_M = 0.5  # of the line's samples: a polyline's chord over 0.5 m is within a millimetre of any drivable curve
_CHORD_SAMPLES = 3  # heading over +-1.5 m, as in the lane graph
_BACK_M = 1.5  # states may step back by rounding; farther back on the same lane means that a loop was driven


class Leg(NamedTuple):
    """A stretch of one lane, or (lane -1) a straight step off the network."""

    lane: int
    begin_m: float
    end_m: float
    begin_point_m: FloatArray  # (2,) used off the network only
    end_point_m: FloatArray

    @property
    def length_m(self) -> float:
        return max(self.end_m - self.begin_m, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class RouteLine:
    """P samples in driving order."""

    arc_m: FloatArray  # (P,) strictly increasing
    points_m: FloatArray  # (P, 2)
    heading_rad: FloatArray  # (P,)
    lane: IntArray  # (P,) -1: off the network
    position_m: FloatArray  # (P,) on the lane; 0 off the network


def route_line(route: Route, network: RoadNetwork) -> tuple[RouteLine, FloatArray]:
    """The line through all of a route's states, and the arc length (T,) of each state on it."""
    legs, state_arc = _legs(route, network)
    lane, position, arc, points = _samples(legs)
    on_lane = lane >= 0
    points[on_lane] = poses_on_segments(road_geometry(network), lane[on_lane], position[on_lane])[:, :2]
    return RouteLine(arc, points, _chord_headings(points), lane, position), state_arc


def _legs(route: Route, network: RoadNetwork) -> tuple[list[Leg], FloatArray]:
    """Stretches driven one after the other, and the arc length (T,) at each state."""
    lengths = network.lane_lengths_m()
    legs: list[Leg] = []
    done, state_arc = 0.0, np.zeros(len(route.lane))
    for t in range(1, len(route.lane)):
        step = _step_legs(route, network, lengths, t)
        done += sum(leg.length_m for leg in step)
        legs.extend(step)
        state_arc[t] = done
    return legs, state_arc


def _step_legs(route: Route, network: RoadNetwork, lengths_m: FloatArray, t: int) -> list[Leg]:
    """What lies between the states ``t - 1`` and ``t``."""
    here, there = int(route.lane[t - 1]), int(route.lane[t])
    a, b = route.points_m[t - 1], route.points_m[t]
    if here < 0 or there < 0:
        return [Leg(-1, 0.0, float(np.hypot(*(b - a))), a, b)]
    begin, end = float(route.position_m[t - 1]), float(route.position_m[t])
    if here == there and end >= begin - _BACK_M:
        return [Leg(here, begin, end, a, b)]
    ahead = route.track.step * float(np.exp(route.log_scale[t]))
    legs, lane = [], here
    for left, at, into, entry in _chain(network, lengths_m, (here, begin), (there, end), ahead):
        legs.append(Leg(left, begin, at, a, b))
        lane, begin = into, entry
    return [*legs, Leg(lane, begin, end, a, b)]


def _chain(
    network: RoadNetwork, lengths: FloatArray, here: tuple[int, float], there: tuple[int, float], ahead_m: float
) -> list[tuple[int, float, int, float]]:
    """Passages (lane, position left at, lane entered, position entered at) from one place to another about ``ahead_m`` away."""
    lane, at = here
    open_: list[tuple[int, float, list[tuple[int, float, int, float]]]] = [(lane, -at, [])]
    for side in (int(network.left_lane[lane]), int(network.right_lane[lane])):
        if side >= 0:
            entry = at * float(lengths[side] / lengths[lane])
            open_.append((side, -entry, [(lane, at, side, entry)]))
    best: list[tuple[int, float, int, float]] = []
    best_error = np.inf
    while open_:
        on, base, passages = open_.pop()
        error = abs(base + there[1] - ahead_m)
        if on == there[0] and base + there[1] > -_BACK_M and error < best_error:
            best, best_error = passages, error
        end = base + max(float(lengths[on]), 1e-3)
        if end < 1.5 * ahead_m + 2.0:
            open_.extend((int(s), end, [*passages, (on, float(lengths[on]), int(s), 0.0)]) for s in network.successors(on))
    return best


def _samples(legs: list[Leg]) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Lane, position on it, arc length, and (off the network) point of samples along the legs."""
    lengths = np.array([leg.length_m for leg in legs])
    counts = np.where(lengths > 0.0, np.maximum(1, np.round(lengths / SPACING_M)), 0).astype(np.int64)
    leg = np.repeat(np.arange(len(legs)), counts)
    share = (np.arange(len(leg)) - np.repeat(np.cumsum(counts) - counts, counts) + 0.5) / counts[leg]
    along = share * lengths[leg]
    lane = np.array([leg.lane for leg in legs], dtype=np.int32)[leg]
    position = np.where(lane >= 0, np.array([leg.begin_m for leg in legs])[leg] + along, 0.0)
    begins, ends = (np.array([getattr(leg, name) for leg in legs])[leg] for name in ("begin_point_m", "end_point_m"))
    return lane, position, (np.cumsum(lengths) - lengths)[leg] + along, begins + share[:, None] * (ends - begins)


def _chord_headings(points_m: FloatArray) -> FloatArray:
    """Direction (P,) of the chord over ``_CHORD_SAMPLES`` either side."""
    index = np.arange(len(points_m))
    chord = points_m[np.minimum(index + _CHORD_SAMPLES, len(index) - 1)] - points_m[np.maximum(index - _CHORD_SAMPLES, 0)]
    heading: FloatArray = np.arctan2(chord[:, 1], chord[:, 0])
    return heading
