"""How well the localizer did, judged against ground truth that it never saw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hippodrome.core.types import FloatArray, LocalizationEstimate, Trajectory
from hippodrome.eval.metrics.association import MAX_GAP_S, MIN_COVERAGE, associate
from hippodrome.eval.metrics.calibration import mean_nees, pose_errors
from hippodrome.eval.metrics.trajectory import MetricError, path_length_m

FALSE_FIX_M = 20.0  # a declared pose farther off than this, about the distance to the next street, is a confident wrong answer


@dataclass(frozen=True, slots=True, eq=False)
class LocalizationScore:
    """One drive in a known map from an unknown start.

    A step is *declared* if the localizer declares itself localized in it. The *initial localization* is the first declared step
    within ``FALSE_FIX_M`` of the truth; without one the drive failed, and the ``initial_*`` and ``error_*`` figures are None.
    """

    definition: str
    success: bool
    initial_time_ms: float | None  # compute from the first frame to the initial localization, without loading the map
    initial_drive_s: float | None  # driving time until the initial localization
    initial_distance_m: float | None  # metres driven until the initial localization
    initial_frames: int | None  # observations up to and including the initial localization
    error_mean_m: float | None  # over the declared steps from the initial localization on, false fixes included
    error_median_m: float | None
    error_p95_m: float | None
    error_max_m: float | None
    drive_error_mean_m: float | None  # over all steps from the initial localization on, declared or not
    heading_error_mean_rad: float | None  # over the same steps as ``error_mean_m``
    false_fixes: int  # separate stretches of declared steps more than ``FALSE_FIX_M`` wrong
    false_fix_share: float  # share of such steps in the declared ones
    localized_share: float  # share of the declared steps in all
    # Normalised estimation error squared per dimension (x, y, heading) over the declared steps; 1 is calibrated. None if there
    # are no declared steps, or if one of their covariances is not positive definite.
    mean_nees: float | None
    matched: int  # steps with ground truth
    total: int  # steps
    t_s: FloatArray  # (N,) of the steps with ground truth, as the two below
    errors_m: FloatArray  # (N,)
    localized: NDArray[np.bool_]  # (N,)


def score_localization(
    estimates: Sequence[LocalizationEstimate],
    truth: Trajectory,
    step_compute_s: FloatArray,
    *,
    max_gap_s: float = MAX_GAP_S,
    min_coverage: float = MIN_COVERAGE,
) -> LocalizationScore:
    """Score a localizer's estimates of one drive.

    Args:
        estimates: One estimate per observation, T in all.
        truth: Ground truth.
        step_compute_s: Compute time (T,) that each step took.
        max_gap_s: Reference samples farther apart than this are not interpolated.
        min_coverage: Least share of the steps that must have ground truth.

    Raises:
        HippodromeError: There are no estimates, not as many times, or too few steps have ground truth.
    """
    if len(estimates) != len(step_compute_s):
        raise MetricError(f"{len(estimates)} estimates but {len(step_compute_s)} step times: one each per observation")
    if not estimates:
        raise MetricError("no localization estimates to score")
    driven = Trajectory(np.array([e.t_s for e in estimates]), np.stack([e.pose for e in estimates]))
    matched = associate(driven, truth, max_gap_s=max_gap_s, min_coverage=min_coverage)
    offsets = pose_errors(matched.estimate, matched.reference)
    errors_m = np.hypot(offsets[:, 0], offsets[:, 1])
    localized = np.array([estimates[i].localized for i in matched.index])
    covariances = np.stack([estimates[i].covariance for i in matched.index])
    wrong = localized & (errors_m > FALSE_FIX_M)
    first = _first(localized & ~wrong)
    after = np.arange(len(errors_m)) >= (len(errors_m) if first is None else first)
    declared = errors_m[after & localized]
    return LocalizationScore(
        definition="localization error, position, m; network frame, no alignment; steps declared localized, from the first "
        f"declaration within {FALSE_FIX_M:g} m on; reference linear in time within gaps <= {max_gap_s:g} s",
        success=first is not None,
        initial_time_ms=None if first is None else 1e3 * float(np.sum(step_compute_s[: matched.index[first] + 1])),
        initial_drive_s=None if first is None else float(matched.t_s[first] - driven.t_s[0]),
        initial_distance_m=None if first is None else float(path_length_m(matched.reference)[first]),
        initial_frames=None if first is None else int(matched.index[first]) + 1,
        error_mean_m=_mean(declared),
        error_median_m=_percentile(declared, 50.0),
        error_p95_m=_percentile(declared, 95.0),
        error_max_m=_percentile(declared, 100.0),
        drive_error_mean_m=_mean(errors_m[after]),
        heading_error_mean_rad=_mean(np.abs(offsets[after & localized, 2])),
        false_fixes=int(np.count_nonzero(np.diff(wrong.astype(np.int8), prepend=0) == 1)),
        false_fix_share=float(wrong.sum() / max(localized.sum(), 1)),
        localized_share=float(localized.mean()),
        mean_nees=_mean_nees(offsets[localized], covariances[localized]),
        matched=len(matched.t_s),
        total=matched.total,
        t_s=matched.t_s,
        errors_m=errors_m,
        localized=localized,
    )


def _mean_nees(errors: FloatArray, covariances: FloatArray) -> float | None:
    if len(errors) == 0 or (np.linalg.eigvalsh(covariances) <= 0.0).any():
        return None
    return mean_nees(errors, covariances)


def _first(holds: NDArray[np.bool_]) -> int | None:
    return int(np.argmax(holds)) if holds.any() else None


def _mean(values: FloatArray) -> float | None:
    return float(values.mean()) if len(values) else None


def _percentile(values: FloatArray, percent: float) -> float | None:
    return float(np.percentile(values, percent)) if len(values) else None
