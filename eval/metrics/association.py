"""Which estimated samples have ground truth at their time stamps: never across a gap, and never for too small a share of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hippodrome.core import se2
from hippodrome.core.types import FloatArray, HippodromeError, IntArray, Trajectory

# Reference samples farther apart than this are not interpolated. Ground truth comes at the camera's rate, 5 to 12 Hz; at 15 m/s a
# chord over 0.25 s leaves a curve by less than 0.1 m.
MAX_GAP_S = 0.25
MAX_COORDINATE = 1e12  # of a pose, in metres or radians: nothing on Earth is farther, and the squares of more overflow
MIN_COVERAGE = 0.95  # least share of the estimated samples that must have ground truth for a score to be one of the whole drive


class CoverageError(HippodromeError):
    """Too few estimated samples have ground truth."""


class TrajectoryError(HippodromeError):
    """A trajectory that is not one: wrong shape, not finite, or out of order."""


@dataclass(frozen=True, slots=True, eq=False)
class Association:
    """The N samples of an estimate that have ground truth, in time order, with the reference at the same instants."""

    t_s: FloatArray  # (N,)
    estimate: FloatArray  # (N, 3) poses
    reference: FloatArray  # (N, 3) poses, interpolated
    index: IntArray  # (N,) number of each sample in the estimate
    segment: IntArray  # (N,) number of the stretch of the reference without gaps that it lies in; pairs stay within one stretch
    total: int  # samples of the estimate, with ground truth or without


def associate(
    estimate: Trajectory, reference: Trajectory, *, max_gap_s: float = MAX_GAP_S, min_coverage: float = MIN_COVERAGE
) -> Association:
    """Reference poses at the estimate's time stamps, interpolated linearly in position and along the shorter arc in heading.

    Args:
        estimate: The trajectory whose times count.
        reference: Ground truth.
        max_gap_s: Reference samples farther apart than this are not interpolated.
        min_coverage: Least share of the estimated samples that must have ground truth.

    Raises:
        TrajectoryError: One of the two is no trajectory.
        CoverageError: Too few of the estimated samples have ground truth.
    """
    check_trajectory(estimate, "estimate")
    check_trajectory(reference, "reference")
    after = np.clip(np.searchsorted(reference.t_s, estimate.t_s, side="left"), 1, max(len(reference.t_s) - 1, 1))
    matched = _covered(estimate.t_s, reference.t_s, after, max_gap_s)
    _require_coverage(int(matched.sum()), len(matched), min_coverage, max_gap_s)
    index = np.flatnonzero(matched).astype(np.int32)
    segment = np.concatenate([[0], np.cumsum(np.diff(reference.t_s) > max_gap_s)])
    nearest = np.searchsorted(reference.t_s, estimate.t_s[index], side="right") - 1
    return Association(
        t_s=estimate.t_s[index],
        estimate=estimate.poses[index],
        reference=se2.interpolate(reference.t_s, reference.poses, estimate.t_s[index]),
        index=index,
        segment=segment[nearest].astype(np.int32),
        total=len(estimate.t_s),
    )


def associate_at_reference(
    estimate: Trajectory, reference: Trajectory, *, max_gap_s: float, min_coverage: float = MIN_COVERAGE
) -> Association:
    """Estimated poses at the reference's time stamps, for a reference that is the sparser of the two.

    Only samples of the reference between the estimate's first and last time count. ``index`` numbers these, ``total`` says how
    many they are, and the stretches of ``segment`` are those of the estimate. Arguments and errors as of ``associate``, except
    that it is the estimate's samples that may be ``max_gap_s`` apart.
    """
    check_trajectory(estimate, "estimate")
    check_trajectory(reference, "reference")
    inside = (reference.t_s >= estimate.t_s[0]) & (reference.t_s <= estimate.t_s[-1])
    if not inside.any():
        raise CoverageError(
            f"none of the {len(reference.t_s)} true samples ({reference.t_s[0]:.1f} to {reference.t_s[-1]:.1f} s) lies in the "
            f"estimate's time ({estimate.t_s[0]:.1f} to {estimate.t_s[-1]:.1f} s); check clocks and time spans"
        )
    swapped = associate(
        Trajectory(reference.t_s[inside], reference.poses[inside]), estimate, max_gap_s=max_gap_s, min_coverage=min_coverage
    )
    return Association(swapped.t_s, swapped.reference, swapped.estimate, swapped.index, swapped.segment, swapped.total)


def check_trajectory(trajectory: Trajectory, name: str) -> None:
    """Raise TrajectoryError unless the shapes agree, there are samples, all are finite poses and times increase.

    Args:
        trajectory: The trajectory.
        name: What the error calls it.
    """
    t_s, poses = trajectory.t_s, trajectory.poses
    if t_s.ndim != 1 or poses.shape != (len(t_s), 3):
        raise TrajectoryError(f"{name}: times {t_s.shape} and poses {poses.shape} do not fit, expected (N,) and (N, 3)")
    if len(t_s) == 0:
        raise TrajectoryError(f"{name}: no samples")
    if not (np.isfinite(t_s).all() and np.isfinite(poses).all()):
        bad = int(np.flatnonzero(~(np.isfinite(t_s) & np.isfinite(poses).all(axis=1)))[0])
        raise TrajectoryError(f"{name}: sample {bad} is not finite")
    if (far := np.abs(poses).max(axis=1) > MAX_COORDINATE).any():
        raise TrajectoryError(f"{name}: sample {int(np.flatnonzero(far)[0])} is beyond {MAX_COORDINATE:g}, which no pose is")
    if (np.diff(t_s) <= 0.0).any():
        bad = int(np.flatnonzero(np.diff(t_s) <= 0.0)[0]) + 1
        raise TrajectoryError(f"{name}: time {t_s[bad]} of sample {bad} does not increase; sort the samples, drop duplicates")


def _covered(t_s: FloatArray, reference_t_s: FloatArray, after: NDArray[np.intp], max_gap_s: float) -> NDArray[np.bool_]:
    """Whether each time (N,) is that of a reference sample, or lies between two that are at most ``max_gap_s`` apart.

    ``after`` (N,) is the number of the first reference sample at or after each time, at least 1.
    """
    last = len(reference_t_s) - 1
    exact: NDArray[np.bool_] = (reference_t_s[np.minimum(after, last)] == t_s) | (reference_t_s[after - 1] == t_s)
    if last == 0:
        return exact
    inside = (t_s > reference_t_s[after - 1]) & (t_s < reference_t_s[after])
    short: NDArray[np.bool_] = reference_t_s[after] - reference_t_s[after - 1] <= max_gap_s
    return exact | (inside & short)


def _require_coverage(matched: int, total: int, min_coverage: float, max_gap_s: float) -> None:
    if matched == 0 or matched < min_coverage * total:
        raise CoverageError(
            f"{matched} of {total} estimated samples have ground truth within gaps of {max_gap_s:g} s "
            f"({matched / total:.1%}), the floor is {min_coverage:.0%}; check clocks and time spans"
        )
