"""What a localizer has to withstand besides other conditions: kidnapping, another town, drives of the published lengths."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hippodrome.core.localization.localizer import Localizer, LocalizerConfig
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import CognitiveMap, FloatArray, HippodromeError, Observation, Trajectory
from hippodrome.eval.methods.sequences import cut
from hippodrome.eval.methods.stages import localize_recording
from hippodrome.eval.metrics.localization import FALSE_FIX_M, LocalizationScore, score_localization
from hippodrome.eval.metrics.mapped_road import (
    OnMap,
    mapped_way_m,
    on_mapped_road,
    split_by_map,
)
from hippodrome.eval.metrics.trajectory import path_length_m
from hippodrome.eval.results.paper_rows import SEQUENCE_LENGTH_M
from hippodrome.sim.recording import Recording

BEFORE_M, AFTER_M = 200.0, 200.0  # driven before a kidnapping, and after it at most
JUMP_M = 100.0  # at least: farther than the error of any fix, and than a street's next crossing
KIDNAP_HEADINGS = "| condition | recovered | after median / max, m | wrong until at most, m |"
KIDNAP_DEFINITION = (
    f"localized for {BEFORE_M:g} m, then carried to another place of the drive, at least {JUMP_M:g} m away; recovered: declared "
    f"localized within {FALSE_FIX_M:g} m of the truth before {AFTER_M:g} m are driven, after so many metres of mapped road; "
    "wrong until: the last such metre at which the old place was still declared. Drives without a right fix before the jump are "
    "left out."
)
PAPER_HEADINGS = (
    "| sequence | length, m | error median, m | mean, m | p95, m | off the map, m | localized after, m | false fixes |"
)


@dataclass(frozen=True, slots=True)
class Kidnapping:
    """Carried off while localized; metres are counted from the jump."""

    recovered_after_m: float | None  # until declared localized and within ``FALSE_FIX_M`` of the truth; None: not within AFTER_M
    wrong_until_m: float  # how far it still declared the old place


@dataclass(frozen=True, slots=True, eq=False)
class PaperSequence:
    """One of the ten published lengths; ``failure`` instead of a score where the drive is too short for it."""

    number: int
    length_m: float
    failure: str | None = None
    score: LocalizationScore | None = None
    on_map: OnMap | None = None


def kidnappings(
    drive: Recording, observations: Sequence[Observation], cognitive_map: CognitiveMap, roads: RoadNetwork,
    config: LocalizerConfig, count: int,
) -> tuple[Kidnapping, ...]:  # fmt: skip
    """``count`` jumps within one drive; those that find the localizer without a right fix are left out."""
    poses_m, way_m = drive.samples.poses_m, path_length_m(drive.samples.poses_m)
    found = []
    for first, jump, landing, end in _jumps(poses_m, way_m, count):
        localizer = Localizer(cognitive_map, roads, config)
        for observation in observations[first:jump]:
            estimate = localizer.step(observation)
        if not estimate.localized or math.dist(estimate.pose[:2], poses_m[jump - 1, :2]) > FALSE_FIX_M:
            continue
        mapped = on_mapped_road(poses_m[landing:end], cognitive_map)
        found.append(_after(localizer, observations[landing:end], poses_m[landing:end], mapped))
    return tuple(found)


def _jumps(poses_m: FloatArray, way_m: FloatArray, count: int) -> list[tuple[int, int, int, int]]:
    """Steps (first, jump, landing, end): starts spread evenly, each lands half a drive on or where it is far enough away."""
    room_m = float(way_m[-1]) - max(BEFORE_M, AFTER_M)
    if room_m <= 0.0:
        return []
    chosen = []
    for start_m in np.linspace(0.0, room_m, count):
        first, jump = (int(step) for step in np.searchsorted(way_m, [start_m, start_m + BEFORE_M]))
        landings_m = (start_m + 0.5 * room_m + np.arange(0.0, room_m, 10.0)) % room_m
        for landing in np.searchsorted(way_m, landings_m):
            if math.dist(poses_m[landing, :2], poses_m[min(jump, len(poses_m) - 1), :2]) > JUMP_M:
                chosen.append((first, jump, int(landing), int(np.searchsorted(way_m, way_m[landing] + AFTER_M))))
                break
    return chosen


def _after(
    localizer: Localizer, observations: Sequence[Observation], poses_m: FloatArray, mapped: NDArray[np.bool_]
) -> Kidnapping:
    way_m, wrong_m = mapped_way_m(poses_m, mapped), 0.0
    for observation, pose_m, driven_m in zip(observations, poses_m, way_m, strict=True):
        estimate = localizer.step(observation)
        if estimate.localized and math.dist(estimate.pose[:2], pose_m[:2]) <= FALSE_FIX_M:
            return Kidnapping(float(driven_m), wrong_m)
        wrong_m = float(driven_m) if estimate.localized else wrong_m
    return Kidnapping(None, wrong_m)


def paper_sequences(
    drive: Recording,
    observations: Sequence[Observation],
    cognitive_map: CognitiveMap,
    roads: RoadNetwork,
    config: LocalizerConfig,
) -> tuple[PaperSequence, ...]:
    """Ten unknown starts of the lengths of the paper's Table II."""
    samples, found = drive.samples, []
    for number, length_m in enumerate(SEQUENCE_LENGTH_M, start=1):
        sequence = PaperSequence(number, length_m)
        try:
            first, end = cut(drive, number, len(SEQUENCE_LENGTH_M), length_m)
        except HippodromeError as error:
            found.append(replace(sequence, failure=str(error)))
            continue
        run = localize_recording(observations[first:end], Localizer(cognitive_map, roads, config))
        truth = Trajectory(samples.t_s[first:end], samples.poses_m[first:end])
        score = score_localization(run.estimates, truth, run.step_s)
        found.append(replace(sequence, score=score, on_map=split_by_map(score, truth.poses, cognitive_map)))
    return tuple(found)


