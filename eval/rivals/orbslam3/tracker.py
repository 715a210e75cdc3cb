"""One run of ORB-SLAM3 in a process of its own: frames in through a pipe, trajectories and figures back as files.

A process that crashes, hangs or loses tracking becomes a ``Run`` with a failure, never an exception.
"""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import signal
import subprocess
import threading
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import IO

import numpy as np

from hippodrome._files import write_atomically
from hippodrome._processes import dying_with_me
from hippodrome.core.types import FloatArray, HippodromeError, Trajectory
from hippodrome.eval.rivals.orbslam3.pairs import StereoDrive
from hippodrome.eval.rivals.orbslam3.poses import read_camera_tum
from hippodrome.eval.rivals.orbslam3.settings import ATLAS, settings_text

RUNNER = Path(__file__).with_name("runner.py")
# Time that a run may take: so much, and so much per frame. A frame takes 0.07 s on a free core, so ten times that is a hang.
LIMIT_BASE_S, LIMIT_PER_FRAME_S = 300.0, 0.8
# File in a run's folder that says why the tracker did not end. The next call does not try such a run again: a crash is a result.
CRASH = "crash.txt"
# Signals by which the tracker ends through a fault of its own. Not SIGKILL, by which the system ends it for want of memory.
OWN_FAULTS = {signal.SIGABRT, signal.SIGSEGV, signal.SIGFPE, signal.SIGBUS, signal.SIGILL}
NEW_MAP = "New Map created"  # line of the log: at the start, and whenever it gave up looking for where it was
# A process that uses less than this share of a core over this time has stalled: its threads wait for one another, as happens now
# and then late in a long drive.
STALL_S, LEAST_WORK = 120.0, 0.02
STALLED = f"hung: no work for {STALL_S:.0f} s"
LEAST_TRACKED = 0.5  # share of the frames; a run that tracked fewer counts as lost


@dataclass(frozen=True, slots=True)
class RunTask:
    """What to run, and where: a drive to map, or one to localize in the map of a finished run."""

    python: Path  # of the tracker's environment
    vocabulary: Path
    drive: StereoDrive
    folder: Path  # what the run leaves goes here
    paced: bool = False  # feed frames at the camera's rate, not as fast as they are taken
    limit_s: float | None = None  # time that the run may take; None: by the number of frames
    loaded: Path | None = None  # folder of the run whose map is loaded; None: map


@dataclass(frozen=True, slots=True)
class RunFigures:
    """What the process measured of itself, in ``runner.py``."""

    frames: int
    tracked: int  # frames
    cpu_s: float  # of tracking, mapping and loop closing; loading and saving are not counted
    loading_cpu_s: float
    wall_s: float
    longest_frame_s: float
    peak_rss_bytes: int
    map_bytes: int | None


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """What became of each of N frames."""

    t_s: FloatArray  # (N,)
    in_map: FloatArray  # (N,) 1.0 where it was tracked in the loaded map
    cpu_s: FloatArray  # (N,) CPU time of the process up to and including the frame


@dataclass(frozen=True, slots=True)
class Run:
    """A finished run, or why it did not end well."""

    folder: Path
    failure: str | None = None
    figures: RunFigures | None = None
    live: Trajectory | None = None  # body poses as they were reported, in the frame of the first one or of the loaded map
    final: Trajectory | None = None  # body poses after all optimisation; None for a run that localized
    keyframes: int | None = None
    # Maps that it began. It begins another one after it lost its way; maps that never merge have no common frame.
    maps_started: int | None = None
    steps: Steps | None = None


def run_tracker(task: RunTask) -> Run:
    """Run the tracker over a drive; a run that has ended already, well or by a crash, is read back from its folder."""
    folder, drive = task.folder, task.drive
    folder.mkdir(parents=True, exist_ok=True)
    if (folder / CRASH).exists():
        return Run(folder, (folder / CRASH).read_text(errors="replace"))
    if not (folder / "result.json").exists():
        write_atomically(folder / "settings.yaml", settings_text(drive.camera, task.loaded is not None).encode())
        if failure := _execute(task):
            return Run(folder, failure)
    try:
        run = read_run(folder, drive.camera.forward_m, mapped=task.loaded is None)
    except (HippodromeError, OSError, ValueError, TypeError) as error:
        return Run(folder, f"unreadable result: {error}")
    if run.figures is not None and run.figures.frames != drive.frames:
        return Run(folder, f"{run.figures.frames} of {drive.frames} frames arrived", run.figures)
    return run


def own_fault(run: Run) -> bool:
    """Whether the tracker crashed or stalled, so that another run may end well."""
    return (run.folder / CRASH).exists()


