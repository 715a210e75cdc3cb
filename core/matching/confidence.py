"""How far a matched route can be trusted, segment by segment, and what is reported where it cannot."""

from __future__ import annotations

import numpy as np

from hippodrome.core.matching.config import ConfidenceConfig
from hippodrome.core.matching.control import Control
from hippodrome.core.matching.search.route import Route
from hippodrome.core.matching.segments import (
    consistent_with_closures,
    evidence_of,
    route_segments,
    significant_segments,
)
from hippodrome.core.roads.network import BoolArray
from hippodrome.core.types import Edges, Float32Array, FloatArray, MatchBreak, MatchStatus, UInt8Array


def distant_gap(route: Route, config: ConfidenceConfig) -> FloatArray:
    """Lead in nats (T,), at each sample, of the best complete route over the best one that is at another place there.

    The gap is between complete routes, so that evidence from before and after the sample counts. If the search kept no
    alternative at another place, the lead is at least the search's margin and is returned as inf.
    """
    found = route.alternatives
    rows = np.diff(found.row_start)
    away = found.points_m - np.repeat(route.points_m, rows, axis=0).astype(np.float32)
    distant = np.where(np.sum(away**2, axis=1) > config.distant_m**2, steady_nats(route, config), -np.inf)
    best = np.max(found.through_nats[found.row_start[-2] :])  # the best route passes through every sample
    rival = np.maximum.reduceat(distant, found.row_start[:-1])
    gap: FloatArray = np.where(rival > -1e29, best - rival, np.inf)
    return gap


def steady_nats(route: Route, config: ConfidenceConfig) -> FloatArray | Float32Array:
    """Score (rows,) of the best complete route through each alternative, where it is known whether this odometer jumps in scale.

    Most odometers never do. The search cannot know beforehand whether this one does; once its scale has held over the whole
    drive, a route that needs a jump where the best one needs none is less likely by ``steady_scale_nats``.
    """
    found, nats = route.alternatives, route.alternatives.through_nats
    if np.ptp(route.log_scale) > config.steady_scale:
        return nats
    jumped = np.abs(found.log_scale - np.repeat(route.log_scale, np.diff(found.row_start))) > config.steady_scale
    steady: FloatArray = nats - config.steady_scale_nats * jumped
    return steady


