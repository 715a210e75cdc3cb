"""A method that needs drives of its own and several runs: stereo pairs, mapping runs, sequences in the median run's map."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil
from pathlib import Path
from typing import Final

from hippodrome.core.types import HippodromeError
from hippodrome.eval.methods.method import ORBSLAM3_FINAL, ORBSLAM3_LIVE
from hippodrome.eval.methods.protocol import MethodError, Needs
from hippodrome.eval.pool import Workers, process_pool
from hippodrome.eval.programs.pairs import StereoDrive, draw_pairs, missing_chunks, stereo_drive
from hippodrome.eval.results.model import Row
from hippodrome.eval.results.table_two import LocalizedSequence, SequenceRow, failed_sequence
from hippodrome.eval.rivals.orbslam3.method import OrbSlam3
from hippodrome.eval.rivals.orbslam3.training import VocabularyTask, train_vocabulary
from hippodrome.eval.trials.rivals.kept import Run, RunTask, own_fault, run_kept
from hippodrome.eval.trials.rivals.saved_map import empty_rows, map_alignment, score_sequence, sequence_task
from hippodrome.eval.trials.rivals.spread import Cards, median_run, rows
from hippodrome.sim.record import ROLES, RecordingPlan, prepare
from hippodrome.sim.scenario import Scenario

RIVAL: Final = OrbSlam3
CARDS: Final = Cards(ORBSLAM3_LIVE, ORBSLAM3_FINAL)
BASELINE_M: Final = 0.5  # of stereo pairs: about that of the published car data sets


@dataclass(frozen=True, slots=True)
class TrackerOptions:
    """How to run it."""

    runs: int  # how many; one more is begun if one of them crashes or stalls
    seconds: float | None  # only the first seconds of the drive; None: all of it
    paced: bool  # feed frames at the camera's rate, not as fast as they are taken
    limit_s: float | None  # time that a run may take; None: by its number of frames


@dataclass(frozen=True, slots=True)
class Tracked:
    """Its rows of Table I and the runs that they show; None where it never ended well."""

    rows: list[Row]
    live: Run | None = None  # the run of median error of the poses as they were reported
    final: Run | None = None  # the run of median error of the poses in the end; the second drive is localized in its map
    task: RunTask | None = None  # what ``final`` was asked for


def seen_as_needed(scenario: Scenario, needs: Needs) -> Scenario:
    """The same drives seen by the camera that a method needs, at the odometry's rate: trackers need frames that overlap.

    Town, tour, traffic and seed do not depend on the camera, so the drive is the same to the last bit. Without supersampling:
    drawing at twice the size takes twice the time and gained ORB-SLAM3 less than two runs of it differ by.
    """
    width, height = needs.size_px or (scenario.camera.width, scenario.camera.height)
    baseline_m = BASELINE_M if needs.stereo else None
    seen = {"width": width, "height": height, "stereo_baseline_m": baseline_m, "grain": needs.grain, "supersample": 1}
    return scenario.model_copy(
        update={"camera": scenario.camera.model_copy(update={**seen, "rate_hz": scenario.odometry_rate_hz})}
    )


def track(scenario: Scenario, out: Path, options: TrackerOptions, pool: Workers) -> Tracked:
    """Run the tracker on the mapping drive several times, side by side as far as memory has room, for the rows of Table I.

    Every second run does not survive the paper's drive. So when a run crashes, one more is begun while the others still run; no
    more than one, or the whole would take longer than an hour.

    Args:
        scenario: Whose drive; its camera is replaced by a stereo camera.
        out: Folder below which recordings and runs live. What is finished there is read back.
        options: How to run it.
        pool: Processes that draw the stereo pairs, and the progress display.
    """
    try:
        RIVAL.install()
    except MethodError as error:
        return Tracked(CARDS.failed(f"not run: {error}"))
    drive, vocabulary = _prepared(scenario, out, options.seconds, pool)
    key = drive.folder.name.rpartition("-")[2]  # another recording, another run: nothing stale is read back
    how = f"{key}-{drive.frames}-frames{'-paced' if options.paced else ''}"
    folders = [out / scenario.name / "orb-slam3" / how / f"run-{number}" for number in range(options.runs + 1)]
    method = RIVAL(RIVAL.Config(vocabulary=vocabulary, paced=options.paced, time_limit_s=options.limit_s))
    *tasks, spare = [RunTask(method, drive, folder, scenario.seed) for folder in folders]
    spares = iter([spare])
    print(f"{RIVAL.label}: {options.runs} runs of {drive.frames:,} stereo pairs", flush=True)
    with process_pool(_side_by_side(options.runs, pool)) as executor:
        several = replace(pool, executor=executor)
        runs = several.run("track", run_kept, tasks, follow=lambda run: next(spares, None) if own_fault(run) else None)
    found = rows(CARDS, runs, drive)
    if any(row.failure is not None for row in found):
        return Tracked(found)
    by_name = {run.folder.name: run for run in runs}
    live, final = (by_name[median_run(row)] for row in found)
    return Tracked(found, live, final, replace(tasks[0], folder=final.folder))


def _side_by_side(runs: int, pool: Workers) -> int:
    """How many runs at once: as many as the pool has processes, as far as memory has room for them."""
    available_bytes = 1024 * int(Path("/proc/meminfo").read_text().split("MemAvailable:")[1].split()[0])
    return max(1, min(runs, pool.processes, available_bytes // RIVAL.takes_bytes))


def locate(scenario: Scenario, out: Path, tracked: Tracked, pool: Workers) -> list[LocalizedSequence]:
    """Track the sequences of the second drive for the rows of Table II, each in a process that loads the median run's map.

    Args:
        scenario: As for ``track``.
        out: As for ``track``.
        tracked: What ``track`` returned. Without a map, all sequences fail.
        pool: Processes that run the tracker.
    """
    wanted = empty_rows(RIVAL.card)
    if tracked.task is None or tracked.final is None:
        cause = tracked.rows[-1].failure or "no map"
        return [failed_sequence(row, cause) for row in wanted]
    drive = stereo_drive(RecordingPlan(seen_as_needed(scenario, RIVAL.needs), "localization", out))
    alignment = map_alignment(tracked.final, tracked.task.drive.truth())
    tasks: list[RunTask | str] = [_sequence(row, drive, tracked.task) for row in wanted]
    runs = iter(pool.run("locate", run_kept, [task for task in tasks if isinstance(task, RunTask)]))
    found = []
    for row, task in zip(wanted, tasks, strict=True):
        if isinstance(task, RunTask):
            found.append(score_sequence(row, next(runs), task, alignment, out / scenario.name))
        else:
            found.append(failed_sequence(row, task))
    return found


def _sequence(row: SequenceRow, drive: StereoDrive, mapped: RunTask) -> RunTask | str:
    """The task of one sequence, or why there is none."""
    try:
        return sequence_task(row, drive, mapped)
    except HippodromeError as error:
        return str(error)


def _prepared(scenario: Scenario, out: Path, seconds: float | None, pool: Workers) -> tuple[StereoDrive, Path]:
    """The pairs of both drives, or those of the first ``seconds`` of the mapping drive alone, and the vocabulary."""
    stereo = seen_as_needed(scenario, RIVAL.needs)
    mapping, *others = [RecordingPlan(stereo, role, out) for role in (ROLES if seconds is None else ("mapping",))]
    frames = None if seconds is None else ceil(seconds * stereo.camera.rate_hz)
    if frames is not None and frames < 2:
        raise HippodromeError(f"--seconds {seconds:g}: fewer than two frames, give a longer time")
    pool.run("simulate", prepare, [mapping, *others], place=lambda plan: plan.scenario.name)
    drive = stereo_drive(mapping, frames)
    words = VocabularyTask(stereo.camera, scenario.seed, out)
    tasks: list[VocabularyTask | tuple[RecordingPlan, int]] = [words, *((mapping, chunk) for chunk in missing_chunks(drive))]
    tasks += [(plan, chunk) for plan in others for chunk in missing_chunks(stereo_drive(plan))]
    pool.run("pairs", _draw, tasks)  # the vocabulary comes first: it takes longest, and a single process makes it
    return drive, words.path


def _draw(task: VocabularyTask | tuple[RecordingPlan, int]) -> None:
    if isinstance(task, VocabularyTask):
        train_vocabulary(task)
    else:
        draw_pairs(task)
