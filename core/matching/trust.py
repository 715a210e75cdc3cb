"""How far a matched route can be trusted, stretch by stretch, and what is reported instead where it cannot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hippodrome.core.matching.evidence import credible, not_denied, stretches
from hippodrome.core.matching.search.route import Route, RouteAlternatives
from hippodrome.core.types import Edges, FloatArray, MatchBreak, MatchStatus, UInt8Array


@dataclass(frozen=True, slots=True)
class ConfidenceConfig:
    distant_m: float = 30.0  # an alternative farther than this is another place
    least_gap_nats: float = 8.0  # odds of 3,000 to 1 against the best distant alternative
    window: int = 24  # steps (120 m) over which the score is judged: single corners must not decide
    least_score_nats: float = -1.5  # mean per step, as far as driving off the network costs: a right route scores -0.1 to -0.4
    turning_nats: float = 6.0  # credit per rad turned as the road turns; a right angle is at about every 20th step, one way of 3
    least_evidence_nats: float = 10.0  # of one stretch, if the drive has 100 steps (500 m): chance has up to 7, a right one 6-21
    evidence_growth_nats: float = 6.0  # and this times ln(length) more; 3.5 km: chance has up to 15, a right drive 40-300
    least_joined_nats: float = 6.0  # of a stretch that hangs on such a one by dead reckoning
    least_votes: int = 6  # loop closures, from which on they may deny a stretch
    least_agreeing: float = 0.34  # share of them that must agree: with 20 % of false ones, 5 of 6 are false once in 600 times
    most_moved_m: float = 12.0  # by the refinement; a right search errs by up to 7 m


def distant_gap(points_m: FloatArray, alternatives: RouteAlternatives, distant_m: float) -> FloatArray:
    """By how many nats (T,) the best complete route beats the best one that is ``distant_m`` elsewhere at that moment.

    Evidence from before and after counts: the gap is between complete routes, not between their ends. Where no alternative was
    within the search's margin, the gap is that margin at least, and reported as inf.
    """
    rows = np.diff(alternatives.row_start)
    away = alternatives.points_m - np.repeat(points_m, rows, axis=0).astype(np.float32)
    distant = np.where(np.sum(away**2, axis=1) > distant_m**2, alternatives.through_nats, -np.inf)
    best = np.max(alternatives.through_nats[alternatives.row_start[-2] :])
    rival = np.maximum.reduceat(distant, alternatives.row_start[:-1])
    gap: FloatArray = np.where(rival > -1e29, best - rival, np.inf)
    return gap


def judge(route: Route, config: ConfidenceConfig, closures: Edges | None = None, start_known: bool = False) -> UInt8Array:
    """MatchStatus (T,) of each track sample. ``closures`` join visits; ``start_known``: a start pose was given."""
    gap = distant_gap(route.points_m, route.alternatives, config.distant_m)
    width = min(config.window, len(gap))
    kernel = np.ones(width)
    score = np.convolve(route.score_nats, kernel, "same") / np.convolve(np.ones(len(gap)), kernel, "same")
    explained = (route.lane >= 0) & (score >= config.least_score_nats)
    status = np.where(gap < config.least_gap_nats, MatchStatus.AMBIGUOUS, MatchStatus.MATCHED)
    status[~explained] = MatchStatus.OFF_NETWORK
    found = stretches(route, explained, config.turning_nats)
    least = config.least_evidence_nats + config.evidence_growth_nats * float(np.log(max(len(gap) / 100.0, 1.0)))
    kept = credible(found, least, config.least_joined_nats, start_known)
    if closures is not None:
        kept = not_denied(kept, route, closures, config.distant_m, config.least_votes, config.least_agreeing)
    for stretch in found:
        if stretch not in kept:  # beside others that are sure, it is no road of the network; alone, it may be anywhere
            status[stretch.first : stretch.end] = MatchStatus.OFF_NETWORK if kept else MatchStatus.AMBIGUOUS
    return status.astype(np.uint8)


def settled(status: UInt8Array, route: Route, poses: FloatArray, config: ConfidenceConfig) -> UInt8Array:
    """Status (S,) of the visits with refined poses (S, 3): where search and refinement disagree, neither is believed."""
    track = route.track
    found = np.column_stack([np.interp(track.visit_arc, track.arc, route.points_m[:, axis]) for axis in (0, 1)])
    astray = np.hypot(*(poses[:, :2] - found).T) > config.most_moved_m
    return np.where(astray & (status == MatchStatus.MATCHED), MatchStatus.AMBIGUOUS, status).astype(np.uint8)


CAUSES = {
    MatchStatus.AMBIGUOUS: "another route, or chance, explains the drive about as well; drive farther or give a start pose",
    MatchStatus.OFF_NETWORK: "no road of the network explains the drive here",
    MatchStatus.NO_ROUTE: "no route leads from the last matched place to the next",
}


def breaks(status: UInt8Array) -> tuple[MatchBreak, ...]:
    """Runs of unmatched vertices, from the status (V,) of each."""
    edges = np.flatnonzero(np.diff(status.astype(np.int16))) + 1
    starts, ends = np.concatenate([[0], edges]), np.concatenate([edges, [len(status)]])
    return tuple(
        MatchBreak(int(first), int(end) - 1, MatchStatus(int(status[first])), CAUSES[MatchStatus(int(status[first]))])
        for first, end in zip(starts, ends, strict=True)
        if status[first] != MatchStatus.MATCHED
    )