def match_status(
    route: Route, control: Control, config: ConfidenceConfig, closures: Edges | None = None, start_known: bool = False
) -> UInt8Array:
    """MatchStatus (T,) of each sample of the track.

    Args:
        route: the matched route over T samples.
        control: what chance achieves for parts of the same drive in the same network.
        config: the thresholds.
        closures: loop closures between visits, which vote on the segments of the route.
        start_known: whether a start pose was given.
    """
    gap = distant_gap(route, config)
    explained = explained_samples(route, config)
    status = np.where(gap < config.least_gap_nats, MatchStatus.AMBIGUOUS, MatchStatus.MATCHED)
    status[~explained] = MatchStatus.OFF_NETWORK
    segments = route_segments(route, explained)
    evidence = evidence_of(segments, route, control, config.least_evidence_nats + 1.0)
    least_samples = min(config.certain_samples, 4 * len(gap) // 5)
    kept = significant_segments(
        segments, evidence, least_samples, config.least_evidence_nats, config.least_joined_nats, start_known
    )
    if closures is not None:
        kept = consistent_with_closures(kept, route, closures, config.distant_m, config.least_votes, config.least_agreeing)
    for segment in segments:
        if segment not in kept:  # beside segments that are certain, it is no road of the network; alone, it may be anywhere
            status[segment.first : segment.end] = MatchStatus.OFF_NETWORK if kept else MatchStatus.AMBIGUOUS
    return status.astype(np.uint8)


def explained_samples(route: Route, config: ConfidenceConfig) -> BoolArray:
    """Mask (T,) of the samples at which the route explains the drive: it is on the network, and its steps score well enough.

    Scores are averaged over a window around the sample, which is shorter at the ends of the drive, so that no single corner
    decides.
    """
    width = min(config.window, len(route.score_nats))
    kernel = np.ones(width)
    score = np.convolve(route.score_nats, kernel, "same") / np.convolve(np.ones(len(route.score_nats)), kernel, "same")
    explained: BoolArray = (route.lane >= 0) & (score >= config.least_score_nats)
    return explained


def reject_displaced(status: UInt8Array, route: Route, points_m: FloatArray, config: ConfidenceConfig) -> UInt8Array:
    """Status (S,) of the visits, where matched visits that the refinement has moved too far are made ambiguous.

    Search and refinement then disagree about the place, and neither is believed.

    Args:
        status: (S,) MatchStatus of each visit by the search.
        route: the route that the search found.
        points_m: (S, 2) refined places of the visits on the map as it is drawn.
        config: how far a visit may be moved.
    """
    track = route.track
    found = np.column_stack([np.interp(track.visit_arc, track.arc, route.points_m[:, axis]) for axis in (0, 1)])
    displaced = np.hypot(*(points_m - found).T) > config.most_moved_m
    return np.where(displaced & (status == MatchStatus.MATCHED), MatchStatus.AMBIGUOUS, status).astype(np.uint8)


def reject_uncertain(status: UInt8Array, covariance: FloatArray, config: ConfidenceConfig) -> UInt8Array:
    """Status (S,) of the visits, where matched visits whose place is too uncertain are made ambiguous.

    The road may be known there, but not how far along it the vehicle was: before the first corner or after the last one.

    Args:
        status: (S,) MatchStatus of each visit.
        covariance: (S, 2, 2) of their places, in square metres.
        config: how uncertain a place may be.
    """
    uncertain = np.linalg.eigvalsh(covariance)[:, -1] > config.most_sigma_m**2
    return np.where(uncertain & (status == MatchStatus.MATCHED), MatchStatus.AMBIGUOUS, status).astype(np.uint8)


def reject_doubtful(status: UInt8Array, route: Route, points_m: FloatArray, config: ConfidenceConfig) -> UInt8Array:
    """Status (S,) of the visits, where matched visits that the search may well have put elsewhere are made ambiguous.

    A covariance is that of a scale that changes little by little. One that jumps where nothing tells how far along the road the
    vehicle is, on a long straight or before the first corner, errs by more. The search knows of jumps: its alternatives pass
    there at other places, and the share of those farther than ``far_m`` from the refined place is the probability that it is
    wrong.

    Args:
        status: (S,) MatchStatus of each visit.
        route: the route that the search found, with its alternatives.
        points_m: (S, 2) refined places of the visits on the map as it is drawn.
        config: how far off a place is wrong, and how probable that may be.
    """
    track = route.track
    refined = np.column_stack([np.interp(track.arc, track.visit_arc, points_m[:, axis]) for axis in (0, 1)])
    doubtful = far_probability(route, refined, config)[track.visit_samples()] > config.most_far
    return np.where(doubtful & (status == MatchStatus.MATCHED), MatchStatus.AMBIGUOUS, status).astype(np.uint8)


def far_probability(route: Route, points_m: FloatArray, config: ConfidenceConfig) -> FloatArray:
    """Probability (T,), at each sample, that the vehicle was farther than ``far_m`` from ``points_m`` (T, 2), by the search.

    Each alternative stands for one cell of a lane and counts by the likelihood of the best complete route through it.
    """
    found = route.alternatives
    likelihood = np.exp(steady_nats(route, config).astype(np.float64))
    away = found.points_m - np.repeat(points_m, np.diff(found.row_start), axis=0)
    far = likelihood * (np.sum(away**2, axis=1) > config.far_m**2)
    probability: FloatArray = np.add.reduceat(far, found.row_start[:-1]) / np.add.reduceat(likelihood, found.row_start[:-1])
    return probability


CAUSES = {
    MatchStatus.AMBIGUOUS: (
        "another route, or another place along this one, or chance, explains the drive about as well; "
        "drive farther, round corners, or give a start pose"
    ),
    MatchStatus.OFF_NETWORK: "no road of the network explains the drive here",
    MatchStatus.NO_ROUTE: "no route leads from the last matched place to the next",
}


def match_breaks(status: UInt8Array) -> tuple[MatchBreak, ...]:
    """One break for each run of unmatched vertices with the same status, from the MatchStatus (V,) of each vertex."""
    edges = np.flatnonzero(np.diff(status.astype(np.int16))) + 1
    starts, ends = np.concatenate([[0], edges]), np.concatenate([edges, [len(status)]])
    return tuple(
        MatchBreak(int(first), int(end) - 1, MatchStatus(int(status[first])), CAUSES[MatchStatus(int(status[first]))])
        for first, end in zip(starts, ends, strict=True)
        if status[first] != MatchStatus.MATCHED
    )
