"""Methods that are programs and read files: the drive is written into a folder, the program run, its TUM trajectory read back."""

from __future__ import annotations

import bisect
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Final

from hippodrome.core.types import HippodromeError, Observation, Trajectory
from hippodrome.eval.files.trajectories import read_tum
from hippodrome.eval.methods.protocol import Answer, Cost, Given, Localized, Mapped, MethodError
from hippodrome.eval.programs.camera_poses import read_camera_tum
from hippodrome.eval.programs.environments import words_of
from hippodrome.eval.programs.layouts import ODOMETRY, write_sequence
from hippodrome.eval.programs.limits import Limits
from hippodrome.eval.programs.process import Process, last_words, started
from hippodrome.eval.programs.references import printable
from hippodrome.sim.method_spec import MethodSpec

TRAJECTORY: Final = "trajectory.tum"  # that a program leaves in its folder {out}


class ProgramMapper:
    """A program that makes a trajectory of a folder."""

    def __init__(self, spec: MethodSpec) -> None:
        assert spec.command is not None
        self._spec, self._command = spec, spec.command

    def map(self, observations: Iterator[Observation], given: Given) -> Mapped:
        """Its trajectory of the mapping drive. Raises MethodError with the cause if there is none."""
        sequence, out = given.folder / "sequence", given.folder / "out"
        write_sequence(observations, given, self._spec.input, sequence)
        process = run_program(self._spec, words_of(self._spec, self._command, sequence=sequence, out=out), out, given)
        return Mapped(self._answer(out, process, given), state=out, cost=Cost(process.cpu_s, process.peak_rss_bytes))

    def _answer(self, out: Path, process: Process, given: Given) -> Trajectory:
        """The trajectory that it left, as poses of the rear axle."""
        return read_answer(out, process, given.camera.forward_m if self._spec.axes == "camera" else None)


class ProgramLocalizer(ProgramMapper):
    """A program that can find a second drive in what it left of the first one."""

    def localize(self, observations: Iterator[Observation], given: Given) -> Localized:
        """Its poses of the second drive: localized where it has one, unknown elsewhere."""
        assert self._spec.localize is not None
        assert given.mapped is not None
        sequence, out = given.folder / "second-sequence", given.folder / "second-out"
        times_s = write_sequence(observations, given, self._spec.input, sequence)
        words = words_of(self._spec, self._spec.localize, sequence=sequence, out=out, map=given.mapped.state)
        process = run_program(self._spec, words, out, given)
        cost = Cost(process.cpu_s, process.peak_rss_bytes)
        return Localized(answers_at(times_s, self._answer(out, process, given)), cost)


def run_program(spec: MethodSpec, words: list[str], out: Path, given: Given) -> Process:
    """Run a program to its end. Raises MethodError if it did not end well."""
    out.mkdir(parents=True, exist_ok=True)
    with started(words, given.folder, Limits.of(spec), given.concealed) as process:
        process.wait()
    return process


def read_answer(out: Path, process: Process, camera_ahead_m: float | None = None) -> Trajectory:
    """The trajectory that a program left. Raises MethodError that names the file as the program knows it.

    Args:
        out: Its folder.
        process: Its process, which has ended.
        camera_ahead_m: How far ahead of the rear axle the camera sits whose poses it left; None: it left the axle's.
    """
    path = out / TRAJECTORY
    if path.resolve() != out.parent.resolve() / out.name / TRAJECTORY:
        raise MethodError(f"it left {TRAJECTORY} as a link, which is not followed: what it leads to need not be its own")
    if path.exists() and not path.is_file():
        raise MethodError(f"it left {TRAJECTORY} as something else than a file; a file of lines t x y z qx qy qz qw is expected")
    if not path.is_file():
        left = ", ".join(sorted(entry.name for entry in out.iterdir())[:5] if out.is_dir() else ()) or "nothing"
        words = f"it ended with status 0 and left no {TRAJECTORY} in {{out}}, but {printable(left)}"
        raise MethodError(f"{words}; its last words: {last_words(process.log)}")
    try:
        return read_tum(path) if camera_ahead_m is None else read_camera_tum(path, camera_ahead_m)
    except HippodromeError as error:
        raise MethodError(str(error).replace(f"{out}/", "")) from None


def answers_at(times_s: list[float], declared: Trajectory) -> list[Answer]:
    """One answer per observation: the declared pose nearest to its time within half a step, or else not localized.

    Raises MethodError if no pose has the time of an observation: its clock is another one, and it may well have been localized.
    """
    step_s = min((later - sooner for sooner, later in pairwise(times_s)), default=0.1)
    known_s, answers = declared.t_s.tolist(), []
    pose = declared.poses[0]
    for t_s in times_s:
        after = bisect.bisect_left(known_s, t_s)
        nearest = min((i for i in (after - 1, after) if 0 <= i < len(known_s)), key=lambda i: abs(known_s[i] - t_s))
        localized = abs(known_s[nearest] - t_s) <= step_s / 2.0
        if localized:
            pose = declared.poses[nearest]
        answers.append(Answer(t_s, float(pose[0]), float(pose[1]), float(pose[2]), localized))
    if not any(answer.localized for answer in answers):
        span, wanted = f"{known_s[0]:.3f} to {known_s[-1]:.3f} s", f"{times_s[0]:.3f} to {times_s[-1]:.3f} s"
        raise MethodError(
            f"none of its {len(known_s)} poses, {span}, has the time of an observation, {wanted}; times are those of {ODOMETRY}"
        )
    return answers
