"""The lever arm of a camera before the rear axle: estimated from the motion itself, and taken out."""

import gzip
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hippodrome.core import se2
from hippodrome.core.types import Trajectory
from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import DONE
from hippodrome.eval.exchange.drives.foreign import motion_of
from hippodrome.eval.exchange.drives.lever import NO_LEVER, at_axle, estimated, lever_of
from hippodrome.sim.recording import open_recording

KITTI = Path(__file__).parents[4] / "shared" / "real" / "kitti"


def axle_drive(seed=0, seconds=120.0, rate_hz=10.0):
    """Poses of a rear axle that drives smooth turns of up to 0.5 rad/s at 3 to 12 m/s."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, seconds, 1.0 / rate_hz)
    knots = np.arange(0.0, seconds + 4.0, 4.0)
    turn = np.interp(t_s, knots, rng.uniform(-0.5, 0.5, len(knots))) / rate_hz
    arc = np.interp(t_s, knots, rng.uniform(3.0, 12.0, len(knots))) / rate_hz
    chord = arc * np.sinc(turn / 2.0 / np.pi)
    steps = np.column_stack([chord * np.cos(turn / 2.0), chord * np.sin(turn / 2.0), turn])[1:]
    return Trajectory(t_s, se2.integrate(np.zeros(3), np.concatenate([np.zeros((1, 3)), steps])))


@given(
    seed=st.integers(0, 2**32 - 1), ahead=st.floats(0.4, 3.0), behind=st.booleans(), scale=st.floats(1e-3, 1e3),
    askew=st.floats(-0.05, 0.05),
)  # fmt: skip
@settings(max_examples=25, deadline=None)
def test_the_motion_tells_the_lever_at_any_scale(seed, ahead, behind, scale, askew):
    lever = -ahead if behind else ahead
    noise = np.random.default_rng(seed).normal(0.0, [0.01, 0.01, 0.001], (1200, 3))
    poses = at_axle(axle_drive(seed), -lever).poses + noise + [0.0, 0.0, askew]
    found = estimated(Trajectory(axle_drive(seed).t_s, poses * [scale, scale, 1.0]))
    assert found is not None
    assert found[0] / scale == pytest.approx(lever, abs=0.1)
    assert 0.0 < found[1] / scale < 0.1


def test_what_cannot_be_told_is_zero():
    drive = axle_drive()
    assert lever_of(drive, "auto", "axle") is NO_LEVER  # nothing slips
    straight = Trajectory(drive.t_s, np.column_stack([drive.t_s * 9.0, np.zeros((len(drive.t_s), 2))]))
    assert lever_of(straight, "auto", "straight") is NO_LEVER
    wild = np.random.default_rng(0).normal(0.0, 1.0, (len(drive.t_s), 3))
    assert lever_of(Trajectory(drive.t_s, wild), "auto", "in a hand") is NO_LEVER
    assert lever_of(Trajectory(drive.t_s[:50], drive.poses[:50]), "auto", "short") is NO_LEVER
    assert lever_of(straight, 1.25, "said").ahead == 1.25


def test_the_motion_of_the_axle_comes_back():
    drive = axle_drive()
    camera = at_axle(drive, -1.7)
    lever = lever_of(camera, "auto", "camera")
    found, true, wrong = (motion_of(one, "test") for one in (at_axle(camera, lever.ahead), drive, camera))
    assert np.abs(found.speed - true.speed).max() < 0.02
    assert np.abs(wrong.speed - true.speed).max() > 0.04


@pytest.mark.skipif(not KITTI.exists(), reason="no real data beside the checkout (../shared/real)")
@pytest.mark.parametrize("name", ["00", "05", "09"])
def test_the_camera_of_kitti_sits_some_90_cm_ahead_of_the_point_that_does_not_slip(tmp_path, name, capsys):
    """Its GPS/IMU, 5 cm ahead of the axle, is 1.08 m behind the camera; the axle itself slips outwards at speed, which the
    estimate, of the point that does not slip, contains."""
    (tmp_path / f"{name}.txt").write_bytes(gzip.decompress((KITTI / f"{name}.txt.gz").read_bytes()))
    source = ["import", str(tmp_path / f"{name}.txt"), "--from", "odometry", "--fps", "9.65"]
    assert main([*source, "--out", str(tmp_path / "auto")]) == DONE
    said = capsys.readouterr().out
    assert 0.8 < float(said.split("poses lie ")[1].split()[0]) < 1.1
    for ahead, out in (("0", "camera"), ("0.9", "axle")):
        assert main([*source, "--camera-ahead", ahead, "--out", str(tmp_path / out)]) == DONE
    speeds = {out: open_recording(tmp_path / out).samples.speed for out in ("auto", "camera", "axle")}
    assert np.abs(speeds["auto"] - speeds["axle"]).max() < np.abs(speeds["camera"] - speeds["axle"]).max()


def test_a_trajectory_of_the_measured_point_is_held_against_its_own_truth(tmp_path, capsys):
    """The truth of a camera scored against itself is 0, and so is the axle's trajectory."""
    drive = axle_drive()
    for name, one in (("camera", at_axle(drive, -1.5)), ("axle", drive)):
        rows = np.column_stack([one.t_s, one.poses[:, :2], np.zeros((len(one.t_s), 3)), np.sin(one.poses[:, 2] / 2),
                                np.cos(one.poses[:, 2] / 2)])  # fmt: skip
        np.savetxt(tmp_path / f"{name}.tum", rows, fmt="%.15g")
    source = [str(tmp_path / "camera.tum"), "--from", "odometry", "--truth", str(tmp_path / "camera.tum")]
    assert main(["import", *source, "--out", str(tmp_path / "in")]) == DONE
    assert main(["score", str(tmp_path / "camera.tum"), str(tmp_path / "in"), "--max-ape", "1e-6"]) == DONE
    assert "taken for poses of the point whose truth was measured, 1.5" in capsys.readouterr().out
    axle = ["score", str(tmp_path / "axle.tum"), str(tmp_path / "in"), "--max-ape", "0.05"]
    assert main([*axle, "--camera-ahead", "0"]) == DONE
    assert main(axle) != DONE
