"""``hippodrome score``: a map or a trajectory against the truth of a recording, ours or imported."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from hippodrome._files import open_regular, write_atomically
from hippodrome.core.types import HippodromeError, Trajectory
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.lever import Ahead, at_axle
from hippodrome.eval.exchange.drives.truth import Truth, read_truth, stored_truth
from hippodrome.eval.exchange.score_localized import NOT_THE_NETWORKS, declared_poses, say, score_declared
from hippodrome.eval.exchange.score_localized import write_json as write_localization
from hippodrome.eval.files.spatial import Axes, SpatialPoses, flatten, is_own, read_poses
from hippodrome.eval.methods.materials import RPE_DELTA_M
from hippodrome.eval.methods.refusal import refusal_note
from hippodrome.eval.metrics.alignment import LABELS, AlignmentName
from hippodrome.eval.metrics.association import MAX_GAP_S, CoverageError
from hippodrome.eval.metrics.trajectory import Instants, Score, ape, rpe
from hippodrome.proto.codec import load_map
from hippodrome.proto.pbstream import MAGIC
from hippodrome.sim.recording import Recording, open_recording

MIN_COVERAGE = 0.5  # foreign truth often begins late or ends early; how much was scored is printed
GAP_AT_FIXES_S = 1.0  # the estimate is interpolated over this at sparse fixes, or over twice its usual interval
RAYLEIGH_MEAN = 1.2533  # mean distance of a planar position whose axes have a standard deviation of 1

Clock = Literal["auto", "source", "recording"]
LEAST_ORIGIN_S: Final = 1e-3  # clocks that differ by less are the same: what differs is rounding


@dataclass(frozen=True, slots=True)
class ScoreOptions:
    """What to score, and how to take it."""

    estimate: Path  # a map, TUM poses, or KITTI's
    recording: Path
    network_frame: bool = True  # whether a trajectory is given in metres, in the network's frame
    axes: Axes | None = None  # what attitudes turn
    times: Path | None = None  # the times of KITTI's poses
    clock: Clock = "auto"  # of a trajectory
    truth: Path | None = None  # in place of the recording's own
    network: Path | None = None  # whose frame fixes are projected into
    truth_sigma_m: float | None = None
    time_offset_s: float = 0.0  # added to the times of ``truth``
    max_gap_s: float | None = None
    json_file: Path | None = None
    max_ape_m: float | None = None
    max_rpe_m: float | None = None
    camera_ahead: float | None = None  # of the trajectory's poses before the rear axle; None: they are of the truth's point
    truth_ahead: Ahead = "auto"  # of the poses of ``truth``
    localization: bool = False  # whether the trajectory is a localizer's of a second drive


@dataclass(slots=True)
class _Sheet:
    """What was said so far."""

    figures: list[Score] = field(default_factory=list)
    not_scored: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def note(self, text: str) -> None:
        self.notes.append(text)
        print(f"note: {text}")

    def figure(self, name: str, make: Callable[[], Score]) -> Score | None:
        """A figure, printed; or, where it cannot be said, why. A coverage that is too small is an error of the whole."""
        try:
            score = make()
        except CoverageError:
            raise
        except HippodromeError as error:
            reason = str(error).split("; use ")[0]
            self.not_scored.append(f"{name}: {reason}")
            print(f"not scored: {name}: {reason}")
            return None
        self.figures.append(score)
        print(f"mean {score.mean_m:.3f} m, median {score.median_m:.3f}, p95 {score.p95_m:.3f}, max {score.max_m:.3f}, "
              f"{score.matched} of {score.total} samples: {score.definition}")  # fmt: skip
        return score


def score_files(options: ScoreOptions) -> bool:
    """Print APE and RPE of an estimate with their definitions; whether the limits hold.

    Raises:
        HippodromeError: A file cannot be read, there is no truth, or too little of it was estimated.
    """
    drive = open_recording(options.recording)
    sheet = _Sheet()
    truth, same_world = _truth(options, drive, sheet)
    truth = _of_its_point(options, truth, sheet)
    if options.localization:
        if not same_world:
            raise ExchangeError(f"{options.recording}: {NOT_THE_NETWORKS}")
        source = options.clock == "source" or (options.clock == "auto" and not is_own(options.estimate))
        declared = declared_poses(options.estimate, -_origin_s(drive) if source else 0.0, options.camera_ahead or 0.0)
        score = score_declared(declared, truth.trajectory, drive, options.max_gap_s or MAX_GAP_S)
        if options.json_file is not None:
            write_localization(options.json_file, options.estimate, drive, score, declared)
        return say(score, declared, options.max_ape_m)
    trajectory, metric, clause = _estimate(options, drive, truth, same_world, sheet)
    at, max_gap_s = _instants(trajectory, truth.trajectory, options.max_gap_s)

    def said(score: Score) -> Score:
        return replace(score, definition=score.definition + clause)

    def absolute(alignment: AlignmentName) -> Score | None:
        kept = {"max_gap_s": max_gap_s, "min_coverage": MIN_COVERAGE}
        return sheet.figure(
            f"APE, alignment {LABELS[alignment]}", lambda: said(ape(trajectory, truth.trajectory, alignment, at=at, **kept))
        )

    alignments: tuple[AlignmentName, ...] = (
        ("none",) if metric and same_world else ("se2",) if metric else ("start", "se2", "sim2")
    )
    first = [absolute(alignment) for alignment in alignments]
    if alignments == ("se2",) and first == [None]:  # one pose, or a vehicle that stands: what needs no fit can still be said
        first = [absolute("start"), absolute("none")]
    relative: Score | None = None
    if truth.has_heading:
        for delta_m in (None, RPE_DELTA_M):
            name = "RPE, consecutive samples" if delta_m is None else f"RPE, {delta_m:g} m"

            def pairs(delta_m: float | None = delta_m) -> Score:
                return said(rpe(trajectory, truth.trajectory, delta_m, max_gap_s=max_gap_s, min_coverage=MIN_COVERAGE, at=at))

            relative = sheet.figure(name, pairs)
    else:
        sheet.not_scored.append("RPE: fixes have no heading")
        print("not scored: RPE: fixes have no heading")
    _say_accuracy(truth, sheet)
    if options.json_file is not None:
        _write_json(options, sheet)
    best = next((score for score in first if score is not None), None)
    return _within("APE", best, options.max_ape_m) & _within("RPE", relative, options.max_rpe_m)


def _truth(options: ScoreOptions, drive: Recording, sheet: _Sheet) -> tuple[Truth, bool]:
    """The truth in the recording's clock, and whether it is in the road network's frame."""
    if options.truth is None:
        if (kept := stored_truth(drive)) is None:
            raise ExchangeError(
                f"{options.recording}: this drive was imported without truth, so nothing can be scored; give --truth FILE"
            )
        if options.truth_sigma_m is not None:
            kept = replace(kept, sigma_m=np.full(len(kept.sigma_m), options.truth_sigma_m))
        return kept, drive.manifest.get("truth_frame", "network") == "network"
    found = read_truth(options.truth, options.axes, options.network, options.truth_sigma_m)
    found = found.at_axle(options.truth_ahead, str(options.truth))
    for note in found.notes:
        sheet.note(note)
    truth = found.moved(options.time_offset_s - _origin_s(drive))
    t_s = truth.trajectory.t_s
    if t_s[-1] < drive.samples.t_s[0] or t_s[0] > drive.samples.t_s[-1]:
        raise ExchangeError(
            f"{options.truth}: its times, {t_s[0]:.3f} to {t_s[-1]:.3f} s of the recording's clock, lie outside of the drive, "
            f"{drive.samples.t_s[0]:.3f} to {drive.samples.t_s[-1]:.3f} s; give --time-offset SECONDS, which is added to them"
        )
    return truth, found.in_network


def _estimate(
    options: ScoreOptions, drive: Recording, truth: Truth, same_world: bool, sheet: _Sheet
) -> tuple[Trajectory, bool, str]:
    """The trajectory in the recording's clock, whether it is metric, and what its definition adds."""
    if _is_map(options.estimate):
        found = load_map(options.estimate)[0]
        if (refused := refusal_note(found)) is not None:
            sheet.note(refused)
        return Trajectory(found.t_s, found.poses), found.frame == "network", ""
    poses = read_poses(options.estimate, options.axes, options.times)
    for note in poses.notes:
        sheet.note(note)
    origin_s = _origin_s(drive)
    if origin_s and (options.clock == "source" or (options.clock == "auto" and not poses.own)):
        poses = replace(poses, t_s=poses.t_s - origin_s)
        if abs(origin_s) >= LEAST_ORIGIN_S:
            sheet.note(
                f"{options.estimate}: taken to be in the clock of the drive's source; the recording begins at {origin_s:.3f} s"
            )
    fitted = not (options.network_frame and same_world)
    trajectory = flatten(poses, truth.in_space() if fitted else None)
    clause = _level_clause(poses, trajectory, fitted)
    if options.camera_ahead:
        clause += f"; its poses moved back by {options.camera_ahead:g}, to the rear axle"
    return at_axle(trajectory, options.camera_ahead or 0.0), options.network_frame, clause


