"""One run of a method over a drive, kept in a folder: a run that has ended, well or by a crash, is read back and not run again.

A run that crashes, hangs or loses its way becomes a ``Run`` with a failure, never an exception.
"""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np

from hippodrome._files import read_bounded, write_atomically
from hippodrome._json import parse_json
from hippodrome.core.types import FloatArray, HippodromeError, Trajectory
from hippodrome.eval.contest.calls import estimates_of
from hippodrome.eval.files.trajectories import read_tum, write_tum
from hippodrome.eval.methods.protocol import Cost, Given, Localizes, Mapped, Maps
from hippodrome.eval.programs.pairs import StereoDrive
from hippodrome.eval.programs.process import ProgramEnded
from hippodrome.eval.results.model import MAX_BYTES

# Files in a run's folder. The first says why the method did not end; the next call does not try again: a crash is a result.
CRASH, FIGURES, LIVE, FINAL, STEPS = "crash.txt", "result.json", "live.tum", "map.tum", "steps.txt"
LEAST_TRACKED: Final = 0.5  # share of the frames; a run that has poses for fewer counts as lost


class Rival(Maps, Localizes, Protocol):
    """A method that maps a drive and localizes another one in its map."""


@dataclass(frozen=True, slots=True)
class RunTask:
    """What to run, and where: a drive to map, or one to localize in the map of a finished run."""

    method: Rival
    drive: StereoDrive
    folder: Path  # what the run leaves goes here
    seed: int = 0
    loaded: Path | None = None  # folder of the run whose map is loaded; None: map


@dataclass(frozen=True, slots=True)
class RunFigures:
    """What a run took and came to."""

    frames: int
    tracked: int  # frames for which it had a pose on the way; localizing, one that it stands by
    cpu_s: float  # loading is not counted
    loading_cpu_s: float
    wall_s: float
    longest_frame_s: float
    peak_rss_bytes: int | None
    map_bytes: int | None
    keyframes: int | None = None
    maps_started: int | None = None  # it begins another one after it lost its way; maps that never merge have no common frame


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """What became of each of N frames."""

    t_s: FloatArray  # (N,)
    known: FloatArray  # (N,) 1.0 where it had a pose; localizing, one that it stands by
    cpu_s: FloatArray  # (N,) CPU time up to and including the frame, without loading


@dataclass(frozen=True, slots=True)
class Run:
    """A finished run, or why it did not end well."""

    folder: Path
    failure: str | None = None
    figures: RunFigures | None = None
    live: Trajectory | None = None  # poses as they were answered; localizing, one for every frame, in the loaded map's frame
    final: Trajectory | None = None  # poses after all corrections; None for a run that localized
    steps: Steps | None = None


def run_kept(task: RunTask) -> Run:
    """Carry a run out, or read it back from its folder."""
    folder = task.folder
    folder.mkdir(parents=True, exist_ok=True)
    if (folder / CRASH).exists():
        return Run(folder, (folder / CRASH).read_text(errors="replace"))
    if not (folder / FIGURES).exists():
        try:
            _carry_out(task)
        except HippodromeError as error:
            if isinstance(error, ProgramEnded) and error.own_fault:
                write_atomically(folder / CRASH, str(error).encode())
            return Run(folder, str(error))
    try:
        return read_run(folder, mapped=task.loaded is None)
    except (HippodromeError, OSError, ValueError, TypeError) as error:
        return Run(folder, f"unreadable result: {error}")


def own_fault(run: Run) -> bool:
    """Whether the run ended through a fault of the method itself, which another run need not have."""
    return (run.folder / CRASH).exists()


def read_run(folder: Path, *, mapped: bool) -> Run:
    """A run that ended well, from its files.

    Args:
        folder: Where they are.
        mapped: Whether the run made a map; one that localized has no final trajectory.

    Raises:
        HippodromeError, OSError, ValueError, TypeError: A file is missing or is not what it should be.
    """
    figures = RunFigures(**parse_json(read_bounded(folder / FIGURES, MAX_BYTES)))
    if mapped and figures.tracked < LEAST_TRACKED * figures.frames:
        return Run(folder, f"lost: {figures.tracked} of {figures.frames} frames tracked", figures)
    run = Run(folder, None, figures, read_tum(folder / LIVE), steps=Steps(*np.loadtxt(folder / STEPS, ndmin=2).T))
    return replace(run, final=read_tum(folder / FINAL)) if mapped else run


def run_figures(run: Run) -> dict[str, object]:
    """The entry of a run in the results file: its folder's name, its failure, its figures."""
    return {"run": run.folder.name, "failure": run.failure, **(asdict(run.figures) if run.figures else {"maps_started": None})}


def _carry_out(task: RunTask) -> None:
    """Run the method and write what it came to; the figures last. Raises HippodromeError."""
    drive, folder = task.drive, task.folder
    given = Given(drive.camera, drive.camera.rate_hz, drive.duration_s, task.seed, folder)
    began_s = time.monotonic()
    if task.loaded is None:
        mapped = task.method.map(drive.observations(), given)
        assert isinstance(mapped, Mapped)
        live, cost = mapped.live or mapped.trajectory, mapped.cost
        known = np.isin(np.round(drive.times_s, 6), np.round(live.t_s, 6))
        write_tum(folder / FINAL, mapped.trajectory)
        figures: dict[str, Any] = {**mapped.figures, "map_bytes": mapped.save(folder) if mapped.save else None}
    else:
        nowhere = Trajectory(np.zeros(1), np.zeros((1, 3)))
        given = replace(given, mapped=Mapped(nowhere, state=task.loaded))
        estimates, cost = estimates_of("it", task.method.localize(drive.observations(), given))
        live = Trajectory(np.array(drive.times_s), np.stack([estimate.pose for estimate in estimates]))
        known, figures = np.array([estimate.localized for estimate in estimates]), {"map_bytes": None}
    assert cost is not None
    write_tum(folder / LIVE, live)
    _write_figures(task, known, cost, time.monotonic() - began_s, figures)


def _write_figures(task: RunTask, known: Any, cost: Cost, wall_s: float, more: dict[str, Any]) -> None:
    """What became of each frame, and the figures of the run."""
    times_s, frames = task.drive.times_s, len(known)
    step_cpu_s = cost.step_cpu_s if cost.step_cpu_s is not None else np.full(frames, cost.cpu_s / frames)
    rows = zip(times_s, known, np.cumsum(step_cpu_s), strict=True)
    lines = [f"{t_s!r} {int(one)} {cpu_s:.6f}" for t_s, one, cpu_s in rows]
    write_atomically(task.folder / STEPS, ("\n".join(lines) + "\n").encode())
    figures = RunFigures(
        frames=frames,
        tracked=int(known.sum()),
        cpu_s=cost.cpu_s,
        loading_cpu_s=cost.loading_cpu_s,
        wall_s=wall_s,
        longest_frame_s=0.0 if cost.step_s is None else float(cost.step_s.max()),
        peak_rss_bytes=cost.peak_rss_bytes,
        **more,
    )
    write_atomically(task.folder / FIGURES, (json.dumps(asdict(figures), indent=1) + "\n").encode())
