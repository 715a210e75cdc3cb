"""Kidnapping: the vehicle is carried off while it is localized. When does the localizer doubt the old place and find the new?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hippodrome.core.localization.localizer import Localizer
from hippodrome.core.types import FloatArray, Observation
from hippodrome.eval.metrics.localization import FALSE_FIX_M
from hippodrome.eval.metrics.mapped_road import mapped_way_m, on_mapped_road
from hippodrome.eval.metrics.trajectory import path_length_m
from hippodrome.eval.trials.robustness.trial_drive import TrialDrive

BEFORE_M: Final = 200.0  # driven before a kidnapping
AFTER_M: Final = 200.0  # driven after it at most
JUMP_M: Final = 100.0  # least distance of a jump: farther than the error of any fix, and than a street's next crossing
LANDING_STEP_M: Final = 10.0  # between two places at which a landing is tried
DEFINITION: Final = (
    f"localized for {BEFORE_M:g} m, then carried to another place of the drive, at least {JUMP_M:g} m away; recovered: declared "
    f"localized within {FALSE_FIX_M:g} m of the truth before {AFTER_M:g} m are driven, after so many metres of mapped road; "
    "wrong until: the last such metre at which the old place was still declared. Drives without a right fix before the jump are "
    "left out."
)


@dataclass(frozen=True, slots=True)
class Kidnapping:
    """What came of one jump. Metres are of mapped road, counted from the jump."""

    recovered_after_m: float | None  # way until declared localized within ``FALSE_FIX_M`` of the truth; None: not in ``AFTER_M``
    wrong_until_m: float  # the last metre at which the old place was still declared


@dataclass(frozen=True, slots=True)
class Jump:
    """One jump within a drive, as steps of the drive: drive from ``first`` to ``leap``, go on from ``landing`` to ``end``."""

    first: int
    leap: int
    landing: int
    end: int


def kidnappings(drive: TrialDrive, count: int) -> tuple[Kidnapping, ...]:
    """What came of ``count`` jumps within one drive; those that find the localizer without a right fix are left out."""
    poses_m, observations = drive.recording.samples.poses_m, drive.observations
    found = []
    for jump in jumps(poses_m, path_length_m(poses_m), count):
        localizer = Localizer(drive.cognitive_map, drive.roads, drive.config)
        for observation in observations[jump.first : jump.leap]:
            estimate = localizer.step(observation)
        if not estimate.localized or math.dist(estimate.pose[:2], poses_m[jump.leap - 1, :2]) > FALSE_FIX_M:
            continue
        after = slice(jump.landing, jump.end)
        mapped = on_mapped_road(poses_m[after], drive.cognitive_map)
        found.append(_recovery(localizer, observations[after], poses_m[after], mapped))
    return tuple(found)


def jumps(poses_m: FloatArray, way_m: FloatArray, count: int) -> list[Jump]:
    """Jumps whose starts are spread evenly over a drive, each to the place half a drive on, or to the next that is far enough.

    Args:
        poses_m: True poses (N, 3) of the drive's steps.
        way_m: Metres (N,) driven until each step.
        count: How many are wanted. There are fewer where no place is far enough away, and none in a drive that is too short.
    """
    room_m = float(way_m[-1]) - max(BEFORE_M, AFTER_M)
    if room_m <= 0.0:
        return []
    chosen = []
    for start_m in np.linspace(0.0, room_m, count):
        first, leap = (int(step) for step in np.searchsorted(way_m, [start_m, start_m + BEFORE_M]))
        landings_m = (start_m + 0.5 * room_m + np.arange(0.0, room_m, LANDING_STEP_M)) % room_m
        for landing in np.searchsorted(way_m, landings_m):
            if math.dist(poses_m[landing, :2], poses_m[min(leap, len(poses_m) - 1), :2]) > JUMP_M:
                chosen.append(Jump(first, leap, int(landing), int(np.searchsorted(way_m, way_m[landing] + AFTER_M))))
                break
    return chosen


def _recovery(
    localizer: Localizer, observations: Sequence[Observation], poses_m: FloatArray, mapped: NDArray[np.bool_]
) -> Kidnapping:
    """Drive on from the landing until the localizer is right again. ``mapped`` (N,): whether each step is on mapped road."""
    way_m, wrong_m = mapped_way_m(poses_m, mapped), 0.0
    for observation, pose_m, driven_m in zip(observations, poses_m, way_m, strict=True):
        estimate = localizer.step(observation)
        if estimate.localized and math.dist(estimate.pose[:2], pose_m[:2]) <= FALSE_FIX_M:
            return Kidnapping(float(driven_m), wrong_m)
        wrong_m = float(driven_m) if estimate.localized else wrong_m
    return Kidnapping(None, wrong_m)


def kidnapping_summary(found: Sequence[Kidnapping]) -> dict[str, Any]:
    """Median and worst recovery as plain data.

    A kidnapping without recovery counts as infinitely far in the median, which is None where it is infinite.
    """
    after_m = np.array([math.inf if one.recovered_after_m is None else one.recovered_after_m for one in found])
    median_m = float(np.median(after_m)) if len(after_m) else math.inf
    return {
        "kidnappings": len(found),
        "recovered": int(np.isfinite(after_m).sum()),
        "recovered_after_median_m": median_m if math.isfinite(median_m) else None,
        "recovered_after_max_m": max((one.recovered_after_m for one in found if one.recovered_after_m is not None), default=None),
        "wrong_until_max_m": max((one.wrong_until_m for one in found), default=None),
    }
