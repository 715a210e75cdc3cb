"""When a route that was found is trusted."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ConfidenceConfig:
    """When a sample of the route counts as matched."""

    distant_m: float = 30.0  # an alternative route farther away than this is at another place
    least_gap_nats: float = 8.0  # lead of the route over the best alternative at another place: odds of 3,000 to 1
    steady_scale: float = 0.125  # the log scale of a drive holds if it stays within this, three scale bins of the search
    steady_scale_nats: float = 7.0  # what a jump costs more on such a drive: 9 of 10 odometers never jump, and it had 2 km for it
    window: int = 24  # steps (120 m) over which the score is averaged: single corners must not decide
    least_score_nats: float = -1.5  # least mean score of a step, as low as off the network; a right route has -0.1 to -0.4
    least_evidence_nats: float = 8.0  # least evidence of a segment against decoys, which tell what chance achieves
    certain_samples: int = 100  # samples (500 m), or 4/5 of a shorter drive, that a segment needs to be certain by itself
    least_joined_nats: float = 3.0  # the same of a segment that dead reckoning joins to a certain one
    least_votes: int = 6  # loop closures that concern a segment, from which on they may vote it down
    least_agreeing: float = 0.34  # share of them that must agree with it: 5 of 6 are false once in 600 times if 20 % are
    most_sigma_m: float = 3.0  # a vertex whose place is less certain is ambiguous: it may be 10 m off
    most_moved_m: float = 12.0  # a vertex that the refinement moves farther is ambiguous; a right search errs by up to 7 m
    far_m: float = 10.0  # a vertex farther off than this is wrong
    most_far: float = 0.2  # probability of that, by the search's alternatives, from which on a vertex is ambiguous
