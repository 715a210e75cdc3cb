"""Segments of the matched route, each with the log-odds that the vehicle drove there, and the votes of the loop closures.

In any network some route fits a part of any drive, and straight driving fits everywhere. What chance does not bring about is that
roads turn where the vehicle turned, in the same direction and by the same angle, one turn after the other. So each segment is
credited for the turning that it explains and debited for the costs of its steps. The sum is a log-odds score as it is used for
local alignments of sequences (T. F. Smith, M. S. Waterman, 1981); the score that chance reaches grows with the logarithm of the
length (S. Karlin, S. F. Altschul, 1990), and so does the score that ``confidence`` asks for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hippodrome.core.matching.search.route import Route
from hippodrome.core.matching.search.track import Track
from hippodrome.core.roads.network import BoolArray
from hippodrome.core.types import Edges, FloatArray

_HALF_CHORD = 3  # steps (15 m) either side of a sample over which turning is measured: the length of a turn at a crossing
_STRAIGHT_RAD = 0.15  # less turning over that chord may be a poor gyro's noise, a lane change or a kink of the lane
_TURN_RAD = 0.5 * np.pi  # turning over that chord counts up to a right angle: U-turns do not count more
_JUMP = 0.3  # a jump of the log scale by this much is either a rare restart of the odometry or a wrong turning of the route


@dataclass(frozen=True, slots=True)
class RouteSegment:
    """Samples ``first`` to ``end - 1`` of the track, driven on the network without a break."""

    first: int
    end: int
    log_odds_nats: float  # that the vehicle drove there, against chance


def route_segments(route: Route, explained: BoolArray, nats_per_rad: float) -> list[RouteSegment]:
    """Cut the route into segments, and sum up the log-odds of each.

    Args:
        route: the matched route over T samples.
        explained: (T,) samples at which the route explains the drive; segments are runs of these, cut where the scale jumps.
        nats_per_rad: credit for each radian that the road turns with the vehicle.
    """
    jumped = np.abs(np.diff(route.log_scale, prepend=route.log_scale[0])) > _JUMP
    begins = np.diff(explained.astype(np.int8), prepend=0) != 0
    cuts = np.flatnonzero(begins | (jumped & explained))
    ends = np.append(cuts[1:], len(explained))[: len(cuts)]  # a route that explains nothing has no cut and no end
    step_nats = route.score_nats * ~(begins | jumped)  # the step that leads into a segment does not count against it
    gain = step_nats + nats_per_rad * turning_rad(route.track)
    return [
        RouteSegment(int(first), int(end), float(np.sum(gain[first:end])))
        for first, end in zip(cuts, ends, strict=True)
        if explained[first]
    ]


def turning_rad(track: Track) -> FloatArray:
    """How much the vehicle turns at each sample (T,), in rad: the evidence for a route that turns likewise.

    The change of heading over a chord around the sample, up to a right angle and less what may be noise, is divided by the number
    of steps in the chord, so that the samples of a turn add up to the turn.
    """
    index = np.arange(len(track.heading_rad))
    behind, ahead = np.maximum(index - _HALF_CHORD, 0), np.minimum(index + _HALF_CHORD, len(index) - 1)
    turned = np.minimum(np.abs(track.heading_rad[ahead] - track.heading_rad[behind]), _TURN_RAD)
    per_sample: FloatArray = np.maximum(turned - _STRAIGHT_RAD, 0.0) / (2 * _HALF_CHORD)
    return per_sample


def significant_segments(
    segments: list[RouteSegment], least_nats: float, least_joined_nats: float, start_known: bool
) -> list[RouteSegment]:
    """The segments whose log-odds are too high to be due to chance.

    Once one segment is certain, dead reckoning ties the others to it, so that less evidence suffices for them.

    Args:
        segments: all segments of one route.
        least_nats: log-odds from which on a segment is certain by itself.
        least_joined_nats: log-odds that suffice for a segment once another one is certain.
        start_known: whether a start pose was given; the segment at the drive's beginning is certain then.
    """
    certain = [s for s in segments if s.log_odds_nats >= least_nats or (start_known and s.first == 0)]
    return [s for s in segments if s in certain or (certain and s.log_odds_nats >= least_joined_nats)]


def consistent_with_closures(
    segments: list[RouteSegment], route: Route, closures: Edges, distant_m: float, least_votes: int, least_share: float
) -> list[RouteSegment]:
    """The segments that the loop closures do not vote down.

    A closure votes for the two segments that it joins if the route puts both its ends within ``distant_m``, and against them
    otherwise. The segment with the smallest share of votes for it is dropped, together with the votes that concern it; this is
    repeated until all have ``least_share``.

    Args:
        segments: the segments of the route.
        route: the matched route.
        closures: loop closures between visits.
        distant_m: ends of a closure farther apart than this are different places.
        least_votes: a segment with fewer votes than these is kept.
        least_share: share of the votes that a segment needs.
    """
    sample = route.track.visit_samples()
    ends = np.stack([sample[closures.source], sample[closures.target]])
    agrees = np.hypot(*(route.points_m[ends[0]] - route.points_m[ends[1]]).T) < distant_m
    remaining = list(segments)
    while remaining:
        within = np.stack([(ends >= segment.first) & (ends < segment.end) for segment in remaining])  # (segments, 2, closures)
        joins_two = np.all(np.any(within, axis=0), axis=0)
        votes = [agrees[joins_two & np.any(own, axis=0)] for own in within]
        shares = [float(np.mean(vote)) if len(vote) >= least_votes else 1.0 for vote in votes]
        if min(shares) >= least_share:
            break
        del remaining[int(np.argmin(shares))]
    return remaining
