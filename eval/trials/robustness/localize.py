"""Sequences from unknown starts: cut out of a drive, localized in the finished map, and scored."""

from __future__ import annotations

from typing import Final

import numpy as np

from hippodrome.core.localization.localizer import Localizer
from hippodrome.core.types import HippodromeError, Trajectory
from hippodrome.eval.methods.stages import localize_recording
from hippodrome.eval.metrics.localization import score_localization
from hippodrome.eval.metrics.mapped_road import split_by_map
from hippodrome.eval.metrics.trajectory import path_length_m
from hippodrome.eval.trials.robustness.sequences import SequenceResult
from hippodrome.eval.trials.robustness.trial_drive import TrialDrive
from hippodrome.sim.recording import Recording

# Length of a sequence: enough to be localized within 200 m and to be wrong thereafter. The paper's are 170 to 1,485 m long.
SEQUENCE_M: Final = 300.0


def sequence_steps(drive: Recording, sequences: int) -> list[slice]:
    """Steps of ``sequences`` stretches of ``SEQUENCE_M`` each, their starts spread evenly over the way driven.

    Raises HippodromeError if the drive is shorter than one of them.
    """
    travelled_m = path_length_m(drive.samples.poses_m)
    last_m = float(travelled_m[-1]) - SEQUENCE_M
    if last_m < 0.0:
        raise HippodromeError(
            f"{drive.folder}: the localization drive is {travelled_m[-1]:.0f} m long, sequences take {SEQUENCE_M:g} m: "
            "give localization.tour a greater length_m"
        )
    starts_m = np.linspace(0.0, last_m, sequences)
    first = np.searchsorted(travelled_m, starts_m, side="right") - 1
    end = np.searchsorted(travelled_m, starts_m + SEQUENCE_M, side="right")
    return [slice(int(a), int(b)) for a, b in zip(first, end, strict=True)]


def localized_sequence(number: int, steps: slice, truth: Trajectory, drive: TrialDrive) -> SequenceResult:
    """Localize one sequence from an unknown start and score it.

    Args:
        number: Number of the start along the drive, from 1.
        steps: The steps of the drive that make the sequence.
        truth: Where the vehicle truly was at every step of the whole drive, metres in the network's frame.
        drive: The drive and what it is localized in.
    """
    run = localize_recording(drive.observations[steps], Localizer(drive.cognitive_map, drive.roads, drive.config))
    truth = Trajectory(truth.t_s[steps], truth.poses[steps])
    score = score_localization(run.estimates, truth, run.step_s)
    confidence = np.array([estimate.confidence for estimate in run.estimates])
    has_query = np.append(True, np.diff(confidence) != 0.0)  # a query frame changes the confidence, a step without one keeps it
    return SequenceResult(
        number=number,
        start=tuple(float(value) for value in truth.poses[0]),
        on_map=split_by_map(score, truth.poses, drive.cognitive_map),
        false_fixes=score.false_fixes,
        false_share=score.false_fix_share,
        declared=int(score.localized.sum()),
        nees=score.mean_nees,
        step_ms=1e3 * float(run.step_s.mean()),
        query_step_ms=1e3 * float(np.median(run.step_s[has_query])),
    )