def read_run(folder: Path, forward_m: float, mapped: bool = True) -> Run:
    """A run from the files in its folder.

    Args:
        folder: The run's folder.
        forward_m: How far ahead of the body the camera sits.
        mapped: Whether the run made a map; one that localized has no final trajectory and no keyframes.

    Raises:
        HippodromeError, OSError, ValueError, TypeError: A file is missing or is not what it should be.
    """
    figures = RunFigures(**json.loads((folder / "result.json").read_text()))
    if figures.tracked < LEAST_TRACKED * figures.frames:
        return Run(folder, f"lost: {figures.tracked} of {figures.frames} frames tracked", figures)
    live = read_camera_tum(folder / "live.tum", forward_m)
    maps_started = (folder / "log.txt").read_text(errors="replace").count(NEW_MAP)
    t_s, tracked, in_map, cpu_s = np.loadtxt(folder / "steps.txt", ndmin=2).T
    run = Run(folder, None, figures, live, maps_started=maps_started, steps=Steps(t_s, tracked * in_map, cpu_s))
    if not mapped:
        return run
    keyframes = len(read_camera_tum(folder / "keyframes.tum", forward_m).t_s)
    return replace(run, final=read_camera_tum(folder / "final.tum", forward_m), keyframes=keyframes)


def run_figures(run: Run) -> dict[str, object]:
    """The entry of a run in the results file: its folder's name, its failure, its figures."""
    head = {"run": run.folder.name, "failure": run.failure, "maps_started": run.maps_started}
    return {**head, **(asdict(run.figures) if run.figures else {})}


def _execute(task: RunTask) -> str | None:
    """Start ``runner.py``, feed it and wait for its end; returns why it failed, if it did."""
    _write_job(task)
    command = [str(task.python), str(RUNNER.absolute()), "job.json"]
    paced_s = task.drive.duration_s if task.paced else 0.0
    limit_s = task.limit_s or LIMIT_BASE_S + LIMIT_PER_FRAME_S * task.drive.frames + paced_s
    log_path = task.folder / "log.txt"
    with log_path.open("wb") as log:
        try:
            process = subprocess.Popen(
                command,
                cwd=task.folder,
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=subprocess.STDOUT,
                preexec_fn=dying_with_me(),
            )
        except OSError as error:
            return f"cannot be started: {error}"
        feeder = threading.Thread(target=_feed, args=(process.stdin, task.drive), daemon=True)
        feeder.start()
        try:
            ended = _ended(process, limit_s)
        finally:
            process.kill()
            process.wait()
            feeder.join()
    if ended == 0 and (task.folder / "result.json").exists():
        return None
    if isinstance(ended, str):
        failure, own = ended, ended == STALLED
    else:
        failure, own = f"crashed: {_ending(ended)}; last words: {_last_line(log_path)}", -ended in OWN_FAULTS
    if own:
        write_atomically(task.folder / CRASH, failure.encode())
    return failure


def _ended(process: subprocess.Popen[bytes], limit_s: float) -> int | str:
    """The process's exit status, or why it is not waited for any longer."""
    command, end_s = multiprocessing.parent_process(), time.monotonic() + limit_s
    marked_cpu_s, marked_s = 0.0, time.monotonic()
    while (now_s := time.monotonic()) < end_s:
        if command is not None and not command.is_alive():
            return "the command that it worked for is gone"
        with contextlib.suppress(subprocess.TimeoutExpired):
            return process.wait(min(1.0, limit_s))
        if now_s - marked_s > STALL_S:
            cpu_s = _cpu_s(process.pid)
            if cpu_s - marked_cpu_s < LEAST_WORK * STALL_S:
                return STALLED
            marked_cpu_s, marked_s = cpu_s, now_s
    return f"hung: no end after {limit_s:.0f} s"


def _cpu_s(pid: int) -> float:
    """User and system time of a process so far; 0 if it is gone."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _write_job(task: RunTask) -> None:
    """Write what the runner reads, and a link to the map that it loads, as the tracker takes names without a folder only."""
    job = {
        "vocabulary": str(task.vocabulary.absolute()),
        "settings": "settings.yaml",
        "width": task.drive.camera.width,
        "height": task.drive.camera.height,
        "paced": task.paced,
        "localize": task.loaded is not None,
    }
    write_atomically(task.folder / "job.json", json.dumps(job, indent=1).encode())
    if task.loaded is not None:
        link = task.folder / f"{ATLAS}.osa"
        link.unlink(missing_ok=True)
        link.symlink_to((task.loaded / f"{ATLAS}.osa").absolute())


def _feed(pipe: IO[bytes] | None, drive: StereoDrive) -> None:
    """Write all frames to the runner's standard input, until the end or until the runner is gone."""
    assert pipe is not None
    with contextlib.suppress(BrokenPipeError), pipe:
        for pair in drive.pairs():
            pipe.write(pair)


def _ending(status: int) -> str:
    return f"signal {-status}" if status < 0 else f"exit status {status}"


def _last_line(path: Path) -> str:
    lines = path.read_text(errors="replace").splitlines()
    return next((line.strip() for line in reversed(lines) if line.strip()), "none")