def _of_its_point(options: ScoreOptions, truth: Truth, sheet: _Sheet) -> Truth:
    """The truth of the point whose trajectory is scored: the rear axle for maps and what hippodrome wrote.

    Other trajectories are, unless the user says where their camera sits, taken for those of the point whose truth was measured.
    """
    if options.camera_ahead is not None or truth.ahead_m == 0.0 or _is_map(options.estimate) or is_own(options.estimate):
        return truth
    sheet.note(
        f"{options.estimate}: taken for poses of the point whose truth was measured, {truth.ahead_m:.2f} ahead of the rear axle "
        "(--camera-ahead says otherwise; 0: of the axle)"
    )
    return truth.as_measured()


def _level_clause(poses: SpatialPoses, trajectory: Trajectory, fitted: bool) -> str:
    if np.array_equal(trajectory.poses[:, :2], poses.positions[:, :2]):
        return ""
    how = (
        "by their fit to the truth in space (Umeyama), or by themselves where that is not determined"
        if fitted
        else "by themselves"
    )
    return f"; poses in space turned level {how}, then errors in the horizontal plane"


def _origin_s(drive: Recording) -> float:
    """When the recording's clock begins in that of its source."""
    imported = drive.manifest.get("imported")
    value = imported.get("time_origin_s", 0.0) if isinstance(imported, dict) else 0.0
    return float(value) if isinstance(value, int | float) else 0.0


