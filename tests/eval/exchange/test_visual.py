"""Self-motion from real frames, against the truth that came with them; without the data it is skipped."""

import gzip
import zipfile
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from hippodrome.core.views.egomotion.camera import RoadCamera
from hippodrome.eval.cli import main
from hippodrome.eval.exchange.drives.foreign import ForeignFrame
from hippodrome.eval.exchange.drives.visual import seen_focal_px, visual_motion
from hippodrome.sim.recording import open_recording

DRIVE = Path(__file__).parents[3].parent / "shared" / "real" / "kitti-03"
MATRIX = np.array([[240.51, 0.0, 202.85], [0.0, 240.51, 57.28], [0.0, 0.0, 1.0]])  # of frames at a third of the size
RATE_HZ, COUNT = 10.0, 241


@pytest.fixture(scope="module")
def archive():
    if not DRIVE.is_dir():
        pytest.skip(f"no {DRIVE}")
    return zipfile.ZipFile(DRIVE / "frames.zip")


@pytest.fixture(scope="module")
def truth():
    """Steps (N,) and turns to the left (N,) of the camera."""
    text = gzip.decompress((DRIVE / "03.txt.gz").read_bytes()).decode()
    rows = np.loadtxt(text.splitlines()).reshape(-1, 3, 4)
    ahead = np.unwrap(np.arctan2(-rows[:, 0, 2], rows[:, 2, 2]))
    return np.linalg.norm(np.diff(rows[:, :, 3], axis=0), axis=1), np.diff(ahead)


def frames_of(archive, every=1):
    names = sorted(name for name in archive.namelist() if name.endswith(".jpg"))[:COUNT:every]
    return [ForeignFrame(number / RATE_HZ, name, partial(archive.read, name)) for number, name in enumerate(names)]


@pytest.mark.parametrize("every", [1, 2])  # the second one drives twice as fast
def test_turn_and_speed_of_a_real_drive(archive, truth, every):
    seen = visual_motion(frames_of(archive, every), RoadCamera(MATRIX, 1.65), (414, 125), lambda frame: frame)
    steps, turns = (part[: COUNT - 1].reshape(-1, every).sum(axis=1) for part in truth)
    found_m, found_rad = seen.motion.speed / RATE_HZ, seen.motion.yaw_rate_radps / RATE_HZ
    assert found_m.sum() == pytest.approx(steps.sum(), rel=0.05)
    half = len(steps) // 2
    assert found_m[:half].sum() / steps[:half].sum() == pytest.approx(found_m[half:].sum() / steps[half:].sum(), rel=0.08)
    assert np.abs(found_rad).sum() == pytest.approx(np.abs(turns).sum(), rel=0.04)
    assert np.corrcoef(found_rad, turns)[0, 1] > 0.99


def test_the_focal_length_of_a_real_camera_is_seen(archive):
    assert seen_focal_px(frames_of(archive)) == pytest.approx(240.5, rel=0.15)


def test_a_real_folder_of_frames_without_anything_else_becomes_a_recording(archive, tmp_path, capsys):
    for number, frame in enumerate(frames_of(archive)[60:160]):
        (tmp_path / f"{number:04d}.jpg").write_bytes(frame.load())
    asked = ["import", str(tmp_path), "--fps", "10", "--odometry", "visual", "--camera-height", "1.65"]
    assert main([*asked, "--out", str(tmp_path / "in")]) == 0
    said = capsys.readouterr().out
    assert "warning: focal length" in said
    assert "horizon at row" in said
    assert open_recording(tmp_path / "in").frame_count == 99
