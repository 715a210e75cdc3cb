"""ORB-SLAM3's part of ``hippodrome baselines``: stereo pairs, vocabulary, mapping runs, sequences in the median run's map."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil
from pathlib import Path

from hippodrome.core.types import HippodromeError
from hippodrome.eval.pool import Workers, process_pool
from hippodrome.eval.results.model import Row
from hippodrome.eval.rivals.orbslam3.environment import NotInstalled, ensure_environment
from hippodrome.eval.rivals.orbslam3.pairs import (
    StereoDrive,
    draw_pairs,
    missing_chunks,
    stereo_drive,
)
from hippodrome.eval.rivals.orbslam3.relocalize import (
    empty_rows,
    map_alignment,
    score_sequence,
    sequence_task,
)
from hippodrome.eval.rivals.orbslam3.rows import failed_rows, median_run, rows
from hippodrome.eval.rivals.orbslam3.tracker import (
    Run,
    RunTask,
    own_fault,
    run_tracker,
)
from hippodrome.eval.rivals.orbslam3.training import VocabularyTask, train_vocabulary
from hippodrome.eval.rivals.sequences import Located, SequenceRow
from hippodrome.sim.record import ROLES, RecordingPlan, prepare
from hippodrome.sim.scenario import Scenario

# The size and about the baseline of the published car data sets. Without grain most of a street's surface has no corner to track;
# grain finer than a pixel fades by itself: drawing at twice the size, twice the time, gained less than two runs differ by.
STEREO = {"width": 640, "height": 480, "stereo_baseline_m": 0.5, "grain": True, "supersample": 1}
TRACKER_BYTES = 7_000_000_000  # of memory, late in the paper's drive, when global bundle adjustments overlap: up to 6.6 GB


@dataclass(frozen=True, slots=True)
class TrackerOptions:
    """How to run it."""

    runs: int  # and one more if one of them ends by a fault of its own
    seconds: float | None  # only this much of the drive
    paced: bool
    limit_s: float | None  # of a run


@dataclass(frozen=True, slots=True)
class Tracked:
    """Its rows of Table I with the runs that they show, and what the second drive's sequences need: the map of ``final``."""

    rows: list[Row]
    live: Run | None = None  # of median error while driving
    final: Run | None = None  # of median error in the end
    task: RunTask | None = None  # of ``final``


def stereo_scenario(scenario: Scenario) -> Scenario:
    """The same drives seen by a stereo camera at the odometry's rate: the tracker needs frames that overlap.

    Town, tour, traffic and seed stay, and none of them knows the camera: the drive is the same to the last bit.
    """
    camera = scenario.camera.model_copy(update={**STEREO, "rate_hz": scenario.odometry_rate_hz})
    return scenario.model_copy(update={"camera": camera})


def track(scenario: Scenario, out: Path, options: TrackerOptions, pool: Workers) -> Tracked:
    """Table I's rows: runs of the tracker on the mapping drive, side by side as memory has room.

    One run more when the first of them crashes, begun while others still run: every second one does not survive the
    paper's drive. No more than one, or the whole would not end within the hour.
    """
    try:
        python = ensure_environment(out / "venv")
    except NotInstalled as error:
        return Tracked(failed_rows(f"not run: {error}"))
    drive, vocabulary = _prepared(scenario, out, options.seconds, pool)
    key = drive.folder.name.rpartition("-")[2]  # another recording, another run: nothing stale is read back
    how = f"{key}-{drive.frames}-frames{'-paced' if options.paced else ''}"
    folders = [out / scenario.name / "orb-slam3" / how / f"run-{number}" for number in range(options.runs + 1)]
    *tasks, spare = [RunTask(python, vocabulary, drive, folder, options.paced, options.limit_s) for folder in folders]
    spares = iter([spare])
    print(f"ORB-SLAM3: {options.runs} runs of {drive.frames:,} stereo pairs", flush=True)
    with process_pool(_side_by_side(options.runs, pool)) as executor:
        several = replace(pool, executor=executor)
        runs = several.run("track", run_tracker, tasks, follow=lambda run: next(spares, None) if own_fault(run) else None)
    found = rows(runs, drive)
    if any(row.failure is not None for row in found):
        return Tracked(found)
    by_name = {run.folder.name: run for run in runs}
    live, final = (by_name[median_run(row)] for row in found)
    return Tracked(found, live, final, replace(tasks[0], folder=final.folder))


def _side_by_side(runs: int, pool: Workers) -> int:
    """Runs at once: as many as the pool has processes, if memory has room for them."""
    available_bytes = 1024 * int(Path("/proc/meminfo").read_text().split("MemAvailable:")[1].split()[0])
    return max(1, min(runs, pool.processes, available_bytes // TRACKER_BYTES))


def locate(scenario: Scenario, out: Path, tracked: Tracked, pool: Workers) -> list[Located]:
    """Table II's rows: the sequences of the second drive, each in a process that loads the median run's map."""
    wanted = empty_rows()
    if tracked.task is None or tracked.final is None:
        cause = tracked.rows[-1].failure or "no map"
        return [Located(row.model_copy(update={"failure": cause})) for row in wanted]
    drive = stereo_drive(RecordingPlan(stereo_scenario(scenario), "localization", out))
    alignment = map_alignment(tracked.final, tracked.task.drive.truth())
    tasks: list[RunTask | str] = [_sequence(row, drive, tracked.task) for row in wanted]
    runs = iter(pool.run("locate", run_tracker, [task for task in tasks if isinstance(task, RunTask)]))
    found = []
    for row, task in zip(wanted, tasks, strict=True):
        if isinstance(task, RunTask):
            found.append(score_sequence(row, next(runs), task, alignment, out / scenario.name))
        else:
            found.append(Located(row.model_copy(update={"failure": task})))
    return found


def _sequence(row: SequenceRow, drive: StereoDrive, mapped: RunTask) -> RunTask | str:
    """The task, or why there is none."""
    try:
        return sequence_task(row, drive, mapped)
    except HippodromeError as error:
        return str(error)


def _prepared(scenario: Scenario, out: Path, seconds: float | None, pool: Workers) -> tuple[StereoDrive, Path]:
    """The pairs of both drives, or those of the first ``seconds`` of the mapping drive alone, and the vocabulary."""
    stereo = stereo_scenario(scenario)
    mapping, *others = [RecordingPlan(stereo, role, out) for role in (ROLES if seconds is None else ("mapping",))]
    frames = None if seconds is None else ceil(seconds * stereo.camera.rate_hz)
    if frames is not None and frames < 2:
        raise HippodromeError(f"--seconds {seconds:g}: fewer than two frames, give a longer time")
    pool.run("simulate", prepare, [mapping, *others])
    drive = stereo_drive(mapping, frames)
    words = VocabularyTask(stereo.camera, scenario.seed, out)
    tasks: list[VocabularyTask | tuple[RecordingPlan, int]] = [words, *((mapping, chunk) for chunk in missing_chunks(drive))]
    tasks += [(plan, chunk) for plan in others for chunk in missing_chunks(stereo_drive(plan))]
    pool.run("pairs", _draw, tasks)  # the vocabulary takes longest and no second process can share it: first
    return drive, words.path


def _draw(task: VocabularyTask | tuple[RecordingPlan, int]) -> None:
    if isinstance(task, VocabularyTask):
        train_vocabulary(task)
    else:
        draw_pairs(task)
