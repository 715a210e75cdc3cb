"""Trajectory errors as pure functions (estimate, reference) -> ``Score``, equal to evo's on the same poses.

Every score carries its definition; scores with different definitions cannot be pooled.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hippodrome.core import se2
from hippodrome.core.types import FloatArray, HippodromeError, IntArray, Trajectory
from hippodrome.eval.metrics.alignment import (
    LABELS,
    AlignmentName,
    apply_to_positions,
    find_alignment,
)
from hippodrome.eval.metrics.association import (
    MAX_GAP_S,
    MIN_COVERAGE,
    Association,
    associate,
    associate_at_reference,
)

Pairing: TypeAlias = Literal["all", "chained"]
Instants: TypeAlias = Literal["estimate", "reference"]
Indices: TypeAlias = NDArray[np.intp]

PATH_TOLERANCE = 0.1  # evo's default: a pair counts if the path between its samples is within 10 % of the delta


class MetricError(HippodromeError):
    """A score that cannot be computed from these trajectories, or scores that cannot be pooled."""


@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """Errors of one metric over one estimate, or over several pooled ones."""

    definition: str  # metric, alignment, delta, unit and pairing in words
    errors_m: FloatArray  # (N,) one per sample (APE) or per pair of samples (RPE)
    t_s: FloatArray  # (N,) time of the sample, or of the second one of the pair
    matched: int  # estimated samples with ground truth
    total: int  # estimated samples

    @property
    def count(self) -> int:
        return len(self.errors_m)

    @property
    def mean_m(self) -> float:
        return float(self.errors_m.mean())

    @property
    def median_m(self) -> float:
        return float(np.median(self.errors_m))

    @property
    def p95_m(self) -> float:
        return float(np.percentile(self.errors_m, 95.0))

    @property
    def max_m(self) -> float:
        return float(self.errors_m.max())

    @property
    def rmse_m(self) -> float:
        return float(np.sqrt(np.mean(self.errors_m**2)))


def ape(
    estimate: Trajectory,
    reference: Trajectory,
    alignment: AlignmentName = "none",
    *,
    max_gap_s: float = MAX_GAP_S,
    min_coverage: float = MIN_COVERAGE,
    at: Instants = "estimate",
) -> Score:
    """Absolute position error: the distance of each estimated position to the reference at the same instant.

    Args:
        estimate: The trajectory to score.
        reference: Ground truth.
        alignment: How the estimate is moved before distances are taken, see ``find_alignment``.
        max_gap_s: Reference samples farther apart than this are not interpolated.
        min_coverage: Least share of the estimated samples that must have ground truth.
        at: At whose time stamps the two are compared: the estimate's, or, where the truth is the sparser one, the reference's.

    Raises:
        HippodromeError: One of the two is no trajectory, too few samples have ground truth, or the alignment is degenerate.
    """
    pairs = _ASSOCIATE[at](estimate, reference, max_gap_s=max_gap_s, min_coverage=min_coverage)
    transform = find_alignment(alignment, pairs.estimate, pairs.reference)
    moved = apply_to_positions(transform, pairs.estimate[:, :2])
    offsets = moved[:, :2] - pairs.reference[:, :2]
    errors_m = np.hypot(offsets[:, 0], offsets[:, 1])
    per = "estimated sample" if at == "estimate" else "true sample"
    definition = f"APE, position, m; per {per}; alignment {LABELS[alignment]}; {_reference_clause(max_gap_s, at)}"
    return Score(definition, errors_m, pairs.t_s, len(pairs.t_s), pairs.total)


def rpe(
    estimate: Trajectory,
    reference: Trajectory,
    delta_m: float | None = None,
    *,
    pairing: Pairing = "all",
    max_gap_s: float = MAX_GAP_S,
    min_coverage: float = MIN_COVERAGE,
    at: Instants = "estimate",
) -> Score:
    """Relative pose error, translation: the motion between two samples, estimated against true.

    Each motion is expressed in the frame of its first sample. There is no alignment, as the error does not depend on a rigid one,
    and no correction of scale.

    Args:
        estimate: The trajectory to score.
        reference: Ground truth.
        delta_m: How far apart along the reference path the samples of a pair are; None pairs consecutive samples.
        pairing: With a delta, whether a pair begins at every sample (``all``), or where the one before ended (``chained``).
        max_gap_s: Reference samples farther apart than this are not interpolated, and no pair spans such a gap.
        min_coverage: Least share of the estimated samples that must have ground truth.
        at: At whose time stamps the two are compared: the estimate's, or, where the truth is the sparser one, the reference's.

    Raises:
        HippodromeError: One of the two is no trajectory, too few samples have ground truth, or there is no pair.
    """
    matched = _ASSOCIATE[at](estimate, reference, max_gap_s=max_gap_s, min_coverage=min_coverage)
    first, second, clause = _pairs(matched, delta_m, pairing)
    if len(first) == 0:
        raise MetricError(
            f"RPE, {clause}: no such pair among {len(matched.t_s)} samples; use a smaller delta or consecutive samples"
        )
    estimated = se2.between(matched.estimate[first], matched.estimate[second])
    true = se2.between(matched.reference[first], matched.reference[second])
    offsets = estimated[:, :2] - true[:, :2]
    definition = f"RPE, translation, m; {clause}; no alignment, no scale correction; {_reference_clause(max_gap_s, at)}"
    return Score(definition, np.hypot(offsets[:, 0], offsets[:, 1]), matched.t_s[second], len(matched.t_s), matched.total)


def pool(scores: Sequence[Score]) -> Score:
    """One score over the samples of several runs: a mean of means would weigh runs wrongly, and a mean of RMSEs is no RMSE.

    Raises:
        MetricError: There are no scores, or their definitions differ.
    """
    if not scores:
        raise MetricError("no scores to pool")
    for other in scores[1:]:
        _require_same_definition(scores[0], other)
    return Score(
        definition=scores[0].definition,
        errors_m=np.concatenate([score.errors_m for score in scores]),
        t_s=np.concatenate([score.t_s for score in scores]),
        matched=sum(score.matched for score in scores),
        total=sum(score.total for score in scores),
    )


def path_length_m(poses: FloatArray) -> FloatArray:
    """Distance travelled (N,) up to each of the poses (N, 2 or more columns), along the chords between them."""
    steps = np.diff(poses[:, :2], axis=0)
    return np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])


def _require_same_definition(a: Score, b: Score) -> None:
    """Raise MetricError unless the two scores measure the same thing."""
    if a.definition != b.definition:
        raise MetricError(f"scores of different definitions cannot be compared: '{a.definition}' and '{b.definition}'")


def _pairs(matched: Association, delta_m: float | None, pairing: Pairing) -> tuple[Indices, Indices, str]:
    """Numbers of the first and second samples of all pairs, and in words how the pairs were found."""
    if delta_m is None:
        first = np.flatnonzero((np.diff(matched.segment) == 0) & (np.diff(matched.index) == 1))
        return first, first + 1, "delta 1 sample; consecutive samples"
    along_m = path_length_m(matched.reference)
    find = _all_pairs if pairing == "all" else _chained_pairs
    found = [find(along_m[start:stop], delta_m) + start for start, stop in _runs(matched.segment)]
    pairs = np.concatenate(found)
    how = f"all pairs within {PATH_TOLERANCE:.0%}" if pairing == "all" else "chained pairs, first sample at or beyond"
    return pairs[:, 0], pairs[:, 1], f"delta {delta_m:g} m of reference path; {how}"


def _all_pairs(along_m: FloatArray, delta_m: float) -> Indices:
    """Pairs (K, 2) from every sample to the one nearest to ``delta_m`` ahead, or to the earlier of two equally near ones.

    ``along_m`` (N,) is the distance travelled up to each sample. Pairs that miss the delta by more than 10 % are left out.
    """
    first = np.arange(len(along_m) - 1)
    goal_m = along_m[first] + delta_m
    above = np.clip(np.searchsorted(along_m, goal_m, side="left"), first + 1, len(along_m) - 1)
    below = np.maximum(above - 1, first + 1)
    nearer_below = np.abs(along_m[below] - along_m[first] - delta_m) <= np.abs(along_m[above] - along_m[first] - delta_m)
    second = np.searchsorted(along_m, along_m[np.where(nearer_below, below, above)], side="left")
    second = np.maximum(second, first + 1)  # of several samples at one place, during a stop, the first one, as evo's argmin does
    close = np.abs(along_m[second] - along_m[first] - delta_m) <= PATH_TOLERANCE * delta_m
    return np.column_stack([first[close], second[close]])


def _chained_pairs(along_m: FloatArray, delta_m: float) -> Indices:
    """Pairs (K, 2) end to end: each ends at the first sample at least ``delta_m`` farther on, where the next one begins."""
    ends = [0]
    while (following := int(np.searchsorted(along_m, along_m[ends[-1]] + delta_m, side="left"))) < len(along_m):
        ends.append(following)
    return np.column_stack([ends[:-1], ends[1:]]).astype(np.intp)


def _runs(segment: IntArray) -> list[tuple[int, int]]:
    """Start and stop of each run of equal values."""
    cuts = np.flatnonzero(np.diff(segment)) + 1
    bounds = [0, *cuts.tolist(), len(segment)]
    return list(pairwise(bounds))


_ASSOCIATE: Final = {"estimate": associate, "reference": associate_at_reference}


def _reference_clause(max_gap_s: float, at: Instants) -> str:
    if at == "reference":
        return f"at the truth's times, estimate linear in time within gaps <= {max_gap_s:g} s"
    return f"reference linear in time within gaps <= {max_gap_s:g} s"
