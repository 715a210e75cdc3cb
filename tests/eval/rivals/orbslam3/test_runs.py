"""A tracker's process may crash, hang or lose its way: each becomes a row that says so, and a good run becomes figures.

The processes here are stand-ins; the last test runs the real tracker where its environment has been made.
"""

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from hippodrome.core import se2
from hippodrome.core.types import HippodromeError, Trajectory
from hippodrome.eval.files.trajectories import read_tum
from hippodrome.eval.methods.method import ORBSLAM3, ORBSLAM3_FINAL, ORBSLAM3_LIVE
from hippodrome.eval.pool import worker_pool
from hippodrome.eval.results.table_two import SequenceRow
from hippodrome.eval.results.tables import failed_runs
from hippodrome.eval.rivals.orbslam3 import environment, pairs, stage, tracker
from hippodrome.eval.rivals.orbslam3.environment import NotInstalled, ensure_environment
from hippodrome.eval.rivals.orbslam3.pairs import StereoDrive
from hippodrome.eval.rivals.orbslam3.poses import body_poses, read_camera_tum, thinned
from hippodrome.eval.rivals.orbslam3.relocalize import map_alignment, score_sequence, sequence_task
from hippodrome.eval.rivals.orbslam3.rows import failed_rows, rows
from hippodrome.eval.rivals.orbslam3.tracker import CRASH, RunTask, run_tracker
from hippodrome.sim.episode import Samples
from hippodrome.sim.render.camera import CameraSpec
from hippodrome.sim.scenario import load_scenario

CAMERA = CameraSpec(width=64, height=48, stereo_baseline_m=0.5, forward_m=1.6)
FRAMES = 40

STAND_IN = """\
import json, os, sys, time
import numpy as np
job = json.load(open(sys.argv[1]))
size = job["width"] * job["height"]
times, brightness = [], []
while len(data := sys.stdin.buffer.read(8 + 2 * size)) == 8 + 2 * size:
    times.append(float(np.frombuffer(data, "<f8", 1)[0]))
    brightness.append([int(data[8]), int(data[8 + size])])
{ending}
way = [1.0 * k for k in range(len(times))]  # straight ahead: +z of the first camera, a metre a frame
lines = [f"{{t!r}} 0 0 {{w!r}} 0 0 0 1" for t, w in zip(times, way)]
open("steps.txt", "w").write("\\n".join(f"{{t!r}} 1 {{int(k >= 30)}} {{0.1 * (k + 1)}}" for k, t in enumerate(times)) + "\\n")
for name in ("live",) if job["localize"] else ("live", "final", "keyframes"):
    open(f"{{name}}.tum", "w").write("\\n".join(lines) + "\\n")
open("brightness.json", "w").write(json.dumps(brightness))
open("result.json", "w").write(json.dumps(dict(frames=len(times), tracked={tracked}, cpu_s=1.0, loading_cpu_s=0.5,
    wall_s=2.0, longest_frame_s=0.1, peak_rss_bytes=10**8, map_bytes=5 * 10**6)))
"""


