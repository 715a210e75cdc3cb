"""Foreign drives become recordings: what we exported comes back as it was, what is hostile is refused in one line."""

import json
import shutil

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hippodrome.core import se2
from hippodrome.core.types import Trajectory
from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import BAD_INPUT, DONE
from hippodrome.eval.exchange.drives.exported import truth_of
from hippodrome.eval.exchange.drives.foreign import Motion, motion_of, truth_at
from hippodrome.eval.exchange.drives.steps import steps_of
from hippodrome.eval.exchange.readers.spool import Spool
from hippodrome.eval.files.trajectories import read_tum, write_tum
from hippodrome.sim.recording import open_recording
from tests.eval.exchange.results import imported

SOURCES = {
    "tum": "hamlet-mapping",
    "euroc": "hamlet-mapping",
    "kitti": "sequences/00",
    "mcap": "hamlet-mapping.mcap",
    "rosbag": "hamlet-mapping",
}


@pytest.mark.parametrize("kind", SOURCES)
def test_our_export_comes_back(run, exported, tmp_path, kind):
    if kind in ("mcap", "rosbag"):
        pytest.importorskip("mcap")
    assert (
        imported(
            exported("rosbag2" if kind == "rosbag" else kind) / SOURCES[kind], kind, tmp_path / "in", "--truth-frame", "network"
        )
        == DONE
    )
    back, ours = open_recording(tmp_path / "in"), run.mapping
    assert back.frame_count == ours.frame_count
    assert all(np.array_equal(back.frame(i), ours.frame(i)) for i in range(30))
    for name in ("t_s", "dt_s", "speed", "yaw_rate_radps", "frame"):
        assert np.allclose(getattr(back.samples, name), getattr(ours.samples, name), rtol=0.0, atol=1e-9), name
    offset = [1.5, 0.0, 0.0] if kind == "kitti" else [0.0, 0.0, 0.0]  # KITTI's truth is the camera's
    known = ours.samples.frame_steps if kind == "kitti" else np.arange(len(ours.samples.t_s))
    expected = se2.compose(ours.samples.poses_m[known], np.array(offset))
    assert np.abs(back.samples.poses_m[known] - expected).max() < 1e-9
    assert back.manifest["truth_frame"] == "network"


def test_poses_of_a_camera_are_moved_to_the_rear_axle(run, exported, tmp_path, capsys):
    source, options = exported("kitti") / SOURCES["kitti"], ("--truth-frame", "network", "--camera-ahead", "1.5")
    assert imported(source, "kitti", tmp_path / "in", *options) == DONE
    assert "1.5 ahead of the rear axle" in capsys.readouterr().out
    back, ours = open_recording(tmp_path / "in"), run.mapping
    known = ours.samples.frame_steps
    assert np.abs(back.samples.poses_m[known] - ours.samples.poses_m[known]).max() < 1e-9
    assert back.manifest["imported"]["truth_ahead"] == 1.5


