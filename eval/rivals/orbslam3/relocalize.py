"""ORB-SLAM3 in its own saved map: a second drive's sequences with unknown starts, scored as our localizer is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from hippodrome.core.types import FloatArray, HippodromeError, LocalizationEstimate, Trajectory
from hippodrome.eval.methods.method import ORBSLAM3
from hippodrome.eval.methods.sequences import cut
from hippodrome.eval.methods.stages import Localization
from hippodrome.eval.metrics.alignment import Transform, apply_to_trajectory, find_alignment
from hippodrome.eval.metrics.association import associate
from hippodrome.eval.metrics.localization import score_localization
from hippodrome.eval.results.paper_rows import SEQUENCE_LENGTH_M
from hippodrome.eval.results.table_two import LocalizedSequence, SequenceRow, failed_sequence, localized_sequence
from hippodrome.eval.rivals.orbslam3.pairs import StereoDrive
from hippodrome.eval.rivals.orbslam3.tracker import Run, RunTask

NO_COVARIANCE = np.zeros((3, 3))  # the tracker states none
NO_NETWORKS = np.zeros(2), np.zeros(2), np.zeros((0, 2, 2)), np.zeros((0, 2, 2))  # means and reliabilities of none


def empty_rows() -> list[SequenceRow]:
    """The rows of the ten sequences, not run yet."""
    return [SequenceRow(method=ORBSLAM3.label, number=i, length_m=m) for i, m in enumerate(SEQUENCE_LENGTH_M, start=1)]


def sequence_task(row: SequenceRow, drive: StereoDrive, mapped: RunTask) -> RunTask:
    """The task of tracking one sequence in the map of a finished run.

    Args:
        row: The sequence.
        drive: The localization drive.
        mapped: The run whose map is loaded.

    Raises:
        HippodromeError: The drive is shorter than the sequence.
    """
    first, end = cut(drive, row.number, len(SEQUENCE_LENGTH_M), row.length_m)
    frames = np.flatnonzero((drive.samples.frame_steps >= first) & (drive.samples.frame_steps < end))
    folder = mapped.folder / f"sequence-{row.number}"
    return replace(mapped, drive=drive.part(int(frames[0]), len(frames)), folder=folder, loaded=mapped.folder)


def map_alignment(mapped: Run, truth: Trajectory) -> Transform:
    """Where the saved map lies in the network's frame: the best rigid fit of the mapping run's final trajectory to the truth."""
    assert mapped.final is not None
    pairs = associate(mapped.final, truth)
    return find_alignment("se2", pairs.estimate, pairs.reference)


def score_sequence(row: SequenceRow, run: Run, task: RunTask, alignment: Transform, folder: Path) -> LocalizedSequence:
    """The row of a sequence, scored as our localizer's are.

    A frame counts as localized if it was tracked in the loaded map. Its compute is the CPU time of the process, all threads
    together, without loading.

    Args:
        row: The sequence.
        run: The tracker's run on it.
        task: What the run was asked for.
        alignment: Takes poses of the loaded map to the network's frame.
        folder: The scenario's folder.
    """
    if run.live is None or run.steps is None:
        return failed_sequence(row, run.failure or "no trajectory")
    poses = _poses_at(run.steps.t_s, apply_to_trajectory(alignment, run.live))
    steps = zip(run.steps.t_s, poses, run.steps.in_map, strict=True)
    estimates = [
        LocalizationEstimate(float(t_s), pose, NO_COVARIANCE, bool(in_map), 0.0, -1, *NO_NETWORKS) for t_s, pose, in_map in steps
    ]
    localization = Localization(estimates, np.diff(run.steps.cpu_s, prepend=0.0))
    try:
        score = score_localization(estimates, task.drive.truth(), localization.step_s)
    except HippodromeError as error:
        return failed_sequence(row, str(error))
    first_step = int(task.drive.samples.frame_steps[task.drive.first])
    return localized_sequence(row, first_step, localization.declared(), score, folder)


def _poses_at(t_s: FloatArray, live: Trajectory) -> FloatArray:
    """The latest pose (N, 3) that was reported at each time (N,): a frame in which tracking was lost reports none."""
    latest = np.clip(np.searchsorted(live.t_s, t_s + 1e-6) - 1, 0, None)
    poses: FloatArray = live.poses[latest]
    return poses
