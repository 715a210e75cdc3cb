"""What a program that reads files leaves, and how it is called: what cannot be is a sentence with what to do."""

from types import SimpleNamespace

import numpy as np
import pytest

from hippodrome.core.types import HippodromeError, Trajectory
from hippodrome.eval.programs.limits import Limits
from hippodrome.eval.programs.process import started
from hippodrome.eval.programs.program import answers_at, read_answer
from hippodrome.sim.method_spec import MethodSpec

POSE = "1 2 3 0 0 0 0 1\n"


@pytest.fixture
def left(tmp_path):
    """The folder of a program, and its process, which has ended and printed a line."""
    (tmp_path / "out").mkdir()
    (tmp_path / "log.txt").write_text("loading\ndone\n")
    return tmp_path / "out", SimpleNamespace(log=tmp_path / "log.txt")


@pytest.mark.parametrize("text", [POSE, f"# t x y z qx qy qz qw\r\n\r\n{POSE}", f"\ufeff{POSE}", POSE.replace(" ", "\t")])
def test_poses_of_any_system_are_read(left, text):
    (left[0] / "trajectory.tum").write_bytes(text.encode())
    assert read_answer(*left).poses.tolist() == [[2.0, 3.0, 0.0]]


@pytest.mark.parametrize(
    ("leave", "words"),
    [
        (lambda out: None, "left no trajectory.tum in {out}, but nothing; its last words: done"),
        (lambda out: (out / "trajectory.txt").write_text(POSE), "left no trajectory.tum in {out}, but trajectory.txt"),
        (lambda out: (out / "a\x1b[31m").write_text(POSE), "left no trajectory.tum in {out}, but a?[31m"),
        (lambda out: (out / "trajectory.tum").mkdir(), "left trajectory.tum as something else than a file"),
        (lambda out: (out / "trajectory.tum").write_text(POSE.replace(" ", ",")), "1 columns, expected 8 .*write spaces"),
        (lambda out: (out / "trajectory.tum").write_text(f"t x y z qx qy qz qw\n{POSE}"), "line 1: 't' is no number"),
        (lambda out: (out / "trajectory.tum").write_text("# nothing\n"), "trajectory.tum: no poses"),
        (lambda out: (out / "trajectory.tum").write_bytes(POSE.encode("utf-16")), "UTF-16 text; save it as UTF-8"),
        (lambda out: (out / "trajectory.tum").symlink_to("/etc/passwd"), "as a link, which is not followed"),
    ],
)
def test_what_is_no_answer_is_told(left, leave, words):
    leave(left[0])
    with pytest.raises(HippodromeError) as caught:
        read_answer(*left)
    assert all(part in str(caught.value) for part in words.split(" .*"))
    assert str(left[0]) not in str(caught.value)


def test_poses_of_another_clock_are_no_drive_that_was_never_localized():
    times_s = [0.1, 0.2, 0.3]
    found = answers_at(times_s, Trajectory(np.array([0.21]), np.array([[1.0, 2.0, 3.0]])))
    assert [one.localized for one in found] == [False, True, False]
    with pytest.raises(HippodromeError, match=r"none of its 1 poses, 2000.* has the time of an observation, 0.100 to"):
        answers_at(times_s, Trajectory(np.array([2e8]), np.zeros((1, 3))))


@pytest.mark.parametrize(
    ("command", "cure"),
    [
        ("./absent", "name it by a path, and chmod +x it"),
        ("FAST=1", "variables are set by env: env FAST=1"),
        ("~/bin/mine", "no shell reads the command: write the path out"),
        ("$HOME/mine", "no shell reads the command: write the path out"),
    ],
)
def test_a_program_that_is_not_there_is_told_with_the_cure(tmp_path, command, cure):
    limits = Limits.of(MethodSpec(command="x {sequence} {out}"))
    with pytest.raises(HippodromeError, match="there is no program") as caught, started([command], tmp_path, limits):
        pass
    assert cure in str(caught.value)


@pytest.mark.parametrize(("status", "words"), [(127, "something that it runs is not there"), (126, "chmod [+]x it")])
def test_what_a_shell_says_of_what_it_cannot_run_is_explained(tmp_path, status, words):
    limits = Limits.of(MethodSpec(command="x {sequence} {out}"))
    with (
        pytest.raises(HippodromeError, match=f"exit status {status} .*{words}.*; its last words"),
        started(["sh", "-c", f"exit {status}"], tmp_path, limits) as process,
    ):
        process.wait()