def straight():
    """A drive eastwards, a metre a frame, every second step a frame."""
    steps = np.arange(2 * FRAMES)
    poses = np.column_stack([0.5 * (steps - 1) + 7.0, np.full(2 * FRAMES, 3.0), np.zeros(2 * FRAMES)])
    frame = np.where(steps % 2 == 1, steps // 2, -1).astype(np.int32)
    nothing = np.zeros(2 * FRAMES)
    lane = np.zeros(2 * FRAMES, dtype=np.int32)
    return Samples(0.05 * (steps + 1), nothing, nothing, nothing, frame, poses, nothing, lane, nothing, ("a",))


DRIVE = StereoDrive(Path("nowhere"), straight(), CAMERA, 0, FRAMES)


@pytest.fixture(autouse=True)
def frames(monkeypatch):
    """Frame ``n`` is as bright as its number, the right one is brighter by 100."""

    def read_pair(folder, number):
        return tuple(np.full((48, 64), number + brighter, dtype=np.uint8) for brighter in (0, 100))

    monkeypatch.setattr(pairs, "read_pair", read_pair)


def run(monkeypatch, folder, ending="", tracked="len(times)", **task):
    script = folder / "stand_in.py"
    folder.mkdir(parents=True, exist_ok=True)
    script.write_text(STAND_IN.format(ending=ending, tracked=tracked))
    monkeypatch.setattr(tracker, "RUNNER", script)
    return run_tracker(RunTask(Path(sys.executable), folder / "vocabulary.txt", DRIVE, folder / "run", **task))


def test_a_good_run_becomes_two_rows(monkeypatch, tmp_path):
    done = run(monkeypatch, tmp_path)
    assert done.failure is None
    assert_array_equal(json.loads((tmp_path / "run" / "brightness.json").read_text()), [[n, n + 100] for n in range(FRAMES)])
    live, final = rows([done, done, done], DRIVE)
    assert (live.method, final.method) == (ORBSLAM3_LIVE.label, ORBSLAM3_FINAL.label)
    assert live.failure is None
    assert live.cpu_percent == pytest.approx(100 * 1.0 / 4.0)
    assert (live.camera_frames, live.keyframes, live.map_bytes) == (FRAMES, FRAMES, 5_000_000)
    assert_allclose([live.ape_start.mean_m, live.rpe.mean_m], 0.0, atol=1e-9)
    assert len(live.runs) == 3


def test_a_map_begun_anew_is_counted(monkeypatch, tmp_path):
    done = run(monkeypatch, tmp_path, ending="print('New Map created with 9 points')\nprint('New Map created with 8 points')")
    assert done.maps_started == 2
    assert rows([done], DRIVE)[0].maps_started == 2


def test_a_finished_run_is_read_back_not_run_again(monkeypatch, tmp_path):
    run(monkeypatch, tmp_path)
    assert run(monkeypatch, tmp_path, ending="raise SystemExit('run again')").failure is None


@pytest.mark.parametrize(
    ("ending", "tracked", "cause"),
    [
        ("print('no such map'); sys.exit(3)", "0", "crashed: exit status 3; last words: no such map"),
        ("os.abort()", "0", "crashed: signal 6"),
        ("pass", "3", "lost: 3 of 40 frames tracked"),
        ("times.pop()", "len(times)", "39 of 40 frames"),
    ],
)
def test_what_goes_wrong_has_a_name(monkeypatch, tmp_path, ending, tracked, cause):
    done = run(monkeypatch, tmp_path, ending, tracked)
    assert cause in done.failure
    live, final = rows([done], DRIVE)
    assert cause in live.failure
    assert cause in final.failure


def test_a_crash_is_kept_as_a_result(monkeypatch, tmp_path):
    first = run(monkeypatch, tmp_path, ending="os.abort()")
    assert "crashed: signal 6" in first.failure
    assert run(monkeypatch, tmp_path).failure == first.failure
    live, final = rows([first, run(monkeypatch, tmp_path / "other")], DRIVE)
    assert (live.failure, len(live.runs)) == (None, 2)
    said = [line.partition(";")[0] for line in failed_runs([live, final])]
    assert said == ["ORB-SLAM3 (live), ORB-SLAM3 (final), run: crashed: signal 6"]
    (tmp_path / "run" / CRASH).unlink()  # what a user does who wants it tried again
    assert run(monkeypatch, tmp_path).failure is None


def test_a_tracker_that_waits_for_itself_is_ended_soon(monkeypatch, tmp_path):
    monkeypatch.setattr(tracker, "STALL_S", 1.0)
    assert run(monkeypatch, tmp_path, ending="time.sleep(60)").failure == tracker.STALLED


@pytest.mark.parametrize("ending", ["os.kill(os.getpid(), 9)", "sys.exit(3)"])
def test_want_of_memory_or_of_a_package_is_tried_again(monkeypatch, tmp_path, ending):
    assert "crashed" in run(monkeypatch, tmp_path, ending).failure
    assert run(monkeypatch, tmp_path).failure is None


def test_a_hang_is_ended(monkeypatch, tmp_path):
    assert "hung: no end after 1 s" in run(monkeypatch, tmp_path, ending="time.sleep(60)", limit_s=1.0).failure


def test_a_sequence_is_scored_where_the_saved_map_lies(monkeypatch, tmp_path):
    """The stand-in merges at frame 30; the mapped run's trajectory says where its map is: 7 m east, 3 m north."""
    mapped = run(monkeypatch, tmp_path / "mapping")
    found = run(monkeypatch, tmp_path / "sequence", loaded=mapped.folder)
    assert (tmp_path / "sequence" / "run" / "atlas.osa").is_symlink()
    assert "LoadAtlasFromFile" in (tmp_path / "sequence" / "run" / "settings.yaml").read_text()
    row = SequenceRow(method=ORBSLAM3.label, number=3, length_m=39.0)
    task = RunTask(Path(), Path(), DRIVE, found.folder)
    located = score_sequence(row, found, task, map_alignment(mapped, DRIVE.truth()), tmp_path)
    summary = located.row.localization
    assert summary.success
    assert summary.initial_frames == 31
    assert summary.initial_time_ms == pytest.approx(3100.0)
    assert summary.initial_distance_m == pytest.approx(30.0)
    assert summary.error_max_m == pytest.approx(0.0, abs=1e-9)
    poses = read_tum(tmp_path / "sequences" / "ORB-SLAM3-3.tum").poses
    assert_allclose(poses[0], [37.0, 3.0, 0.0], atol=1e-9)


def test_a_sequence_that_failed_or_does_not_fit_says_so(monkeypatch, tmp_path):
    row = SequenceRow(method=ORBSLAM3.label, number=1, length_m=500.0)
    lost = run(monkeypatch, tmp_path, tracked="3", loaded=tmp_path)
    task = RunTask(Path(), Path(), DRIVE, tmp_path)
    assert "lost" in score_sequence(row, lost, task, None, tmp_path).row.failure
    with pytest.raises(HippodromeError, match="the sequence 500 m"):
        sequence_task(row, DRIVE, task)


def test_a_sequence_takes_the_frames_of_its_steps(tmp_path):
    mapped = RunTask(Path("python"), Path("words"), DRIVE, tmp_path / "run-0", paced=True)
    task = sequence_task(SequenceRow(method=ORBSLAM3.label, number=10, length_m=10.0), DRIVE, mapped)
    assert (task.drive.first, task.drive.frames) == (29, 10)
    assert task.loaded == mapped.folder
    assert task.paced
    assert task.drive.times_s[0] == pytest.approx(DRIVE.times_s[29])


def test_some_failures_leave_a_row_of_the_others(monkeypatch, tmp_path):
    good, bad = run(monkeypatch, tmp_path / "good"), run(monkeypatch, tmp_path / "bad", ending="sys.exit(3)")
    live, _ = rows([bad, good], DRIVE)
    assert live.failure is None
    assert live.median_run == good.folder.name
    assert "crashed" in live.runs[0]["failure"]


@pytest.mark.parametrize(("signal", "begun"), [("ABRT", 3), ("KILL", 2)])
def test_one_run_more_if_the_tracker_crashes_by_itself(monkeypatch, tmp_path, signal, begun):
    python = tmp_path / "python"
    python.write_text(f"#!/bin/sh\nkill -{signal} $$\n")
    python.chmod(0o755)
    monkeypatch.setattr(stage, "ensure_environment", lambda folder: python)
    monkeypatch.setattr(stage, "_prepared", lambda *_: (StereoDrive(tmp_path, straight(), CAMERA, 0, 0), tmp_path / "words"))
    scenario = load_scenario(Path("scenarios/paper.yaml"))
    with worker_pool(2) as pool:
        tracked = stage.track(scenario, tmp_path, stage.TrackerOptions(2, None, False, None), pool)
    for row in tracked.rows:
        assert [run["run"] for run in row.runs] == [f"run-{number}" for number in range(begun)]
        assert row.failure.count("crashed: signal") == begun


@pytest.mark.parametrize(("python", "cause"), [("/bin/false", "exit status 1"), ("/no/such/python", "No such file")])
def test_a_tracker_that_cannot_be_installed_has_rows_too(monkeypatch, tmp_path, python, cause):
    monkeypatch.setattr(environment.sys, "executable", python)
    with pytest.raises(NotInstalled, match=f"virtual environment failed: .*{cause}"):
        ensure_environment(tmp_path / "venv")
    assert [row.failure for row in failed_rows("not run: why")] == ["not run: why"] * 2


def test_body_poses_by_hand():
    """The camera turns left by 90 deg while it moves 5 m ahead and 2 m to the left; y of the camera points down."""
    half = np.sqrt(0.5)
    turned = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, -half, 0.0, half]])
    assert_allclose(body_poses(np.array([[0.0, 0, 0], [-2.0, 0, 5.0]]), turned, 0.0), [[0, 0, 0], [5, 2, np.pi / 2]], atol=1e-12)


