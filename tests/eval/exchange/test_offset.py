"""The offset between two clocks, told by turns; refused where the turns do not tell."""

import gzip
import io
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pyproj
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hippodrome.core.types import HippodromeError, Trajectory
from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import BAD_INPUT, DONE
from hippodrome.eval.exchange.drives.foreign import ForeignFrame, Motion, motion_of
from hippodrome.eval.exchange.drives.offset import (
    LEAD,
    Turns,
    offset_between,
    told_offset,
    turns_of_frames,
    turns_of_motion,
    turns_of_trajectory,
)
from hippodrome.eval.exchange.drives.steps import begin_s
from hippodrome.eval.exchange.drives.truth import stored_truth
from hippodrome.sim.recording import open_recording
from tests.eval.exchange.test_lever import axle_drive

KITTI_03 = Path(__file__).parents[4] / "shared" / "real" / "kitti-03"


def motion_in_other_clock(drive, offset_s, first=50, last=-80):
    motion = motion_of(drive, "test")
    part = slice(first, last)
    return Motion(motion.t_s[part] - offset_s, motion.speed[part], motion.yaw_rate_radps[part])


def turns_in_other_clock(seed, offset_s):
    """The turns of a drive as a noisy gyroscope on another clock has them, and as the truth has them."""
    drive = axle_drive(seed)
    noise = np.random.default_rng(seed).normal(0.0, 0.05, 1200)
    motion = motion_in_other_clock(drive, offset_s)
    motion = Motion(motion.t_s, motion.speed, motion.yaw_rate_radps + noise[: len(motion.t_s)])
    return turns_of_motion(motion), turns_of_trajectory(drive, "the truth")


@given(seed=st.integers(0, 2**32 - 1), offset_s=st.floats(-1e3, 1e3) | st.floats(1e9, 2e9))
@example(seed=600, offset_s=0.0)  # its last half turns as its first half did: 0.83 a minute apart
@settings(max_examples=20, deadline=None)
def test_turns_tell_the_offset_unless_the_drive_resembles_itself(seed, offset_s):
    moved, fixed = turns_in_other_clock(seed, offset_s)
    right = pytest.approx(offset_s, abs=0.2)  # two samples: of 150 drives the worst was off by 0.08 s, the median by 0.005 s
    found = offset_between(moved, fixed)
    assert found.seconds == right
    if found.correlation - found.next_best >= LEAD:
        assert told_offset(moved, fixed) == right
        return
    with pytest.raises(HippodromeError, match="no sure time offset"):
        told_offset(moved, fixed)
    assert offset_between(fixed, fixed).next_best > 1.0 - LEAD - 0.1  # noise takes some 0.04 of the best, and may add to another


def test_few_drives_resemble_themselves():
    found = [offset_between(*turns_in_other_clock(seed, 0.0)) for seed in range(40)]
    assert sum(one.correlation - one.next_best >= LEAD for one in found) >= 38


def test_what_does_not_tell_is_refused():
    t_s = 0.1 * np.arange(600)
    still = Turns(t_s, np.zeros(600), "the self-motion")
    circle = Turns(t_s, 0.3 * t_s + 0.2 * np.sin(t_s * 2 * np.pi / 10.0), "the self-motion")  # the same every 10 s
    rng = np.random.default_rng(0)
    wild, other = (Turns(t_s, np.cumsum(rng.normal(0.0, 0.1, 600)), "noise") for _ in range(2))
    drive = turns_of_trajectory(axle_drive(), "the truth")
    for moved, fixed, complaint in (
        (still, drive, "hardly turns"), (circle, circle, "no sure time offset"), (wild, other, "no sure time offset"),
        (Turns(t_s[:100], wild.angle[:100], "the self-motion"), drive, "less than 20 s"),
        (Turns(t_s * 1e9, wild.angle, "the self-motion"), drive, "too long|less than"),
    ):  # fmt: skip
        with pytest.raises(HippodromeError, match=complaint):
            told_offset(moved, fixed)


def frames_of(drive, every=1, noise=4.0):
    """Frames of a camera that sees a panorama, which moves to the right as it turns left."""
    rng = np.random.default_rng(1)
    panorama = cv2.GaussianBlur(rng.integers(0, 255, (48, 800)).astype(np.float32), (5, 5), 0)
    panorama = 2.0 * (panorama - panorama.mean()) + 128.0

    def frame(number):
        columns = np.arange(96) - 800.0 / (2 * np.pi) * drive.poses[number, 2]
        grey = np.array([np.interp(columns, np.arange(800), row, period=800) for row in panorama])
        image = np.clip(grey[:, :, None] + rng.normal(0.0, noise, (48, 96, 3)), 0, 255).astype(np.uint8)
        return ForeignFrame(float(drive.t_s[number]), f"frame {number}", lambda: cv2.imencode(".png", image)[1].tobytes())

    return [frame(number) for number in range(0, len(drive.t_s), every)]


def test_the_frames_tell_the_offset():
    drive = axle_drive(3, seconds=60.0)
    motion = motion_in_other_clock(drive, 12.34, 20, -60)
    turns = turns_of_frames(frames_of(drive), lambda frame: frame)
    assert told_offset(turns_of_motion(motion), turns) == pytest.approx(12.34, abs=0.05)


