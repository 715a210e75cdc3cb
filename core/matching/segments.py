"""Segments of the matched route, each with the evidence that the vehicle drove there, and the votes of the loop closures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import TypeAlias

import numpy as np

from hippodrome.core.matching.control import Control, evidence_nats, turned_rad
from hippodrome.core.matching.search.route import Route
from hippodrome.core.roads.network import BoolArray
from hippodrome.core.types import Edges

_JUMP = 0.3  # a jump of the log scale by this much is either a rare restart of the odometry or a wrong turning of the route
_CHOICE_NATS = 4.0  # a segment's ends, and which misfits lie outside of it, are all chosen after the fact
_SHORT_GAP = 8  # steps (40 m) off the network, over which dead reckoning errs by 10 m at most (``off_network``)
_MOST_CONTROLS = 6  # segments, those that turn most, for which a control is searched: it bounds the time for a wrong network


@dataclass(frozen=True, slots=True)
class RouteSegment:
    """Samples ``first`` to ``end - 1`` of the track, driven on the network without a break."""

    first: int
    end: int
    evidence_nats: float = 0.0  # that the vehicle drove there, against chance


Evidence: TypeAlias = Callable[[RouteSegment], float]  # the evidence for a segment, in nats


def route_segments(route: Route, explained: BoolArray) -> list[RouteSegment]:
    """Cut the route into segments, still without evidence.

    Args:
        route: the matched route over T samples.
        explained: (T,) samples at which the route explains the drive; segments are runs of these, cut where the scale jumps.
    """
    jumped = np.abs(np.diff(route.log_scale, prepend=route.log_scale[0])) > _JUMP
    begins = np.diff(explained.astype(np.int8), prepend=0) != 0
    cuts = np.flatnonzero(begins | (jumped & explained))
    ends = np.append(cuts[1:], len(explained))[: len(cuts)]  # a route that explains nothing has no cut and no end
    return [RouteSegment(int(first), int(end)) for first, end in zip(cuts, ends, strict=True) if explained[first]]


def with_evidence(segments: list[RouteSegment], route: Route, control: Control, enough_nats: float) -> list[RouteSegment]:
    """The segments with the evidence for each, which is cut off at ``enough_nats``."""
    evidence = evidence_of(segments, route, control, enough_nats)
    return [replace(segment, evidence_nats=evidence(segment)) for segment in segments]


def evidence_of(segments: list[RouteSegment], route: Route, control: Control, enough_nats: float) -> Evidence:
    """What tells the evidence for one of the segments, cut off at ``enough_nats``. It takes a search, so it is made when asked.

    A segment is the best part of a route, chosen after the fact from all of the drive. The more of the drive there was to choose
    from, the more evidence chance finds: ``_CHOICE_NATS`` times ln(length of the drive / length of the segment) is taken off.
    There is no evidence for segments that turn less than ``_MOST_CONTROLS`` others.
    """
    turned = np.array([turned_rad(route.track, segment.first, segment.end) for segment in segments])
    tried = [segments[i] for i in np.argsort(-turned, kind="stable")[:_MOST_CONTROLS].tolist()]

    @cache
    def evidence(segment: RouteSegment) -> float:
        return _chosen_evidence_nats(segment, route, control, enough_nats) if segment in tried else 0.0

    return evidence


def _chosen_evidence_nats(segment: RouteSegment, route: Route, control: Control, enough_nats: float) -> float:
    """The evidence for a segment, less what the choice of the segment accounts for."""
    choice_nats = _CHOICE_NATS * float(np.log(len(route.lane) / (segment.end - segment.first)))
    return evidence_nats(route, segment.first, segment.end, control, enough_nats + choice_nats) - choice_nats


def significant_segments(
    segments: list[RouteSegment], evidence: Evidence, least_samples: int, least_nats: float, least_joined_nats: float,
    start_known: bool,
) -> list[RouteSegment]:  # fmt: skip
    """The segments whose evidence is too high to be due to chance.

    Once one segment is certain, dead reckoning ties the others to it, so that less evidence suffices for them. Those that only a
    short gap parts from a kept one need none of their own: the vehicle cannot have gone elsewhere in between.

    Args:
        segments: all segments of one route, in driving order.
        evidence: tells the evidence for a segment; it is asked only where the answer decides.
        least_samples: a shorter segment is not certain by itself, whatever the evidence: chance fits a few corners anywhere.
        least_nats: evidence from which on a segment is certain by itself.
        least_joined_nats: evidence that suffices for a segment once another one is certain.
        start_known: whether a start pose was given; the segment at the drive's beginning is certain then.
    """
    longest_first = sorted(range(len(segments)), key=lambda i: segments[i].first - segments[i].end)
    kept = _joined_briefly([start_known and segment.first == 0 for segment in segments], segments)
    for i in longest_first:
        if not kept[i] and segments[i].end - segments[i].first >= least_samples and evidence(segments[i]) >= least_nats:
            kept[i] = True
            kept = _joined_briefly(kept, segments)
    for i in longest_first if any(kept) else ():
        if not kept[i] and evidence(segments[i]) >= least_joined_nats:
            kept[i] = True
            kept = _joined_briefly(kept, segments)
    return [segment for segment, keep in zip(segments, kept, strict=True) if keep]


def _joined_briefly(kept: list[bool], segments: list[RouteSegment]) -> list[bool]:
    """Which segments are kept together with those that are: their neighbours, as far as only short gaps part them."""
    joined = list(kept)
    for order in (range(1, len(segments)), range(len(segments) - 2, -1, -1)):
        for i in order:
            neighbour = i - 1 if order.step > 0 else i + 1
            joined[i] |= joined[neighbour] and _parted_briefly(segments[min(i, neighbour)], segments[max(i, neighbour)])
    return joined


def _parted_briefly(before: RouteSegment, after: RouteSegment) -> bool:
    """Whether the vehicle was off the network between two segments, but not for long. A jump in scale parts them for good."""
    return 0 < after.first - before.end <= _SHORT_GAP


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
