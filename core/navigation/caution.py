"""Ways that are driven by what is likely, and not by what is known: whether they are seen to be road, and how fast to go."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from hippodrome.core.navigation.border import CELL_M, OTHER, PAINT, ROAD, UNKNOWN, borders
from hippodrome.core.navigation.config import NavigatorConfig
from hippodrome.core.navigation.sight import Ground
from hippodrome.core.navigation.speed import in_sight_mps
from hippodrome.core.navigation.ways import strip
from hippodrome.core.types import FloatArray

SEEN, NOT_ROAD = 0.7, 0.05  # so much of a guess, as far as it can be seen, must have been, and hardly any of it be no road
LEAST_SEEN: Final = 0.4  # of all of it
EDGES_M: Final = 12.0  # about the vehicle, within which lines at the edge are looked for
ON_EDGE: Final = 0.1  # of a guess: one place alone is a speck
BODY_M: Final[FloatArray] = np.linspace(-0.8, 0.8, 17)  # across the body: a line is hardly as wide as a cell
AHEAD_M, HALF_BODY_M = (2.0, 11.0), 0.8  # of a way, which must not lead off the road
OFF_ROAD: Final = 0.15  # of it
LEAST_PLACES: Final = 2  # of a way that are seen to be no road: one alone is a speck
ACROSS_M: Final = 9.0  # from where a turn begins to what lies across: a road of 6.4 m, and the way in which the wheels turn
CORNER_M: Final = 4.5  # from where the wheels begin to turn to where the border ends: sharp corners are begun 2.8 m before
GUESSED_MPS: Final = 2.0  # on a way that not all likely places have, and where hardly any road is seen
TURN_MPS: Final = 2.5  # at which the wheels can be turned in that way
BRAKING_MPS2: Final = 2.5  # comfortable
BESIDE_M: Final[FloatArray] = np.arange(1.0, 2.7, 0.2)  # from a way, where the border on the own side is looked for
GAP_PLACES: Final = 4  # places of a way without a border beside them, from which on it has ended: not a dent in it
BEYOND_M: Final = (6.4, 8.0)  # beyond the end of the border the road goes on, if there is road
GOES_ON: Final = 0.6  # so much of that must be seen, and be road
WALK_M: Final = 8.0  # along a way that must have been seen, from the rear axle, to drive at a walk
STRETCH: Final = 4  # places of a way that are judged together: far ahead the rows of a frame lie a metre apart ..
STRETCH_SEEN: Final = 0.25  # .. so that no more of them may have been seen


def seems_road(ground: Ground, ahead: FloatArray) -> bool:
    """Whether a way (n, 3), in the vehicle's axes, has been seen, and to be road.

    In a sharp corner the way lies behind the pavement within, or beside the camera's view. That counts once it has been seen, and
    not before: else the vehicle would leave a likely way right in the corner, for a search on sight that sees no more of it.
    """
    points = strip(ahead, HALF_BODY_M)
    kinds = ground.kinds_at(points)
    seen = kinds != UNKNOWN
    can_be_seen = seen | ground.in_view(points)
    enough = np.mean(seen) > LEAST_SEEN and np.sum(seen) > SEEN * np.sum(can_be_seen)
    return bool(enough and np.mean(kinds == OTHER) < NOT_ROAD and edge_share(ground, ahead) < ON_EDGE)


def edge_share(ground: Ground, ahead: FloatArray) -> float:
    """On which share of the places of a way (n, 3), in the vehicle's axes, the body is on a painted line at the road's edge.

    In fog a pavement has the level of asphalt, and the line is what tells where the road ends.
    """
    left = np.stack([-np.sin(ahead[:, 2]), np.cos(ahead[:, 2])], axis=1)
    points_m = (ahead[:, None, :2] + BODY_M[None, :, None] * left[:, None, :]).reshape(-1, 2)
    part, corner_m = ground.around(EDGES_M)
    edges = (part == PAINT) & (borders(part) > 0)
    cos, sin = math.cos(ground.pose[2]), math.sin(ground.pose[2])
    x = ground.pose[0] + cos * points_m[:, 0] - sin * points_m[:, 1]
    y = ground.pose[1] + sin * points_m[:, 0] + cos * points_m[:, 1]
    i, j = (np.floor((value - low) / CELL_M).astype(np.int64) for value, low in ((x, corner_m[0]), (y, corner_m[1])))
    inside = (i >= 0) & (j >= 0) & (i < edges.shape[0]) & (j < edges.shape[1])
    on_edge = np.zeros(len(points_m), dtype=np.bool_)
    on_edge[inside] = edges[i[inside], j[inside]]
    return float(np.mean(on_edge.reshape(len(ahead), -1).any(axis=1)))


def seen_ahead(ground: Ground, ahead: FloatArray, from_m: float) -> tuple[bool, float]:
    """Whether a way has been seen to be road as far as it takes to walk it, and how far it has been.

    Args:
        ground: what was seen of it.
        ahead: poses (n, 3) of the way, in the vehicle's axes, evenly spaced.
        from_m: distance along the way of the first of them.
    """
    if len(ahead) < STRETCH:
        return False, 0.0
    step_m = float(np.hypot(*(ahead[1, :2] - ahead[0, :2])))
    kinds = ground.kinds_at(strip(ahead, HALF_BODY_M)).reshape(3, len(ahead))
    stretches = np.lib.stride_tricks.sliding_window_view(kinds, STRETCH, axis=1)
    seen, other = np.mean(stretches != UNKNOWN, axis=(0, 2)), np.mean(stretches == OTHER, axis=(0, 2))
    ends = np.flatnonzero((seen < STRETCH_SEEN) | (other > OFF_ROAD))
    far_m = from_m + step_m * float(ends[0] if len(ends) else len(ahead) - 1)
    return seems_road(ground, ahead[: int((WALK_M - from_m) / step_m) + 1]), far_m


def leads_off_road(ground: Ground, ahead: FloatArray) -> bool:
    """Whether a way (n, 3), in the vehicle's axes, is seen to lead where there is no road."""
    near = ahead[(ahead[:, 0] > AHEAD_M[0]) & (np.hypot(ahead[:, 0], ahead[:, 1]) < AHEAD_M[1])]
    return len(near) > 0 and ground.off_road_share(strip(near, HALF_BODY_M)) > OFF_ROAD


