"""``hippodrome score --localization``: anybody's poses of a second drive: first fix, errors, false fixes."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hippodrome._files import write_atomically
from hippodrome.core.types import FloatArray, Trajectory
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.lever import at_axle
from hippodrome.eval.files.trajectories import COLUMNS, read_tum, read_tum_declared
from hippodrome.eval.methods.protocol import Answer, as_estimate
from hippodrome.eval.metrics.localization import FALSE_FIX_M, LocalizationScore, score_localization
from hippodrome.eval.results.model import summarize_localization
from hippodrome.sim.recording import Recording

NOT_THE_NETWORKS: Final = (
    "its truth is not in the road network's frame, in which a localizer answers; import it with --truth-frame network, or give "
    "--truth with --network"
)
NEAR: Final = 1.5  # usual intervals: a step of the drive with no pose so near is one at which the localizer did not know


@dataclass(frozen=True, slots=True, eq=False)
class Declared:
    """A localizer's poses."""

    trajectory: Trajectory  # of the rear axle, in the road network's frame and the recording's clock
    localized: NDArray[np.bool_]  # (N,) whether it stands by each
    has_column: bool  # whether the file says so; if not, it is taken to stand by all


def declared_poses(path: Path, shift_s: float, camera_ahead: float) -> Declared:
    """The poses of a TUM file, and which of them the localizer stands by.

    Args:
        path: TUM text, with a ninth column ``localized`` (1 or 0) or without.
        shift_s: Added to its times.
        camera_ahead: How far before the rear axle the point is whose poses these are.

    Raises:
        HippodromeError: It is no trajectory.
    """
    with_column = read_tum_declared(path)
    if with_column is not None:
        trajectory, localized = with_column
    else:
        trajectory = read_tum(path)
        localized = np.ones(len(trajectory.t_s), np.bool_)
    moved = at_axle(Trajectory(trajectory.t_s + shift_s, trajectory.poses), camera_ahead)
    return Declared(moved, localized, with_column is not None)


def score_declared(declared: Declared, truth: Trajectory, drive: Recording, max_gap_s: float) -> LocalizationScore:
    """The score of a localizer's poses of a drive; at steps without a pose near in time, the localizer did not know.

    Raises:
        HippodromeError: The drive has no truth, or the poses lie outside of it.
    """
    steps_s, trajectory = drive.samples.t_s, declared.trajectory
    inside = (trajectory.t_s >= steps_s[0] - max_gap_s) & (trajectory.t_s <= steps_s[-1] + max_gap_s)
    if not inside.any():
        raise ExchangeError(
            f"its times, {trajectory.t_s[0]:.3f} to {trajectory.t_s[-1]:.3f} s, lie outside of the drive, {steps_s[0]:.3f} to "
            f"{steps_s[-1]:.3f} s; --clock says in whose clock they are"
        )
    t_s, poses, localized = trajectory.t_s[inside], trajectory.poses[inside], declared.localized[inside]
    silent_s = steps_s[_apart_s(steps_s, t_s) > NEAR * max(_usual_s(steps_s), _usual_s(t_s))]
    answers = [_answer(t_s, poses[0], False) for t_s in silent_s]
    answers += [_answer(t_s, pose, bool(known)) for t_s, pose, known in zip(t_s, poses, localized, strict=True)]
    estimates = [as_estimate(one, "the trajectory") for one in sorted(answers, key=lambda one: one.t_s)]
    return score_localization(estimates, truth, np.zeros(len(estimates)), max_gap_s=max_gap_s)


def say(score: LocalizationScore, declared: Declared, max_error_m: float | None) -> bool:
    """Print the score, and what was taken for what; whether the limit of the mean error holds."""
    if not declared.has_column:
        print(f"note: no column 'localized' (the {COLUMNS + 1}th, 1 or 0): it is taken to stand by all of its poses")
    share, far = f"localized in {100 * score.localized_share:.1f} % of the drive", f"stretches more than {FALSE_FIX_M:g} m off"
    print(f"{share}, false fixes: {score.false_fixes} ({far})")
    if score.success:
        print(f"first fix after {score.initial_drive_s:.1f} s and {score.initial_distance_m:.1f} m of driving")
        print(f"mean {score.error_mean_m:.3f} m, median {score.error_median_m:.3f}, p95 {score.error_p95_m:.3f}, max "
              f"{score.error_max_m:.3f}, {score.matched} of {score.total} steps: {score.definition}")  # fmt: skip
    else:
        print(f"not localized: no declared pose lies within {FALSE_FIX_M:g} m of the truth")
    if max_error_m is None:
        return True
    held = score.error_mean_m is not None and score.error_mean_m <= max_error_m
    print(f"limit {'holds' if held else 'missed'}: the mean localization error's limit is {max_error_m:g} m")
    return held


def write_json(path: Path, estimate: Path, drive: Recording, score: LocalizationScore, declared: Declared) -> None:
    """Write the figures. What they took of a processor is not known, so it is null. Raises ExchangeError."""
    summary: dict[str, Any] = summarize_localization(replace(score, initial_time_ms=None)).model_dump(mode="python")
    names = {"estimate": estimate.name, "recording": drive.folder.name, "localized_column": declared.has_column}
    try:
        write_atomically(path, (json.dumps({**names, "localization": summary}, indent=1) + "\n").encode())
    except OSError as error:
        raise ExchangeError(f"{path}: cannot be written: {error.strerror}") from None


def _answer(t_s: float, pose: FloatArray, localized: bool) -> Answer:
    return Answer(float(t_s), float(pose[0]), float(pose[1]), float(pose[2]), localized)


def _usual_s(t_s: FloatArray) -> float:
    return float(np.median(np.diff(t_s))) if len(t_s) > 1 else 0.0


def _apart_s(steps_s: FloatArray, known_s: FloatArray) -> FloatArray:
    """Time (T,) from each step to the nearest known one."""
    after = np.clip(np.searchsorted(known_s, steps_s), 0, len(known_s) - 1)
    before = np.clip(after - 1, 0, len(known_s) - 1)
    apart_s: FloatArray = np.minimum(np.abs(steps_s - known_s[before]), np.abs(steps_s - known_s[after]))
    return apart_s
