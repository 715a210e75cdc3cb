"""ORB-SLAM3 in its own saved map: a second drive's sequences with unknown starts, scored as our localizer is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from hippodrome.core.types import FloatArray, HippodromeError, LocalizationEstimate, Trajectory
from hippodrome.eval.metrics.alignment import Transform, apply_to_trajectory, find_alignment
from hippodrome.eval.metrics.association import associate
from hippodrome.eval.metrics.localization import score_localization
from hippodrome.eval.results.paper_rows import SEQUENCE_LENGTH_M
from hippodrome.eval.rivals.orbslam3.pairs import StereoDrive
from hippodrome.eval.rivals.orbslam3.tracker import Run, RunTask
from hippodrome.eval.rivals.sequences import (
    Located,
    SequenceRow,
    cut,
    located,
)

METHOD = "ORB-SLAM3"
UNKNOWN = np.zeros((3, 3))  # the tracker states no covariance
NONE = np.zeros(2), np.zeros(2), np.zeros((0, 2, 2)), np.zeros((0, 2, 2))  # nor has it attractor networks


def empty_rows() -> list[SequenceRow]:
    """The ten sequences, not run yet."""
    return [SequenceRow(method=METHOD, number=i, length_m=m) for i, m in enumerate(SEQUENCE_LENGTH_M, start=1)]


def sequence_task(row: SequenceRow, drive: StereoDrive, mapped: RunTask) -> RunTask:
    """The row's sequence of the localization drive, in the map of a finished run. Raises HippodromeError."""
    first, end = cut(drive, row.number, len(SEQUENCE_LENGTH_M), row.length_m)
    frames = np.flatnonzero((drive.samples.frame_steps >= first) & (drive.samples.frame_steps < end))
    folder = mapped.folder / f"sequence-{row.number}"
    return replace(mapped, drive=drive.part(int(frames[0]), len(frames)), folder=folder, loaded=mapped.folder)


def map_alignment(mapped: Run, truth: Trajectory) -> Transform:
    """Where the saved map lies in the network: the best rigid fit of the mapping run's final trajectory, as in Table I."""
    assert mapped.final is not None
    pairs = associate(mapped.final, truth)
    return find_alignment("se2", pairs.estimate, pairs.reference)


def score_sequence(row: SequenceRow, run: Run, task: RunTask, alignment: Transform, to: Path) -> Located:
    """Localized: tracked in the loaded map. Compute: what the process took, all threads, loading excluded."""
    if run.live is None or run.steps is None:
        return Located(row.model_copy(update={"failure": run.failure}))
    poses = _poses_at(run.steps.t_s, apply_to_trajectory(alignment, run.live))
    steps = zip(run.steps.t_s, poses, run.steps.in_map, strict=True)
    estimates = [LocalizationEstimate(float(t_s), pose, UNKNOWN, bool(known), 0.0, -1, *NONE) for t_s, pose, known in steps]
    try:
        score = score_localization(estimates, task.drive.truth(), np.diff(run.steps.cpu_s, prepend=0.0))
    except HippodromeError as error:
        return Located(row.model_copy(update={"failure": str(error)}))
    return located(row, int(task.drive.samples.frame_steps[task.drive.first]), estimates, score, to)


def _poses_at(t_s: FloatArray, live: Trajectory) -> FloatArray:
    """The pose reported last (N, 3): a frame that was lost reports none."""
    latest = np.clip(np.searchsorted(live.t_s, t_s + 1e-6) - 1, 0, None)
    poses: FloatArray = live.poses[latest]
    return poses