def _is_map(path: Path) -> bool:
    """Whether a file is a map, by its first bytes; one that cannot be opened is left to the reader to complain about."""
    try:
        with open_regular(path) as stream:
            return stream.read(len(MAGIC)) == MAGIC or path.suffix == ".pbstream"
    except OSError:
        return path.suffix == ".pbstream"


def _instants(estimate: Trajectory, truth: Trajectory, max_gap_s: float | None) -> tuple[Instants, float]:
    """At whose times the two are compared, and over what gaps the other one is interpolated."""
    if len(truth.t_s) < 2 or (len(estimate.t_s) < 2) or float(np.median(np.diff(truth.t_s))) <= MAX_GAP_S:
        return "estimate", max_gap_s or MAX_GAP_S
    usual_s = float(np.median(np.diff(estimate.t_s)))
    return "reference", max_gap_s or max(GAP_AT_FIXES_S, 2.0 * usual_s)


def _say_accuracy(truth: Truth, sheet: _Sheet) -> None:
    known = truth.sigma_m[np.isfinite(truth.sigma_m)]
    if len(known) == 0:
        if not truth.has_heading:
            sheet.note("the fixes do not say how accurate they are; --truth-sigma METRES says it")
        return
    sigma_m = float(np.sqrt(np.mean(known**2)))
    sheet.note(
        f"the truth itself is uncertain by {sigma_m:.2f} m (one sigma along each axis): a perfect estimate would have a mean "
        f"APE of about {RAYLEIGH_MEAN * sigma_m:.2f} m"
    )


def _within(name: str, score: Score | None, limit_m: float | None) -> bool:
    if limit_m is None:
        return True
    if score is None:
        print(f"limit missed: {name} could not be scored, the limit is {limit_m:g} m")
        return False
    holds = score.mean_m <= limit_m
    print(f"limit {'holds' if holds else 'missed'}: mean {name} {score.mean_m:.3f} m, the limit is {limit_m:g} m")
    return holds


def _write_json(options: ScoreOptions, sheet: _Sheet) -> None:
    assert options.json_file is not None
    figures: list[dict[str, Any]] = [
        {"definition": s.definition, "mean_m": s.mean_m, "median_m": s.median_m, "p95_m": s.p95_m, "max_m": s.max_m,
         "rmse_m": s.rmse_m, "matched": s.matched, "total": s.total}
        for s in sheet.figures
    ]  # fmt: skip
    content = {
        "estimate": options.estimate.name,
        "recording": options.recording.name,
        "figures": figures,
        "not_scored": sheet.not_scored,
        "notes": sheet.notes,
    }
    try:
        write_atomically(options.json_file, (json.dumps(content, indent=1) + "\n").encode())
    except OSError as error:
        raise ExchangeError(f"{options.json_file}: cannot be written: {error.strerror}") from None
