"""How much a stretch of the matched route says for itself: what chance, and what the loop closures, leave of it.

In any network some route fits a part of any drive, and straight driving fits everywhere. What chance does not bring about is that
roads turn where, whither and as far as the vehicle did, stretch after stretch. So each stretch is credited for the turning it
explains and debited for what its steps cost, as local alignments of sequences are scored.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hippodrome.core.matching.route_line import BoolArray
from hippodrome.core.matching.search.route import Route
from hippodrome.core.matching.search.track import Track
from hippodrome.core.types import Edges, FloatArray

_HALF_CHORD = 3  # steps (15 m) either side over which turning is taken: the length of a turn at a crossing
_STRAIGHT_RAD = 0.15  # less turning over that chord may be a poor gyro's noise, a lane change or a kink
_TURN_RAD = 0.5 * np.pi  # a turn is a turn: U-turns do not count more
_JUMP = 0.3  # of log scale: a jump this large is either a rare restart of the odometry or a wrong turning


@dataclass(frozen=True, slots=True)
class Stretch:
    """Samples ``first`` to ``end - 1`` of the track, driven on the network without a break."""

    first: int
    end: int
    evidence_nats: float


def stretches(route: Route, explained: BoolArray, nats_per_rad: float) -> list[Stretch]:
    """The runs of ``explained`` (T,) samples, cut where the scale jumps, and what each says for itself."""
    jumped = np.abs(np.diff(route.log_scale, prepend=route.log_scale[0])) > _JUMP
    begins = np.diff(explained.astype(np.int8), prepend=0) != 0
    cuts = np.flatnonzero(begins | (jumped & explained))
    ends = np.append(cuts[1:], len(explained))
    gain = route.score_nats * ~(begins | jumped) + nats_per_rad * turning(route.track)  # coming here is not the stretch's fault
    return [
        Stretch(int(first), int(end), float(np.sum(gain[first:end])))
        for first, end in zip(cuts, ends, strict=True)
        if explained[first]
    ]


def turning(track: Track) -> FloatArray:
    """Radians (T,) turned at each sample, noise cut off."""
    index = np.arange(len(track.heading_rad))
    behind, ahead = np.maximum(index - _HALF_CHORD, 0), np.minimum(index + _HALF_CHORD, len(index) - 1)
    turned = np.minimum(np.abs(track.heading_rad[ahead] - track.heading_rad[behind]), _TURN_RAD)
    per_sample: FloatArray = np.maximum(turned - _STRAIGHT_RAD, 0.0) / (2 * _HALF_CHORD)
    return per_sample


def credible(found: list[Stretch], least_nats: float, least_joined_nats: float, start_known: bool) -> list[Stretch]:
    """The stretches that say enough for themselves.

    One must say ``least_nats``, so that chance is ruled out for this drive in this network; a known start does that too. The
    others hang on it by dead reckoning, so that ``least_joined_nats`` will do for them.
    """
    sure = [s for s in found if s.evidence_nats >= least_nats or (start_known and s.first == 0)]
    return [s for s in found if s in sure or (sure and s.evidence_nats >= least_joined_nats)]


def not_denied(
    found: list[Stretch], route: Route, closures: Edges, distant_m: float, least_votes: int, least_share: float
) -> list[Stretch]:
    """The stretches that the loop closures (between visits) leave.

    A closure votes for the two stretches it joins if the route puts both its ends within ``distant_m``, else against them. The
    stretch with the smallest share of votes goes first, and takes its votes with it, until all have ``least_share``.
    """
    sample = route.track.visit_samples()
    ends = np.stack([sample[closures.source], sample[closures.target]])
    agrees = np.hypot(*(route.points_m[ends[0]] - route.points_m[ends[1]]).T) < distant_m
    left = list(found)
    while left:
        within = np.stack([(ends >= stretch.first) & (ends < stretch.end) for stretch in left])  # (stretches, 2, closures)
        cast = np.all(np.any(within, axis=0), axis=0)
        votes = [agrees[cast & np.any(mine, axis=0)] for mine in within]
        shares = [float(np.mean(of)) if len(of) >= least_votes else 1.0 for of in votes]
        if min(shares) >= least_share:
            break
        del left[int(np.argmin(shares))]
    return left