def guess_mps(is_agreed: bool, road_m: float, config: NavigatorConfig) -> float:
    """How fast to go on a way that is a guess.

    Where all likely places have it, and only the ground fits badly, as in fog, it is driven as a search on sight drives: the
    vehicle can stop on what it sees to be road. Where only most of them have it, it is about to come to where they differ.

    Args:
        is_agreed: whether all likely places have it.
        road_m: of the way, from the rear axle on, that is seen to be road.
        config: of vehicle and driving.
    """
    in_sight = in_sight_mps(road_m - config.vehicle.front_m, config.drive)
    return max(min(in_sight, config.drive.search_mps), GUESSED_MPS) if is_agreed else GUESSED_MPS


def turn_mps(ground: Ground, ahead: FloatArray, side: float) -> float:
    """The speed from which the vehicle is slow enough to turn where the road may bend away; infinite where it does not.

    It may where something lies across the way, and where the border on the own side ends and it is not seen that the road goes on
    beyond. That may be a side street: by the time that the vehicle is near, it is seen.

    Args:
        ground: what was seen of it.
        ahead: poses (n, 3) of the way, in the vehicle's axes, evenly spaced.
        side: of the border: -1 right, 1 left.
    """
    if len(ahead) < 2:
        return math.inf
    along = np.hypot(ahead[:, 0], ahead[:, 1])
    kinds = ground.kinds_at(ahead[:, :2])
    barred = np.flatnonzero(np.cumsum(kinds == OTHER) >= LEAST_PLACES)
    room_m = math.inf if len(barred) == 0 else float(along[barred[0]]) - ACROSS_M
    end = _border_end(ground, ahead, side)
    if end is not None:
        beyond = (along > along[end] + BEYOND_M[0]) & (along < along[end] + BEYOND_M[1])
        goes_on = bool(beyond.any()) and float(np.mean(kinds[beyond] == ROAD)) > GOES_ON
        room_m = room_m if goes_on else min(room_m, float(along[end]) - CORNER_M)
    return math.sqrt(TURN_MPS**2 + 2.0 * BRAKING_MPS2 * max(room_m, 0.0)) if math.isfinite(room_m) else math.inf


def _border_end(ground: Ground, ahead: FloatArray, side: float) -> int | None:
    """The place of a way (n, 3) beside which the border on the own side has ended; None where none is seen to end."""
    aside = side * np.stack([-np.sin(ahead[:, 2]), np.cos(ahead[:, 2])], axis=1)
    points = ahead[:, None, :2] + BESIDE_M[None, :, None] * aside[:, None, :]
    kinds = ground.kinds_at(points.reshape(-1, 2)).reshape(len(ahead), -1)
    bordered = np.any(kinds >= OTHER, axis=1)
    seen_road = np.mean(kinds == ROAD, axis=1) > GOES_ON
    if not bordered[0]:
        return None
    for k in range(1, len(ahead) - GAP_PLACES + 1):
        if not bordered[k : k + GAP_PLACES].any():
            return k if seen_road[k : k + GAP_PLACES].any() else None
    return None
