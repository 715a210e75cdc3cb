"""One run of ORB-SLAM3 in a process of its own: frames in through a pipe, trajectories and figures back as files.

Whatever happens to the process (crash, hang, loss of tracking) becomes a ``Run`` with a failure, never an exception.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import threading
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO

import cv2
import numpy as np

from hippodrome.core.types import Frame, HippodromeError, Trajectory
from hippodrome.eval.baselines.orbslam3.poses import read_camera_tum
from hippodrome.eval.baselines.orbslam3.settings import settings_text
from hippodrome.proto.atomic import write_atomically
from hippodrome.sim.recording import Recording
from hippodrome.sim.render.camera import CameraSpec

RUNNER = Path(__file__).with_name("runner.py")
LIMIT_BASE_S, LIMIT_PER_FRAME_S = 180.0, 0.8  # it takes 0.07 s a frame on a free core; ten times that is a hang
NEW_MAP = "New Map created"  # in the log: at the start, and whenever it gave up looking for where it was
LEAST_TRACKED = 0.5  # of the frames: below, the run counts as lost


@dataclass(frozen=True, slots=True)
class StereoDrive:
    """The first ``frames`` stereo pairs of a drive; the recording itself may be unfinished beyond them."""

    recording: Recording
    camera: CameraSpec
    frames: int

    @property
    def times_s(self) -> list[float]:
        samples = self.recording.samples
        return [float(t_s) for t_s in samples.t_s[samples.frame_steps[: self.frames]]]

    @property
    def duration_s(self) -> float:
        return self.times_s[-1]

    def pairs(self) -> Iterator[bytes]:
        """Time stamp and both grey images of each frame, as the runner reads them."""
        for number, t_s in enumerate(self.times_s):
            left, right = (_grey(self.recording.frame(number, side)) for side in ("", "r"))
            yield np.float64(t_s).astype("<f8").tobytes() + left.tobytes() + right.tobytes()


@dataclass(frozen=True, slots=True)
class RunFigures:
    """What the process measured of itself, ``runner.py``."""

    frames: int
    tracked: int
    cpu_s: float  # tracking, mapping, loop closing: loading and saving excluded
    loading_cpu_s: float
    wall_s: float
    longest_frame_s: float
    peak_rss_bytes: int
    map_bytes: int | None


@dataclass(frozen=True, slots=True)
class Run:
    """A finished run, or why it is none."""

    folder: Path
    failure: str | None = None
    figures: RunFigures | None = None
    live: Trajectory | None = None  # body poses, in the frame of the first one
    final: Trajectory | None = None
    keyframes: int | None = None
    maps_started: int | None = None  # more than one: it lost its way; maps that never merged lie anywhere to each other


def run_tracker(python: Path, vocabulary: Path, drive: StereoDrive, folder: Path, paced: bool = False) -> Run:
    """The tracker over the drive; a run whose ``result.json`` is in ``folder`` already is read back instead."""
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "result.json").exists():
        write_atomically(folder / "settings.yaml", settings_text(drive.camera).encode())
        if failure := _execute(python, vocabulary, drive, folder, paced):
            return Run(folder, failure)
    try:
        run = read_run(folder, drive.camera)
    except (HippodromeError, OSError, ValueError, TypeError) as error:
        return Run(folder, f"unreadable result: {error}")
    if run.figures is not None and run.figures.frames != drive.frames:
        return Run(folder, f"{run.figures.frames} of {drive.frames} frames arrived", run.figures)
    return run


def read_run(folder: Path, camera: CameraSpec) -> Run:
    """A run from its files."""
    figures = RunFigures(**json.loads((folder / "result.json").read_text()))
    if figures.tracked < LEAST_TRACKED * figures.frames:
        return Run(folder, f"lost: {figures.tracked} of {figures.frames} frames tracked", figures)
    live, final = (read_camera_tum(folder / f"{name}.tum", camera.forward_m) for name in ("live", "final"))
    keyframes = len(read_camera_tum(folder / "keyframes.tum", camera.forward_m).t_s)
    maps_started = (folder / "log.txt").read_text(errors="replace").count(NEW_MAP)
    return Run(folder, None, figures, live, final, keyframes, maps_started)


def run_figures(run: Run) -> dict[str, object]:
    """A run in the results file: its folder's name, its failure, its figures."""
    head = {"run": run.folder.name, "failure": run.failure, "maps_started": run.maps_started}
    return {**head, **(asdict(run.figures) if run.figures else {})}


def _execute(python: Path, vocabulary: Path, drive: StereoDrive, folder: Path, paced: bool) -> str | None:
    """Start, feed and await the runner; the cause if it failed."""
    camera = drive.camera
    sizes = [str(camera.width), str(camera.height), str(int(paced))]
    command = [str(python), str(RUNNER.absolute()), str(vocabulary.absolute()), "settings.yaml", *sizes]
    limit_s = LIMIT_BASE_S + LIMIT_PER_FRAME_S * drive.frames + (drive.duration_s if paced else 0.0)
    with (folder / "log.txt").open("wb") as log:
        try:
            process = subprocess.Popen(command, cwd=folder, stdin=subprocess.PIPE, stdout=log, stderr=subprocess.STDOUT)
        except OSError as error:
            return f"cannot be started: {error}"
        feeder = threading.Thread(target=_feed, args=(process.stdin, drive), daemon=True)
        feeder.start()
        try:
            status = process.wait(limit_s)
        except subprocess.TimeoutExpired:
            return f"hung: no end after {limit_s:.0f} s"
        finally:
            process.kill()
            process.wait()
            feeder.join()
    if status == 0 and (folder / "result.json").exists():
        return None
    return f"crashed: {_ending(status)}; last words: {_last_line(folder / 'log.txt')}"


def _feed(pipe: IO[bytes] | None, drive: StereoDrive) -> None:
    """Write all frames; a reader that died ends it."""
    assert pipe is not None
    with contextlib.suppress(BrokenPipeError), pipe:
        for pair in drive.pairs():
            pipe.write(pair)


def _ending(status: int) -> str:
    return f"signal {-status}" if status < 0 else f"exit status {status}"


def _last_line(path: Path) -> str:
    lines = path.read_text(errors="replace").splitlines()
    return next((line.strip() for line in reversed(lines) if line.strip()), "none")


def _grey(frame: Frame) -> Frame:
    return np.asarray(cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
