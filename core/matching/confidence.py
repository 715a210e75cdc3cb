"""How far a matched route can be trusted, stretch by stretch, and what is reported instead where it cannot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hippodrome.core.matching.route_search import Route, RouteAlternatives
from hippodrome.core.types import FloatArray, MatchBreak, MatchStatus, UInt8Array


@dataclass(frozen=True, slots=True)
class ConfidenceConfig:
    distant_m: float = 30.0  # an alternative farther than this is another place
    least_gap_nats: float = 8.0  # odds of 3,000 to 1 against the best distant alternative
    window: int = 24  # steps (120 m) over which the score is judged: single corners must not decide
    least_score_nats: float = -1.5  # mean per step, as far as driving off the network costs: a right route scores -0.1 to -0.4


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


def judge(route: Route, config: ConfidenceConfig) -> UInt8Array:
    """MatchStatus (T,) of each track sample."""
    gap = distant_gap(route.points_m, route.alternatives, config.distant_m)
    width = min(config.window, len(gap))
    kernel = np.ones(width)
    score = np.convolve(route.score_nats, kernel, "same") / np.convolve(np.ones(len(gap)), kernel, "same")
    off = (route.lane < 0) | (score < config.least_score_nats)
    status = np.where(
        off, MatchStatus.OFF_NETWORK, np.where(gap < config.least_gap_nats, MatchStatus.AMBIGUOUS, MatchStatus.MATCHED)
    )
    return status.astype(np.uint8)


CAUSES = {
    MatchStatus.AMBIGUOUS: "another route elsewhere explains the drive about as well; drive farther or give a start pose",
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
