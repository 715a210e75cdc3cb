"""Runs of ORB-SLAM3 may crash, hang or lose their way: each becomes a row that says so, and a good run becomes figures.

The tracker is a stand-in, fed by the real runner over the stream; the last test runs the real one where its environment is.
"""

import json
import os
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from hippodrome.core.types import HippodromeError, Trajectory
from hippodrome.eval.files.trajectories import read_tum
from hippodrome.eval.methods.method import ORBSLAM3, ORBSLAM3_FINAL, ORBSLAM3_LIVE
from hippodrome.eval.pool import worker_pool
from hippodrome.eval.programs import environments, pairs
from hippodrome.eval.programs.environments import NotInstalled, ensure_environment
from hippodrome.eval.programs.pairs import StereoDrive
from hippodrome.eval.results.table_two import SequenceRow
from hippodrome.eval.results.tables import failed_runs
from hippodrome.eval.rivals.orbslam3 import method
from hippodrome.eval.rivals.orbslam3.method import ENVIRONMENT, OrbSlam3
from hippodrome.eval.trials.rivals import stage
from hippodrome.eval.trials.rivals.kept import CRASH, RunTask, run_kept
from hippodrome.eval.trials.rivals.saved_map import map_alignment, score_sequence, sequence_task
from hippodrome.eval.trials.rivals.spread import Cards, rows, thinned
from hippodrome.sim.episode import Samples
from hippodrome.sim.render.camera import CameraSpec
from hippodrome.sim.scenario import load_scenario

CAMERA = CameraSpec(width=64, height=48, stereo_baseline_m=0.5, forward_m=1.6)
FRAMES = 40
CARDS = Cards(ORBSLAM3_LIVE, ORBSLAM3_FINAL)

STAND_IN = """\
import json, os, sys, time
from types import SimpleNamespace
import numpy as np

slept, time.sleep = time.sleep, lambda _: None  # it need not settle
Sensor = SimpleNamespace(STEREO=1)

class Slam:
    def __init__(self, vocabulary, settings, sensor, use_viewer):
        self.settings, self.times, self.brightness = open(settings).read(), [], []
        print("New Map created with 9 points", flush=True)

    def track_stereo(self, left, right, t_s):
        number = len(self.times)
        self.times.append(t_s)
        self.brightness.append([int(left[0, 0]), int(right[0, 0])])
        pose = np.eye(4)
        pose[2, 3] = 1.0 * number  # straight ahead: +z of the first camera, a metre a frame
        return SimpleNamespace(ok={tracked}, pose_wc=pose)

    def map_changed(self):
        return len(self.times) == 30

    def activate_localization_mode(self):
        pass

    def shutdown(self):
        {ending}
        open("brightness.json", "w").write(json.dumps(self.brightness))
        if "SaveAtlas" in self.settings:
            open("atlas.osa", "wb").write(bytes(5_000_000))

    def save_trajectory_tum(self, name):
        lines = [f"{{t!r}} 0 0 {{1.0 * k!r}} 0 0 0 1" for k, t in enumerate(self.times)]
        open(name, "w").write("\\n".join(lines) + "\\n")

    save_keyframe_trajectory_tum = save_trajectory_tum
"""


def straight():
    """A drive eastwards, a metre a frame, every second step a frame."""
    steps = np.arange(2 * FRAMES)
    poses = np.column_stack([0.5 * (steps - 1) + 7.0, np.full(2 * FRAMES, 3.0), np.zeros(2 * FRAMES)])
    frame = np.where(steps % 2 == 1, steps // 2, -1).astype(np.int32)
    nothing = np.zeros(2 * FRAMES)
    lane = np.zeros(2 * FRAMES, dtype=np.int32)
    return Samples(0.05 * (steps + 1), nothing + 0.05, nothing, nothing, frame, poses, nothing, lane, nothing, ("a",))


DRIVE = StereoDrive(Path("nowhere"), straight(), CAMERA, 0, FRAMES)


@pytest.fixture(autouse=True)
def frames(monkeypatch):
    """Frame ``n`` is as bright as its number, the right one is brighter by 100."""

    def read_pair(folder, number):
        return tuple(np.full((48, 64), number + brighter, dtype=np.uint8) for brighter in (0, 100))

    monkeypatch.setattr(pairs, "read_pair", read_pair)


def run(monkeypatch, folder, ending="pass", tracked="True", loaded=None, **config):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "pyorbslam3.py").write_text(STAND_IN.format(ending=ending, tracked=tracked))
    monkeypatch.setenv("PYTHONPATH", str(folder))
    monkeypatch.setattr(method, "ENVIRONMENT", SimpleNamespace(python=lambda: Path(sys.executable)))
    rival = OrbSlam3(OrbSlam3.Config(vocabulary=folder / "vocabulary.txt", **config))
    return run_kept(RunTask(rival, DRIVE, folder / "run", loaded=loaded))