def test_the_body_is_behind_the_camera():
    rng = np.random.default_rng(0)
    body = np.column_stack([rng.normal(size=(20, 2)), rng.uniform(-3, 3, 20)])
    camera = se2.compose(body, np.array([1.6, 0.0, 0.0]))
    positions = np.column_stack([-camera[:, 1], np.zeros(20), camera[:, 0]])
    quaternions = np.column_stack([np.zeros(20), -np.sin(camera[:, 2] / 2), np.zeros(20), np.cos(camera[:, 2] / 2)])
    assert_allclose(body_poses(positions, quaternions, 1.6), body, atol=1e-12)


@pytest.mark.parametrize("text", ["", "0 1 2\n", "zero 0 0 0 0 0 0 1\n"])
def test_a_broken_trajectory_is_refused(tmp_path, text):
    path = tmp_path / "live.tum"
    path.write_text(text)
    with pytest.raises(HippodromeError, match=r"live\.tum"):
        read_camera_tum(path, 1.6)


def test_lines_repeated_for_lost_frames_are_dropped(tmp_path):
    path = tmp_path / "final.tum"
    path.write_text("0.1 0 0 0 0 0 0 1\n0.2 0 0 1 0 0 0 1\n0.2 0 0 1 0 0 0 1\n0.4 0 0 3 0 0 0 1\n")
    assert_allclose(read_camera_tum(path, 0.0).t_s, [0.1, 0.2, 0.4])


