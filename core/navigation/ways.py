"""The ways that lead on from a place on the lanes: every turn at the next junctions, as stretches of lanes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from hippodrome.core.navigation.routes import SHORTEST_M, U_TURN_RAD
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.roads.paths import Piece, centreline
from hippodrome.core.types import FloatArray

MOST_WAYS: Final = 12  # from one place
MOST_PIECES: Final = 60  # of a way: a bound for networks whose lanes have no length
BEHIND_M: Final = 6.0  # a way begins so far behind, so that its first bend is smooth
CHORD_M: Final = 1.0  # half of the chord that a direction is taken over


def ways_ahead(network: RoadNetwork, lengths_m: FloatArray, lane: int, position_m: float, length_m: float) -> list[list[Piece]]:
    """The ways from a place on a lane, at least ``length_m`` long where the lanes go on; turning back is left out."""
    first = Piece(lane, max(position_m - BEHIND_M, 0.0), float(lengths_m[lane]), False, 0.0)
    done: list[list[Piece]] = []
    open_ways = [([first], float(lengths_m[lane]) - position_m)]
    while open_ways and len(done) + len(open_ways) <= MOST_WAYS:
        pieces, way_m = open_ways.pop(0)
        after = network.successors(pieces[-1].lane).tolist()
        if way_m >= length_m or not after:
            done.append(pieces)
            continue
        for one in after:
            if network.is_internal[one] and abs(_turn_rad(network, one)) > U_TURN_RAD:
                continue
            piece = Piece(one, 0.0, float(lengths_m[one]), False, 0.0)
            open_ways.append(([*pieces, piece], way_m + piece.length_m))
    return [[one for one in way if one.length_m > SHORTEST_M] for way in [*done, *(way for way, _ in open_ways)]]


def drawn_on(network: RoadNetwork, lengths_m: FloatArray, pieces: Sequence[Piece], length_m: float) -> list[Piece]:
    """A way with what follows straight on, until it is ``length_m`` long or the lanes end."""
    way = list(pieces)
    while sum(piece.length_m for piece in way) < length_m and len(way) < MOST_PIECES:
        after = network.successors(way[-1].lane).tolist()
        if not after:
            break
        lane = min(after, key=lambda one: abs(_turn_rad(network, one)))
        way.append(Piece(lane, 0.0, float(lengths_m[lane]), False, 0.0))
    return [piece for piece in way if piece.length_m > SHORTEST_M]


def way_poses(network: RoadNetwork, pieces: Sequence[Piece], ahead_m: FloatArray, position_m: float) -> FloatArray:
    """Poses (n, 3) at distances ahead of the place at ``position_m`` on the first of the pieces, along the lanes' middles."""
    points = np.concatenate([_points(network, piece) for piece in pieces])
    step = np.concatenate([[True], np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-6])
    points = points[step]
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at_m = ahead_m + position_m - pieces[0].begin_m

    def place(u_m: FloatArray) -> FloatArray:
        found: FloatArray = np.stack([np.interp(u_m, along, points[:, axis]) for axis in (0, 1)], axis=1)
        return found

    chord = place(np.minimum(at_m + CHORD_M, along[-1])) - place(np.minimum(at_m, along[-1] - CHORD_M) - CHORD_M)
    poses: FloatArray = np.column_stack([place(at_m), np.arctan2(chord[:, 1], chord[:, 0])])[at_m <= along[-1]]
    return poses


def strip(way: FloatArray, half_m: float) -> FloatArray:
    """Points (3 n, 2) on a way (n, 3) and ``half_m`` to either side of it."""
    left = np.stack([-np.sin(way[:, 2]), np.cos(way[:, 2])], axis=1)
    points: FloatArray = np.concatenate([way[:, :2] + aside * left for aside in (-half_m, 0.0, half_m)])
    return points


def moved(pose: FloatArray, distance_m: float, turned_rad: float) -> FloatArray:
    """A pose after a short arc."""
    chord = pose[2] + 0.5 * turned_rad
    step = np.array([distance_m * math.cos(chord), distance_m * math.sin(chord), turned_rad])
    after: FloatArray = pose + step
    return after


def _points(network: RoadNetwork, piece: Piece) -> FloatArray:
    """The middle (n, 2) of a stretch of a lane."""
    count = max(math.ceil(piece.length_m / 1.0), 1) + 1
    return centreline(network, piece.lane, np.linspace(piece.begin_m, piece.end_m, count))


def _turn_rad(network: RoadNetwork, lane: int) -> float:
    points = network.lane_points_m(lane)
    begin, end = points[1] - points[0], points[-1] - points[-2]
    return math.remainder(math.atan2(end[1], end[0]) - math.atan2(begin[1], begin[0]), 2.0 * math.pi)
