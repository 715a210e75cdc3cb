"""Where a road map seems wrong, as a drive has shown it: roads drawn metres off, roads that are missing, wrong directions.

Only what the drive proves is said: an offset that is several standard deviations large on a stretch that roads vouch for, and
stretches without a road that begin or end on such a one. A drive that nothing vouches for says nothing of the map.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from typing import Any, Final, Literal, TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from hippodrome.core.roads.network import BoolArray, RoadNetwork
from hippodrome.core.se2 import wrap
from hippodrome.core.types import FloatArray, MatchBreak, MatchStatus, Refinement

Kind: TypeAlias = Literal["drawn off", "missing road", "wrong direction"]

SIGMAS_OF_MAP: Final = 2.0  # an offset larger than this many sigmas of the network's accuracy is news to a mapper
MOST_M: Final = 4.0  # and one larger than this is in any case: a house's width
LEAST_M: Final = 1.5  # a smaller one may be the driver's: people keep up to a metre off a drawn lane's middle
SURE_SIGMAS: Final = 3.0  # an offset is known if it is this many of its own sigmas: 1 of 400 such is chance
EDGE: Final = 0.6  # a stretch reaches from its worst place to where the offset has fallen to this share of what is told
SHORTEST_M: Final = 15.0  # of a stretch that is drawn off; a shorter one may be a corner that was cut
SHORTEST_MISSING_M: Final = 30.0  # of a missing road; a shorter one may be a yard
SAME_M: Final = 15.0  # a road that is driven again is told once: stretches whose middles lie nearer than this are one
AWAY_M: Final = 8.0  # farther than this from every lane there is no road
OPPOSITE_RAD: Final = 2.4  # a lane that is turned by more against the drive leads the other way
ALONG_RAD: Final = 0.7  # and one that is turned by less leads along with it
SAMPLE_M: Final = 2.0  # lanes are looked at in points so far apart
MOST_SHARE: Final = 0.7  # of the vertices of a stretch must lie so


@dataclass(frozen=True, slots=True)
class Finding:
    """One place where the map seems wrong."""

    kind: Kind
    first_vertex: int
    last_vertex: int  # inclusive
    points_m: tuple[tuple[float, float], ...]  # where the road is, in the network's frame: the refined places
    length_m: float
    offset_m: tuple[float, float] | None = None  # drawn place less true one, east and north, at its worst
    sigma_m: float | None = None  # standard deviation of that offset, across the road
    passes: int = 1  # how often it was driven

    def words(self) -> str:
        """The finding as a sentence."""
        if self.offset_m is not None:
            east, north = self.offset_m
            size = f"{np.hypot(east, north):.1f} m +- {self.sigma_m or 0.0:.1f}"
            again = f", driven {self.passes} times" if self.passes > 1 else ""
            return (
                f"over {self.length_m:.0f} m the road is drawn up to {size} {_compass(east, north)} of where it was driven{again}"
            )
        if self.kind == "wrong direction":
            return f"{self.length_m:.0f} m were driven against the only direction that the map allows: is it a one-way street?"
        return f"{self.length_m:.0f} m were driven where the map has no road: it is missing, or was a yard or a car park"


def find_wrong_roads(refinement: Refinement, roads: RoadNetwork, sigma_m: float) -> tuple[Finding, ...]:
    """Where the map seems wrong, in the order of the drive.

    Args:
        refinement: Of the drive, in mode ``route``.
        roads: The network that it was laid on.
        sigma_m: Accuracy of that network, standard deviation in each axis; where it is 0 no road is said to be drawn off.
    """
    match = refinement.cognitive_map.road_match
    if match is None or not (match.status == MatchStatus.MATCHED).any():
        return ()
    found = [*_drawn_off(refinement, match.status == MatchStatus.MATCHED, sigma_m), *_off_the_roads(refinement, roads)]
    return tuple(sorted(found, key=lambda one: one.first_vertex))


def usual_error_m(refinement: Refinement) -> tuple[float, float] | None:
    """How far roads are drawn from where they were driven, where they vouch for the drive: median and 95 %, metres.

    None if the roads were taken as exact, or none vouches for anything.
    """
    match = refinement.cognitive_map.road_match
    if refinement.map_error_m is None or match is None or not (vouched := match.status == MatchStatus.MATCHED).any():
        return None
    median, most = np.percentile(np.hypot(*refinement.map_error_m[vouched].T), [50.0, 95.0])
    return round(float(median), 2), round(float(most), 2)


def to_record(finding: Finding) -> dict[str, Any]:
    """A finding as plain data."""
    return asdict(finding)


def _drawn_off(refinement: Refinement, vouched: BoolArray, sigma_m: float) -> list[Finding]:
    """Stretches whose road is drawn to one side of where it was driven; one that is driven again is told once."""
    error_m, covariance = refinement.map_error_m, refinement.cognitive_map.covariance
    if error_m is None or covariance is None or sigma_m <= 0.0:
        return []
    poses = refinement.cognitive_map.poses
    across = np.column_stack([-np.sin(poses[:, 2]), np.cos(poses[:, 2])])
    side_m = np.einsum("vi,vi->v", across, error_m)
    own_sigma_m = np.sqrt(np.einsum("vi,vij,vj->v", across, covariance[:, :2, :2], across))
    least_m = float(np.clip(SIGMAS_OF_MAP * sigma_m, LEAST_M, MOST_M))
    told = vouched & (np.abs(side_m) > np.maximum(least_m, SURE_SIGMAS * own_sigma_m))
    around = vouched & (np.abs(side_m) > EDGE * least_m)
    found: list[Finding] = []
    for first, last in _runs(np.where(around, np.sign(side_m), 0.0)):
        length_m = _length_m(poses[first : last + 1])
        if length_m < SHORTEST_M or not told[first : last + 1].any():
            continue
        east, north = error_m[worst := first + int(np.argmax(np.abs(side_m[first : last + 1])))]
        one = Finding(
            "drawn off", first, last, _line(poses[first : last + 1]), length_m,
            (round(float(east), 2), round(float(north), 2)), round(float(own_sigma_m[worst]), 2),
        )  # fmt: skip
        _add(found, one)
    return found


def _add(found: list[Finding], one: Finding) -> None:
    """Add a finding, or another pass to the one that it repeats."""
    for i, known in enumerate(found):
        if np.hypot(*np.subtract(middle_m(known), middle_m(one))) < SAME_M:
            longer = max(known, one, key=lambda finding: finding.length_m)
            found[i] = replace(longer, passes=known.passes + 1)
            return
    found.append(one)


def _off_the_roads(refinement: Refinement, roads: RoadNetwork) -> Iterator[Finding]:
    """Stretches off the network, beside vouched ones, that have no lane near them or only such as lead the other way."""
    poses = refinement.cognitive_map.poses
    stretches = [one for one in refinement.breaks if _is_beside_vouched(one, refinement)]
    if not stretches:
        return
    every = np.concatenate([poses[one.first_vertex : one.last_vertex + 1, :2] for one in stretches])
    points, headings = _lane_points(roads, every.min(axis=0) - AWAY_M, every.max(axis=0) + AWAY_M)
    tree = cKDTree(points) if len(points) else None
    for one in stretches:
        own = slice(one.first_vertex, one.last_vertex + 1)
        near = tree.query_ball_point(poses[own, :2], AWAY_M) if tree is not None else [[]] * (own.stop - own.start)
        away = np.array([not len(points) for points in near])
        against = np.array([_leads_back(headings[lanes], pose[2]) for lanes, pose in zip(near, poses[own], strict=True)])
        if np.mean(away) >= MOST_SHARE:
            ends = np.flatnonzero(away)
            first, last = max(0, own.start + int(ends[0]) - 1), min(len(poses) - 1, own.start + int(ends[-1]) + 1)
            yield from _long_enough("missing road", first, last, poses)
        elif np.mean(against) >= MOST_SHARE:
            yield from _long_enough("wrong direction", own.start, own.stop - 1, poses)


def _leads_back(lane_headings_rad: FloatArray, heading_rad: float) -> bool:
    """Whether a lane leads against the drive, and none along with it; those of side streets do neither."""
    turned = np.abs(wrap(lane_headings_rad - heading_rad))
    return bool((turned > OPPOSITE_RAD).any()) and not bool((turned < ALONG_RAD).any())


def _long_enough(kind: Kind, first: int, last: int, poses: FloatArray) -> Iterator[Finding]:
    length_m = _length_m(poses[first : last + 1])
    if length_m >= SHORTEST_MISSING_M:
        yield Finding(kind, first, last, _line(poses[first : last + 1]), length_m)


def _is_beside_vouched(one: MatchBreak, refinement: Refinement) -> bool:
    match = refinement.cognitive_map.road_match
    assert match is not None  # the caller has looked
    before = one.first_vertex > 0 and match.status[one.first_vertex - 1] == MatchStatus.MATCHED
    after = one.last_vertex + 1 < len(match.status) and match.status[one.last_vertex + 1] == MatchStatus.MATCHED
    return one.status == MatchStatus.OFF_NETWORK and bool(before or after)


def _lane_points(roads: RoadNetwork, low_m: FloatArray, high_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (N, 2) every ``SAMPLE_M`` on the lanes that touch a box, and the lanes' headings (N,) there."""
    points, headings = [np.empty((0, 2))], [np.empty(0)]
    for lane in range(roads.lane_count):
        line = roads.lane_points_m(lane)
        if (line.max(axis=0) < low_m).any() or (line.min(axis=0) > high_m).any():
            continue
        for a, b in pairwise(line):
            count = max(2, int(np.hypot(*(b - a)) / SAMPLE_M) + 1)
            points.append(np.linspace(a, b, count))
            headings.append(np.full(count, np.arctan2(b[1] - a[1], b[0] - a[0])))
    return np.concatenate(points), np.concatenate(headings)


def _runs(sign: FloatArray) -> Iterator[tuple[int, int]]:
    """First and last index of each run of equal values other than 0."""
    ends = [0, *(np.flatnonzero(np.diff(sign)) + 1).tolist(), len(sign)]
    yield from ((first, end - 1) for first, end in pairwise(ends) if end > first and sign[first])


def middle_m(finding: Finding) -> tuple[float, float]:
    """The place in the middle of a finding."""
    return finding.points_m[len(finding.points_m) // 2]


def _line(poses: FloatArray) -> tuple[tuple[float, float], ...]:
    return tuple((round(float(x), 2), round(float(y), 2)) for x, y in poses[:, :2])


def _length_m(poses: FloatArray) -> float:
    return round(float(np.sum(np.hypot(*np.diff(poses[:, :2], axis=0).T))), 1)


def _compass(east_m: float, north_m: float) -> str:
    """One of eight directions."""
    names = ("east", "north-east", "north", "north-west", "west", "south-west", "south", "south-east")
    return names[round(np.arctan2(north_m, east_m) / (np.pi / 4)) % 8]