def test_thinning_keeps_a_sample_per_stretch():
    trajectory = Trajectory(np.arange(21.0), np.column_stack([np.arange(21.0), np.zeros((21, 2))]))
    assert_array_equal(thinned(trajectory, 5.0).poses[:, 0], [0, 5, 10, 15, 20])


@pytest.mark.skipif("HIPPODROME_ORBSLAM3" not in os.environ, reason="set HIPPODROME_ORBSLAM3 to the venv of `make baselines`")
def test_the_real_tracker_starts_and_reports(monkeypatch, tmp_path):
    """Frames without a corner: it loads vocabulary and settings, never initialises, and says that it is lost."""
    from hippodrome.eval.rivals.orbslam3.vocabulary import to_text, train

    rng = np.random.default_rng(0)
    descriptors = rng.integers(0, 256, (2000, 32), dtype=np.uint8)
    (tmp_path / "vocabulary.txt").write_text(to_text(train(descriptors, np.arange(2000, dtype=np.int32) // 100, rng, 10, 3)))
    python = Path(os.environ["HIPPODROME_ORBSLAM3"]) / "bin" / "python"
    camera = CameraSpec(width=320, height=240, stereo_baseline_m=0.5)
    drive = StereoDrive(Path("nowhere"), straight(), camera, 0, FRAMES)
    monkeypatch.setattr(pairs, "read_pair", lambda folder, number: (np.full((240, 320), 100, dtype=np.uint8),) * 2)
    assert "lost: 0 of 40" in run_tracker(RunTask(python, tmp_path / "vocabulary.txt", drive, tmp_path / "run")).failure