def test_a_good_run_becomes_two_rows(monkeypatch, tmp_path):
    done = run(monkeypatch, tmp_path)
    assert done.failure is None
    assert_array_equal(json.loads((tmp_path / "run" / "brightness.json").read_text()), [[n, n + 100] for n in range(FRAMES)])
    live, final = rows(CARDS, [done, done, done], DRIVE)
    assert (live.method, final.method) == (ORBSLAM3_LIVE.label, ORBSLAM3_FINAL.label)
    assert live.failure is None
    own = json.loads((tmp_path / "run" / "own.json").read_text())
    assert live.cpu_percent == pytest.approx(100 * own["cpu_s"] / 4.0)
    assert live.peak_rss_bytes == own["peak_rss_bytes"]
    assert (live.camera_frames, live.keyframes, live.map_bytes) == (FRAMES, FRAMES, 5_000_000)
    assert_allclose([live.ape_start.mean_m, live.rpe.mean_m, final.ape_start.mean_m], 0.0, atol=1e-9)
    assert len(live.runs) == 3


def test_a_map_begun_anew_is_counted(monkeypatch, tmp_path):
    done = run(monkeypatch, tmp_path, ending="print('New Map created with 8 points')")
    assert done.figures.maps_started == 2
    assert rows(CARDS, [done], DRIVE)[0].maps_started == 2


def test_a_finished_run_is_read_back_not_run_again(monkeypatch, tmp_path):
    run(monkeypatch, tmp_path)
    assert run(monkeypatch, tmp_path, ending="raise SystemExit('run again')").failure is None


@pytest.mark.parametrize(
    ("ending", "tracked", "cause"),
    [
        ("print('no such map'); sys.stdout.flush(); os._exit(3)", "True", "exit status 3; its last words: no such map"),
        ("os.abort()", "True", "crashed: signal 6"),
        ("pass", "number < 3", "lost: 3 of 40 frames tracked"),
        ("pass", "False", "none of its answers has a pose"),
    ],
)
def test_what_goes_wrong_has_a_name(monkeypatch, tmp_path, ending, tracked, cause):
    done = run(monkeypatch, tmp_path, ending, tracked)
    assert cause in done.failure
    live, final = rows(CARDS, [done], DRIVE)
    assert cause in live.failure
    assert cause in final.failure


def test_a_crash_is_kept_as_a_result(monkeypatch, tmp_path):
    first = run(monkeypatch, tmp_path, ending="os.abort()")
    assert "crashed: signal 6" in first.failure
    assert run(monkeypatch, tmp_path).failure == first.failure
    live, final = rows(CARDS, [first, run(monkeypatch, tmp_path / "other")], DRIVE)
    assert (live.failure, len(live.runs)) == (None, 2)
    said = [line.partition(";")[0] for line in failed_runs([live, final])]
    assert said == ["ORB-SLAM3 (live), ORB-SLAM3 (final), run: crashed: signal 6 (SIGABRT)"]
    (tmp_path / "run" / CRASH).unlink()  # what a user does who wants it tried again
    assert run(monkeypatch, tmp_path).failure is None


def test_a_tracker_that_waits_for_itself_is_ended_soon(monkeypatch, tmp_path):
    monkeypatch.setattr(method, "STALL_S", 1.0)
    assert run(monkeypatch, tmp_path, ending="slept(60)").failure.partition(";")[0] == "hung: no work for 1 s"
    assert (tmp_path / "run" / CRASH).exists()


@pytest.mark.parametrize("ending", ["os.kill(os.getpid(), 9)", "os._exit(3)"])
def test_want_of_memory_or_of_a_package_is_tried_again(monkeypatch, tmp_path, ending):
    assert run(monkeypatch, tmp_path, ending).failure is not None
    assert run(monkeypatch, tmp_path).failure is None


def test_a_hang_is_ended(monkeypatch, tmp_path):
    assert "hung: no end after 2 s" in run(monkeypatch, tmp_path, ending="slept(60)", time_limit_s=2.0).failure


def test_a_sequence_is_scored_where_the_saved_map_lies(monkeypatch, tmp_path):
    """The stand-in merges at frame 30; the mapped run's trajectory says where its map is: 7 m east, 3 m north."""
    mapped = run(monkeypatch, tmp_path / "mapping")
    found = run(monkeypatch, tmp_path / "sequence", loaded=mapped.folder)
    localizing = tmp_path / "sequence" / "run" / "localizing"
    assert (localizing / "atlas.osa").is_symlink()
    assert "LoadAtlasFromFile" in (localizing / "settings.yaml").read_text()
    row = SequenceRow(method=ORBSLAM3.label, number=3, length_m=39.0)
    task = RunTask(OrbSlam3(), DRIVE, found.folder)
    located = score_sequence(row, found, task, map_alignment(mapped, DRIVE.truth()), tmp_path)
    summary = located.row.localization
    assert summary.success
    assert summary.initial_frames == 31
    assert summary.initial_time_ms == pytest.approx(1e3 * found.steps.cpu_s[30])
    assert summary.initial_distance_m == pytest.approx(30.0)
    assert summary.error_max_m == pytest.approx(0.0, abs=1e-9)
    poses = read_tum(tmp_path / "sequences" / "ORB-SLAM3-3.tum").poses
    assert_allclose(poses[0], [37.0, 3.0, 0.0], atol=1e-9)