def smooth_drive(seed, count=200):
    rng = np.random.default_rng(seed)
    turn = np.repeat(rng.normal(0.0, 0.3, 20), count // 20)
    motion = Motion(0.1 * np.arange(1, count + 1), rng.uniform(1.0, 9.0) * np.ones(count), turn)
    arc, angle = 0.1 * motion.speed, 0.1 * turn
    chord = arc * np.sinc(angle / 2.0 / np.pi)
    steps = np.column_stack([chord * np.cos(angle / 2.0), chord * np.sin(angle / 2.0), angle])
    poses = se2.integrate(np.array([5.0, -7.0, 1.0]), np.concatenate([np.zeros((1, 3)), steps]))
    return motion, Trajectory(np.concatenate([[0.0], motion.t_s]), poses)


@given(seed=st.integers(0, 2**32 - 1), backwards=st.booleans())
@settings(max_examples=30, deadline=None)
def test_differentiated_poses_are_the_motion_that_made_them(seed, backwards):
    motion, driven = smooth_drive(seed)
    poses = driven.poses.copy()
    if backwards:
        poses[:, 2] = se2.wrap(poses[:, 2] + np.pi)
    found = motion_of(Trajectory(driven.t_s, poses), "test")
    assert np.allclose(found.speed, -motion.speed if backwards else motion.speed, atol=1e-9)
    assert np.allclose(found.yaw_rate_radps, motion.yaw_rate_radps, atol=1e-9)


@given(seed=st.integers(0, 2**32 - 1), rate_hz=st.sampled_from([3.0, 10.0, 17.0]))
@settings(max_examples=30, deadline=None)
def test_frames_at_any_time_leave_distance_and_turn_as_they_were(seed, rate_hz):
    motion, _ = smooth_drive(seed)
    t_s = np.arange(0.05, 20.0, 1.0 / rate_hz)
    frames = [type("F", (), {"t_s": float(t)}) for t in t_s]
    samples = steps_of(frames, motion, None)
    assert np.allclose(samples.t_s[samples.frame_steps], t_s, atol=1e-4)
    assert (samples.dt_s > 0.0).all()
    assert (samples.dt_s * samples.speed).sum() == pytest.approx(0.1 * motion.speed.sum())
    assert (samples.dt_s * samples.yaw_rate_radps).sum() == pytest.approx(0.1 * motion.yaw_rate_radps.sum())
    assert np.isnan(samples.poses_m).all()


def test_truth_is_not_guessed_across_gaps():
    truth = Trajectory(np.array([1.0, 1.1, 3.0, 3.1]), np.zeros((4, 3)))
    known = np.isfinite(truth_at(truth, np.array([0.5, 1.0, 1.05, 2.0, 3.0, 3.05, 3.2]))[:, 0])
    assert known.tolist() == [False, True, True, False, True, True, False]


@pytest.fixture
def foreign(run, exported, tmp_path):
    """A TUM sequence without self-motion, to be damaged."""
    shutil.copytree(exported("tum") / "hamlet-mapping", tmp_path / "seq")
    (tmp_path / "seq" / "odometry.csv").unlink()
    return tmp_path / "seq"


def test_poses_as_self_motion_and_smaller_frames(run, foreign, tmp_path, capsys):
    write_tum(tmp_path / "vo.tum", run.mapping.ground_truth())
    (foreign / "groundtruth.txt").unlink()
    assert imported(foreign, "tum", tmp_path / "in", "--odometry", tmp_path / "vo.tum", "--size", "16x16") == DONE
    assert "poses differentiated; truth for 0% of the steps" in capsys.readouterr().out
    back = open_recording(tmp_path / "in")
    assert back.frame(0).shape == (16, 16, 3)
    assert truth_of(back) is None
    assert main(["score", str(run.scenario / "topometric.tum"), str(tmp_path / "in")]) == BAD_INPUT
    assert "imported without truth" in capsys.readouterr().err


def test_grey_and_16_bit_frames(run, foreign, tmp_path):
    for number, path in enumerate(sorted((foreign / "rgb").iterdir())):
        grey = np.full((24, 32), 1000 * number, np.uint16) if number % 2 else np.full((24, 32), number, np.uint8)
        path.write_bytes(cv2.imencode(".png", grey)[1].tobytes())
    assert imported(foreign, "tum", tmp_path / "in", "--odometry", "truth") == DONE
    back = open_recording(tmp_path / "in")
    assert np.unique(back.frame(8)).tolist() == [8]
    assert np.unique(back.frame(9)).tolist() == [9000 // 256]


def test_score_prints_our_figures(run, exported, tmp_path, capsys):
    assert imported(exported("tum") / "hamlet-mapping", "tum", tmp_path / "in", "--truth-frame", "network") == DONE
    capsys.readouterr()
    for recording in (run.mapping.folder, tmp_path / "in"):
        assert main(["score", str(run.scenario / "topometric.tum"), str(recording)]) == DONE
    lines = capsys.readouterr().out.splitlines()
    assert lines[: len(lines) // 2] == lines[len(lines) // 2 :]
    estimate, truth = read_tum(run.scenario / "topometric.tum"), run.mapping.ground_truth()
    errors_m = np.hypot(*(estimate.poses - se2.interpolate(truth.t_s, truth.poses, estimate.t_s))[:, :2].T)
    assert lines[0].startswith(f"mean {errors_m.mean():.3f} m")


@given(images=st.lists(st.binary(max_size=50), max_size=8), order=st.randoms(use_true_random=False))
@settings(max_examples=30, deadline=None)
def test_images_come_back_from_disk_in_any_order(images, order):
    spool = Spool()
    kept = [(image, spool.keep(image)) for image in images]
    order.shuffle(kept)
    assert all(load() == image for image, load in kept)


BOMB = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00\xff\xff\x00\x00\xff\xff\x08\x02\x00\x00\x00\x00\x00\x00\x00"


def damage(path, text):
    path.write_text(text)


@pytest.mark.parametrize(
    ("break_it", "complaint"),
    [
        (lambda seq: damage(seq / "rgb.txt", "# nothing\n"), "no frames"),
        (lambda seq: damage(seq / "rgb.txt", "soon rgb/0.png\n"), "rgb.txt: line 1: not a time and a file name"),
        (lambda seq: damage(seq / "rgb.txt", "nan rgb/0.png\n"), "rgb.txt: line 1: the time is not finite"),
        (lambda seq: damage(seq / "rgb.txt", "0.2 ../../etc/passwd\n"), "lies outside of the folder"),
        (lambda seq: damage(seq / "rgb.txt", "0.2 rgb/0\0.png\n"), "rgb.txt: a file's name has a zero byte in it"),
        (lambda seq: damage(seq / "rgb.txt", "0.2 rgb/none.png\n"), "none.png: cannot be read"),
        (lambda seq: damage(seq / "rgb.txt", "900.2 rgb/0.200000.png\n"), "no frame within the self-motion's time"),
        (lambda seq: damage(seq / "rgb.txt", "0.4 a.png\n0.2 b.png\n"), "does not increase"),
        (lambda seq: damage(seq / "groundtruth.txt", "0 1 2 0 0 0 0 0\n1 1 2 0 0 0 0 1\n"), "no unit quaternion"),
        (lambda seq: damage(seq / "groundtruth.txt", "0 1 2 0 0 0 0 inf\n"), "not finite"),
        (lambda seq: damage(seq / "groundtruth.txt", "0 1 2\n"), "line 1: 3 columns, expected 8"),
        (lambda seq: damage(seq / "groundtruth.txt", "0 1 2 0 0 0 0 1\n"), "at least 3 are needed"),
        (lambda seq: (seq / "groundtruth.txt").write_bytes(b"\xff\xfe\x00"), "cannot be read as text"),
        (lambda seq: (seq / "rgb" / "0.400000.png").write_bytes(b"hello"), "not an image"),
        (lambda seq: (seq / "rgb" / "0.400000.png").write_bytes(b""), "not an image"),
        (lambda seq: (seq / "rgb" / "0.400000.png").write_bytes(BOMB), "0.400000.png"),
        (lambda seq: cv2.imwrite(str(seq / "rgb" / "0.400000.png"), np.zeros((20, 20), np.uint8)), "the first frame has 32 x 24"),
    ],
)
def test_hostile_input_is_refused_in_one_line(foreign, tmp_path, capsys, break_it, complaint):
    break_it(foreign)
    assert imported(foreign, "tum", tmp_path / "in", "--odometry", "truth") == BAD_INPUT
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert complaint in line
    assert not (tmp_path / "in").exists()
    assert not list(tmp_path.glob(".in*"))


def test_no_self_motion_says_what_to_give(foreign, tmp_path, capsys):
    assert imported(foreign, "tum", tmp_path / "in") == BAD_INPUT
    assert "give --odometry FILE.csv" in capsys.readouterr().err


def test_the_manifest_says_what_it_was(exported, tmp_path):
    assert imported(exported("euroc") / "hamlet-mapping", "euroc", tmp_path / "in") == DONE
    manifest = json.loads((tmp_path / "in" / "manifest.json").read_text())
    assert manifest["imported"]["format"] == "euroc"
    assert manifest["camera"]["fov_deg"] == pytest.approx(80.0)
    assert manifest["truth_frame"] == "own"


def test_epoch_clocks_and_camera_axes(run, foreign, tmp_path):
    """As most datasets come: seconds since 1970, poses of the camera, z forward."""
    epoch_s = 1_403_636_579.0
    rows = [line.split() for line in (foreign / "rgb.txt").read_text().splitlines()[1:]]
    (foreign / "rgb.txt").write_text("".join(f"{float(t) + epoch_s:.6f} {name}\n" for t, name in rows))
    truth, optical = run.mapping.ground_truth(), Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    lines = [
        f"{t_s + epoch_s:.6f} {x} {y} 0.3 " + " ".join(map(str, (Rotation.from_euler("z", yaw) * optical).as_quat()))
        for t_s, (x, y, yaw) in zip(truth.t_s, truth.poses, strict=True)
    ]
    (foreign / "groundtruth.txt").write_text("\n".join(lines))
    assert imported(foreign, "tum", tmp_path / "in", "--axes", "camera", "--odometry", "truth") == DONE
    back = open_recording(tmp_path / "in")
    assert back.manifest["imported"]["time_origin_s"] == pytest.approx(epoch_s + 0.1, abs=1e-4)
    assert np.abs(back.samples.poses_m - truth.poses[1:]).max() < 1e-6
    turned = se2.wrap(np.diff(truth.poses[:, 2]))
    assert np.allclose(back.samples.yaw_rate_radps * back.samples.dt_s, turned, atol=1e-5)
    assert back.frame_count == 30


@pytest.mark.parametrize("to", ["tum", "euroc", "kitti", "mcap", "rerun", "rosbag2"])
def test_a_drive_without_truth_and_calibration_is_exported_too(run, foreign, tmp_path, to):
    write_tum(tmp_path / "vo.tum", run.mapping.ground_truth())
    (foreign / "groundtruth.txt").unlink()
    assert imported(foreign, "tum", tmp_path / "in", "--odometry", tmp_path / "vo.tum") == DONE
    assert main(["export", str(tmp_path / "in"), "--to", to, "--out", str(tmp_path / "out")]) == DONE
    (drive,) = json.loads((tmp_path / "out" / "about.json").read_text())["drives"]
    assert (drive["truth"], drive["roads"], drive["frames"]) == (False, False, 30)


def test_evo_results_need_a_truth(run, foreign, tmp_path, capsys):
    write_tum(tmp_path / "vo.tum", run.mapping.ground_truth())
    (foreign / "groundtruth.txt").unlink()
    assert imported(foreign, "tum", tmp_path / "in", "--odometry", tmp_path / "vo.tum") == DONE
    assert main(["export", str(tmp_path / "in"), "--to", "evo", "--out", str(tmp_path / "out")]) == BAD_INPUT
    assert "no drive has a truth" in capsys.readouterr().err


def test_an_origin_that_is_cut_short_is_named(exported, tmp_path, capsys):
    shutil.copytree(exported("kitti"), tmp_path / "kitti")
    origin = tmp_path / "kitti" / "sequences" / "00" / "origin.txt"
    origin.write_text(origin.read_text().splitlines()[0])
    assert imported(origin.parent, "kitti", tmp_path / "in") == BAD_INPUT
    assert "origin.txt: 1 lines of numbers, expected a matrix of 4" in capsys.readouterr().err
