"""A method in its own saved map: a second drive's sequences with unknown starts, scored as our localizer is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from hippodrome.core.types import HippodromeError, LocalizationEstimate, Trajectory
from hippodrome.eval.methods.method import Method
from hippodrome.eval.methods.sequences import cut
from hippodrome.eval.methods.stages import Localization
from hippodrome.eval.metrics.alignment import Transform, apply_to_trajectory, find_alignment
from hippodrome.eval.metrics.association import associate
from hippodrome.eval.metrics.localization import score_localization
from hippodrome.eval.programs.pairs import StereoDrive
from hippodrome.eval.results.paper_rows import SEQUENCE_LENGTH_M
from hippodrome.eval.results.table_two import LocalizedSequence, SequenceRow, failed_sequence, localized_sequence
from hippodrome.eval.trials.rivals.kept import Run, RunTask

NO_COVARIANCE = np.zeros((3, 3))  # none is kept
NO_NETWORKS = np.zeros(2), np.zeros(2), np.zeros((0, 2, 2)), np.zeros((0, 2, 2))  # means and reliabilities of none


def empty_rows(method: Method) -> list[SequenceRow]:
    """The rows of the ten sequences, not run yet."""
    return [SequenceRow(method=method.label, number=i, length_m=m) for i, m in enumerate(SEQUENCE_LENGTH_M, start=1)]


def sequence_task(row: SequenceRow, drive: StereoDrive, mapped: RunTask) -> RunTask:
    """The task of localizing one sequence in the map of a finished run.

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
    """The row of a sequence, scored as our localizer's are; its compute is CPU time, all threads together, without loading.

    Args:
        row: The sequence.
        run: The method's run on it.
        task: What the run was asked for.
        alignment: Takes poses of the loaded map to the network's frame.
        folder: The scenario's folder.
    """
    if run.live is None or run.steps is None:
        return failed_sequence(row, run.failure or "no trajectory")
    placed = apply_to_trajectory(alignment, run.live)
    estimates = [
        LocalizationEstimate(float(t_s), pose, NO_COVARIANCE, bool(known), 0.0, -1, *NO_NETWORKS)
        for t_s, pose, known in zip(placed.t_s, placed.poses, run.steps.known, strict=True)
    ]
    localization = Localization(estimates, np.diff(run.steps.cpu_s, prepend=0.0))
    try:
        score = score_localization(estimates, task.drive.truth(), localization.step_s)
    except HippodromeError as error:
        return failed_sequence(row, str(error))
    first_step = int(task.drive.samples.frame_steps[task.drive.first])
    return localized_sequence(row, first_step, localization.declared(), score, folder)