def test_a_sequence_that_failed_or_does_not_fit_says_so(monkeypatch, tmp_path):
    row = SequenceRow(method=ORBSLAM3.label, number=1, length_m=500.0)
    failed = run(monkeypatch, tmp_path, ending="os.abort()", loaded=tmp_path)
    task = RunTask(OrbSlam3(), DRIVE, tmp_path)
    assert "signal 6" in score_sequence(row, failed, task, None, tmp_path).row.failure
    with pytest.raises(HippodromeError, match="the sequence 500 m"):
        sequence_task(row, DRIVE, task)


def test_a_sequence_takes_the_frames_of_its_steps(tmp_path):
    mapped = RunTask(OrbSlam3(), DRIVE, tmp_path / "run-0")
    task = sequence_task(SequenceRow(method=ORBSLAM3.label, number=10, length_m=10.0), DRIVE, mapped)
    assert (task.drive.first, task.drive.frames) == (29, 10)
    assert task.loaded == mapped.folder
    assert task.method is mapped.method
    assert task.drive.times_s[0] == pytest.approx(DRIVE.times_s[29])


def test_some_failures_leave_a_row_of_the_others(monkeypatch, tmp_path):
    good, bad = run(monkeypatch, tmp_path / "good"), run(monkeypatch, tmp_path / "bad", ending="os._exit(3)")
    live, _ = rows(CARDS, [bad, good], DRIVE)
    assert live.failure is None
    assert live.median_run == good.folder.name
    assert "exit status 3" in live.runs[0]["failure"]


@pytest.mark.parametrize(("signal", "begun"), [("ABRT", 3), ("KILL", 2)])
def test_one_run_more_if_the_tracker_crashes_by_itself(monkeypatch, tmp_path, signal, begun):
    cache = tmp_path / "cache"
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))  # the workers' processes make no environment: it is there
    folder = environments.environment_folder(ENVIRONMENT)
    (folder / "bin").mkdir(parents=True)
    folder.parent.chmod(0o700)
    folder.chmod(0o700)
    (folder / environments.READY).touch()
    (folder / "bin" / "python").write_text(f"#!/bin/sh\nkill -{signal} $$\n")
    (folder / "bin" / "python").chmod(0o755)
    monkeypatch.setattr(stage, "_prepared", lambda *_: (StereoDrive(tmp_path, straight(), CAMERA, 0, 0), tmp_path / "words"))
    scenario = load_scenario(Path("scenarios/paper.yaml"))
    with worker_pool(2) as pool:
        tracked = stage.track(scenario, tmp_path, stage.TrackerOptions(2, None, False, None), pool)
    for row in tracked.rows:
        assert [run["run"] for run in row.runs] == [f"run-{number}" for number in range(begun)]
        assert row.failure.count("crashed: signal") == begun


@pytest.mark.parametrize(("python", "cause"), [("/bin/false", "exit status 1"), ("/no/such/python", "No such file")])
def test_a_tracker_that_cannot_be_installed_has_rows_too(monkeypatch, tmp_path, python, cause):
    monkeypatch.setattr(environments.sys, "executable", python)
    with pytest.raises(NotInstalled, match=f"virtual environment failed: .*{cause}"):
        ensure_environment(ENVIRONMENT, tmp_path / "venv")
    assert [row.failure for row in CARDS.failed("not run: why")] == ["not run: why"] * 2


def test_thinning_keeps_a_sample_per_stretch():
    trajectory = Trajectory(np.arange(21.0), np.column_stack([np.arange(21.0), np.zeros((21, 2))]))
    assert_array_equal(thinned(trajectory, 5.0).poses[:, 0], [0, 5, 10, 15, 20])


@pytest.mark.skipif("HIPPODROME_ORBSLAM3" not in os.environ, reason="set HIPPODROME_ORBSLAM3 to the venv of `make baselines`")
def test_the_real_tracker_starts_and_reports(monkeypatch, tmp_path):
    """Frames without a corner: it loads vocabulary and settings, never initialises, and says that it is lost."""
    from hippodrome.eval.rivals.orbslam3.vocabulary import to_text, train

    rng = np.random.default_rng(0)
    descriptors = rng.integers(0, 256, (2000, 32), dtype=np.uint8)
    words = tmp_path / "vocabulary.txt"
    words.write_text(to_text(train(descriptors, np.arange(2000, dtype=np.int32) // 100, rng, 10, 3)))
    python = Path(os.environ["HIPPODROME_ORBSLAM3"]) / "bin" / "python"
    monkeypatch.setattr(method, "ENVIRONMENT", SimpleNamespace(python=lambda: python))
    camera = CameraSpec(width=320, height=240, stereo_baseline_m=0.5)
    drive = StereoDrive(Path("nowhere"), straight(), camera, 0, FRAMES)
    monkeypatch.setattr(pairs, "read_pair", lambda folder, number: (np.full((240, 320), 100, dtype=np.uint8),) * 2)
    rival = OrbSlam3(OrbSlam3.Config(vocabulary=words))
    assert "none of its answers has a pose" in run_kept(RunTask(rival, drive, tmp_path / "run")).failure
