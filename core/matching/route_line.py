"""The matched route as one line with arc length: what the refinement projects its vertices onto."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from hippodrome.core.matching.route_search import Route
from hippodrome.core.road_geometry import interpolate, road_geometry
from hippodrome.core.road_network import RoadNetwork
from hippodrome.core.types import FloatArray, IntArray

SPACING_M = 0.5  # of the line's samples: a polyline's chord over 0.5 m is within a millimetre of any drivable curve
_CHORD_SAMPLES = 3  # heading over +-1.5 m, as in the lane graph
_BACK_M = 1.5  # states may step back by rounding; farther back on the same lane means that a loop was driven

Leg: TypeAlias = tuple[int, float, float]  # lane, from, to (m)


@dataclass(frozen=True, slots=True, eq=False)
class RouteLine:
    """P samples in driving order."""

    arc_m: FloatArray  # (P,) strictly increasing
    points_m: FloatArray  # (P, 2)
    heading_rad: FloatArray  # (P,)
    lane: IntArray  # (P,)
    position_m: FloatArray  # (P,) on the lane


def route_line(route: Route, network: RoadNetwork) -> tuple[RouteLine, FloatArray]:
    """The line through all of a route's states, and the arc length (T,) of each state on it."""
    legs, state_arc = _legs(route, network)
    lane, position, arc = _samples(legs)
    poses = interpolate(road_geometry(network), lane, position)
    return RouteLine(arc, poses[:, :2], _chord_headings(poses[:, :2]), lane, position), state_arc


def _legs(route: Route, network: RoadNetwork) -> tuple[list[Leg], FloatArray]:
    """Stretches driven one after the other, and the arc length (T,) at each state."""
    lengths = network.lane_lengths_m()
    lane, begin = int(route.lane[0]), float(route.position_m[0])
    legs: list[Leg] = []
    done, state_arc = 0.0, np.zeros(len(route.lane))
    for t in range(1, len(route.lane)):
        target, position = int(route.lane[t]), float(route.position_m[t])
        if target != lane or position < float(route.position_m[t - 1]) - _BACK_M:
            ahead = route.track.step * float(np.exp(route.log_scale[t]))
            at = float(route.position_m[t - 1])
            for first, last, into, entry in _chain(network, lengths, (lane, at), (target, position), ahead):
                legs.append((first, begin, last))
                done += max(last - begin, 0.0)
                lane, begin = into, entry
        state_arc[t] = done + max(position - begin, 0.0)
    legs.append((lane, begin, max(begin, float(route.position_m[-1]))))
    return legs, np.maximum.accumulate(state_arc)


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


def _samples(legs: list[Leg]) -> tuple[IntArray, FloatArray, FloatArray]:
    """Lane, position on it and arc length of samples along the legs."""
    lane, position, arc, done = [], [], [], 0.0
    for on, begin, end in legs:
        length = end - begin
        if length <= 0.0:
            continue
        along = (np.arange(max(1, round(length / SPACING_M))) + 0.5) * (length / max(1, round(length / SPACING_M)))
        lane.append(np.full(len(along), on, dtype=np.int32))
        position.append(begin + along)
        arc.append(done + along)
        done += length
    return np.concatenate(lane), np.concatenate(position), np.concatenate(arc)


def _chord_headings(points_m: FloatArray) -> FloatArray:
    """Direction (P,) of the chord over ``_CHORD_SAMPLES`` either side."""
    index = np.arange(len(points_m))
    chord = points_m[np.minimum(index + _CHORD_SAMPLES, len(index) - 1)] - points_m[np.maximum(index - _CHORD_SAMPLES, 0)]
    heading: FloatArray = np.arctan2(chord[:, 1], chord[:, 0])
    return heading
