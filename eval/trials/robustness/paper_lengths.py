"""Unknown starts of the ten lengths that the paper's Table II gives, one sequence each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hippodrome.core.localization.localizer import Localizer
from hippodrome.core.types import FloatArray, HippodromeError, Trajectory
from hippodrome.eval.methods.sequences import cut
from hippodrome.eval.methods.stages import localize_recording
from hippodrome.eval.metrics.localization import LocalizationScore, score_localization
from hippodrome.eval.metrics.mapped_road import OnMap, split_by_map
from hippodrome.eval.results.paper_rows import SEQUENCE_LENGTH_M
from hippodrome.eval.trials.robustness.trial_drive import TrialDrive


@dataclass(frozen=True, slots=True, eq=False)
class PaperSequence:
    """What came of one of the ten lengths: a score or, where the drive is too short for it, the ``failure`` that says so."""

    number: int
    length_m: float
    failure: str | None = None
    score: LocalizationScore | None = None
    on_map: OnMap | None = None


def paper_sequences(drive: TrialDrive) -> tuple[PaperSequence, ...]:
    """Cut one sequence of each length out of the drive, localize it from an unknown start, and score it."""
    samples, found = drive.recording.samples, []
    for number, length_m in enumerate(SEQUENCE_LENGTH_M, start=1):
        sequence = PaperSequence(number, length_m)
        try:
            first, end = cut(drive.recording, number, len(SEQUENCE_LENGTH_M), length_m)
        except HippodromeError as error:
            found.append(replace(sequence, failure=str(error)))
            continue
        run = localize_recording(drive.observations[first:end], Localizer(drive.cognitive_map, drive.roads, drive.config))
        truth = Trajectory(samples.t_s[first:end], samples.poses_m[first:end])
        score = score_localization(run.estimates, truth, run.step_s)
        found.append(replace(sequence, score=score, on_map=split_by_map(score, truth.poses, drive.cognitive_map)))
    return tuple(found)


def paper_summary(sequences: Sequence[PaperSequence]) -> dict[str, Any]:
    """Figures as plain data, pooled over the declared steps of all sequences that fit into the drive."""
    scores = [one.score for one in sequences if one.score is not None]
    on_map = [one.on_map for one in sequences if one.on_map is not None]
    pooled_m = np.concatenate([np.zeros(0), *(one.errors_m for one in on_map)])
    off_map_m = np.concatenate([np.zeros(0), *(one.off_map_errors_m for one in on_map)])
    after_m = [one.localized_after_m for one in on_map if one.localized_after_m is not None]
    return {
        "sequences": len(scores),
        "successes": len(after_m),
        **_error_summary(pooled_m),
        "off_map_error_mean_m": _error_summary(off_map_m)["error_mean_m"],
        "localized_after_median_m": float(np.median(after_m)) if after_m else None,
        "localized_after_max_m": max(after_m, default=None),
        "false_fixes": sum(score.false_fixes for score in scores),
    }


def paper_record(sequence: PaperSequence) -> dict[str, Any]:
    """The figures of one length as plain data; without a score, only its number, length and failure."""
    score, on_map = sequence.score, sequence.on_map
    row = {"number": sequence.number, "length_m": sequence.length_m, "failure": sequence.failure}
    if score is None or on_map is None:
        return row
    found = {name: getattr(score, name) for name in ("success", "false_fixes", "mean_nees")}
    off_map = {"off_map_error_mean_m": _error_summary(on_map.off_map_errors_m)["error_mean_m"]}
    return {**row, **found, **_error_summary(on_map.errors_m), **off_map, "localized_after_m": on_map.localized_after_m}


def _error_summary(errors_m: FloatArray) -> dict[str, float | None]:
    """Median, mean and 95th percentile of errors (N,); None where there are none."""
    if len(errors_m) == 0:
        return {"error_median_m": None, "error_mean_m": None, "error_p95_m": None}
    median_m, p95_m = (float(value) for value in np.percentile(errors_m, [50.0, 95.0]))
    return {"error_median_m": median_m, "error_mean_m": float(errors_m.mean()), "error_p95_m": p95_m}