def kidnapping_summary(found: Sequence[Kidnapping]) -> dict[str, Any]:
    """Median and worst recovery; a kidnapping without one counts as infinitely far in the median, None if it is that."""
    after_m = np.array([math.inf if one.recovered_after_m is None else one.recovered_after_m for one in found])
    median_m = float(np.median(after_m)) if len(after_m) else math.inf
    return {
        "kidnappings": len(found),
        "recovered": int(np.isfinite(after_m).sum()),
        "recovered_after_median_m": median_m if math.isfinite(median_m) else None,
        "recovered_after_max_m": max((one.recovered_after_m for one in found if one.recovered_after_m is not None), default=None),
        "wrong_until_max_m": max((one.wrong_until_m for one in found), default=None),
    }


def paper_summary(sequences: Sequence[PaperSequence]) -> dict[str, Any]:
    """Errors of the declared steps, pooled over the sequences that fit into the drive."""
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
    """One length's row."""
    score, on_map = sequence.score, sequence.on_map
    row = {"number": sequence.number, "length_m": sequence.length_m, "failure": sequence.failure}
    if score is None or on_map is None:
        return row
    found = {name: getattr(score, name) for name in ("success", "false_fixes", "mean_nees")}
    off_map = {"off_map_error_mean_m": _error_summary(on_map.off_map_errors_m)["error_mean_m"]}
    return {**row, **found, **_error_summary(on_map.errors_m), **off_map, "localized_after_m": on_map.localized_after_m}


def _error_summary(errors_m: FloatArray) -> dict[str, float | None]:
    if len(errors_m) == 0:
        return {"error_median_m": None, "error_mean_m": None, "error_p95_m": None}
    median_m, p95_m = (float(value) for value in np.percentile(errors_m, [50.0, 95.0]))
    return {"error_median_m": median_m, "error_mean_m": float(errors_m.mean()), "error_p95_m": p95_m}


def cases_markdown(kidnapped: dict[str, tuple[Kidnapping, ...]], paper: Sequence[PaperSequence]) -> str:
    """Two tables."""
    lines = ["## Kidnapping in mid-drive", "", KIDNAP_HEADINGS, "|---" * (KIDNAP_HEADINGS.count("|") - 1) + "|"]
    every = [one for found in kidnapped.values() for one in found]
    for name, found in [*kidnapped.items(), ("all", every)]:
        row = kidnapping_summary(found)
        figures = " / ".join(_figure(row[key]) for key in ("recovered_after_median_m", "recovered_after_max_m"))
        lines.append(f"| {name} | {row['recovered']} of {row['kidnappings']} | {figures} | {_figure(row['wrong_until_max_m'])} |")
    lines += ["", KIDNAP_DEFINITION, "", "## The paper's ten lengths, same condition", "", PAPER_HEADINGS]
    lines.append("|---" * (PAPER_HEADINGS.count("|") - 1) + "|")
    for record in map(paper_record, paper):
        end = record["failure"] or record["false_fixes"]
        lines.append(f"| {record['number']} | {record['length_m']:g} | {_error_figures(record, 'localized_after_m')} | {end} |")
    row = paper_summary(paper)
    figures = _error_figures(row, "localized_after_median_m")
    lines.append(f"| all | {row['successes']} of {row['sequences']} localized | {figures} | {row['false_fixes']} |")
    return "\n".join([*lines, ""])


def _error_figures(row: dict[str, Any], distance: str) -> str:
    keys = ("error_median_m", "error_mean_m", "error_p95_m", "off_map_error_mean_m", distance)
    return " | ".join(_figure(row.get(key)) for key in keys)


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