def test_import_with_an_offset_to_be_told(tmp_path, capsys):
    drive = axle_drive(3, seconds=60.0)
    (tmp_path / "images").mkdir()
    for number, frame in enumerate(frames_of(drive, every=2)):
        (tmp_path / "images" / f"{number}.png").write_bytes(frame.load())
    for name, motion in (
        ("o.csv", motion_in_other_clock(drive, -1000.0)),
        ("still.csv", Motion(drive.t_s[1:], *np.zeros((2, 599)))),
    ):
        np.savetxt(tmp_path / name, np.column_stack([motion.t_s, motion.speed, motion.yaw_rate_radps]), delimiter=",")
    source = ["import", str(tmp_path / "images"), "--fps", "5", "--time-offset", "auto", "--out", str(tmp_path / "in")]
    assert main([*source, "--odometry", str(tmp_path / "still.csv")]) == BAD_INPUT
    assert "give --time-offset SECONDS" in capsys.readouterr().err
    assert main([*source, "--odometry", str(tmp_path / "o.csv")]) == DONE
    said = capsys.readouterr().out
    assert float(said.split("time offset ")[1].split()[0]) == pytest.approx(-1000.0, abs=0.05)
    assert open_recording(tmp_path / "in").frame_count > 200


def fixes_once_a_second(path, drive, later_s):
    """A phone's fixes of a drive, in another clock, which began 7.25 s after the drive."""
    t_s = np.arange(drive.t_s[0] + 7.25, drive.t_s[-1], 1.0)
    x_m, y_m = (np.interp(t_s, drive.t_s, drive.poses[:, axis]) for axis in (0, 1))
    lon, lat = pyproj.Proj("+proj=tmerc +lat_0=49 +lon_0=8.4 +ellps=WGS84")(x_m, y_m, inverse=True)
    rows = "".join(f"{t:.3f},{a:.9f},{b:.9f}\n" for t, a, b in zip(t_s + later_s, lat, lon, strict=True))
    path.write_text("t_s,lat,lon\n" + rows)


def test_a_phones_fixes_find_their_place_on_the_drives_clock(tmp_path, capsys):
    drive = axle_drive(3, seconds=60.0)
    motion = motion_in_other_clock(drive, 0.0)
    np.savetxt(tmp_path / "o.csv", np.column_stack([motion.t_s, motion.speed, motion.yaw_rate_radps]), delimiter=",")
    fixes_once_a_second(tmp_path / "gps.csv", drive, 1.6e9)
    source = ["import", str(tmp_path / "o.csv"), "--from", "odometry", "--truth", str(tmp_path / "gps.csv")]
    assert main([*source, "--out", str(tmp_path / "in")]) == BAD_INPUT
    assert "or --truth-offset SECONDS to add, or --truth-offset auto" in capsys.readouterr().err
    assert main([*source, "--truth-offset", "auto", "--out", str(tmp_path / "in")]) == DONE
    said = capsys.readouterr().out
    assert float(said.split("time offset ")[1].split()[0]) == pytest.approx(-1.6e9, abs=0.2) and "truth: 53 fixes" in said
    assert main([*source, "--truth-offset", "-1600000000", "--out", str(tmp_path / "in2")]) == DONE
    truth = stored_truth(open_recording(tmp_path / "in2")).trajectory
    assert truth.t_s[0] == pytest.approx(7.25 - begin_s(motion), abs=1e-6)


def test_nanoseconds_below_a_header_of_seconds_are_told_by_their_size(tmp_path, capsys):
    rows = "".join(f"{1317038544100000000 + i * 100_000_000},8,0.1\n" for i in range(100))
    (tmp_path / "o.csv").write_text("t_s,speed,yaw_rate\n" + rows)
    arguments = ["import", str(tmp_path / "o.csv"), "--from", "odometry", "--out", str(tmp_path / "in")]
    assert main(arguments) == DONE
    said = capsys.readouterr().out
    assert "time stamps taken for nanoseconds" in said and "over 10.0 s" in said


def test_an_offset_of_the_truth_needs_two_clocks(tmp_path, capsys):
    drive = axle_drive(3, seconds=60.0)
    motion = motion_in_other_clock(drive, 0.0)
    np.savetxt(tmp_path / "o.csv", np.column_stack([motion.t_s, motion.speed, motion.yaw_rate_radps]), delimiter=",")
    arguments = ["import", str(tmp_path / "o.csv"), "--from", "odometry", "--truth-offset", "auto", "--out", str(tmp_path / "in")]
    assert main(arguments) == BAD_INPUT
    assert "--truth-offset auto needs a truth" in capsys.readouterr().err


@pytest.mark.skipif(not KITTI_03.exists(), reason="no real data beside the checkout (../shared/real)")
def test_real_frames_tell_the_offset():
    """KITTI 03: the truth's turns 3.21 s late, found from frames of a third of the size within a frame's time."""
    table = np.loadtxt(gzip.decompress((KITTI_03 / "03.txt.gz").read_bytes()).decode().splitlines()).reshape(-1, 3, 4)
    poses = np.column_stack([table[:, 2, 3], -table[:, 0, 3], np.arctan2(-table[:, 0, 2], table[:, 2, 2])])
    drive = Trajectory(0.1 * np.arange(len(poses)), poses)
    with zipfile.ZipFile(KITTI_03 / "frames.zip") as archive:
        names = sorted(name for name in archive.namelist() if name.lower().endswith((".jpg", ".png")))[:400]
        blobs = [io.BytesIO(archive.read(name)).getvalue() for name in names]
    frames = [ForeignFrame(0.1 * n, names[n], lambda blob=blob: blob) for n, blob in enumerate(blobs)]
    motion = motion_in_other_clock(drive, 3.21, 60, 360)
    turns = turns_of_frames(frames, lambda frame: frame)
    assert told_offset(turns_of_motion(motion), turns) == pytest.approx(3.21, abs=0.1)
