"""Recordings come back as they were written; a damaged one is refused with file and cure, and no memory is taken for it."""

import json
import zipfile

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from hippodrome.core.types import HippodromeError
from hippodrome.sim.array_file import write_arrays
from hippodrome.sim.episode import Samples
from hippodrome.sim.recording import CHUNK_FRAMES, chunk_count, chunk_path, open_recording, read_samples, seal, write_chunk


def make_samples(steps: int) -> Samples:
    t_s = 0.1 * np.arange(1, steps + 1)
    frame = np.where(np.arange(steps) % 2 == 1, np.arange(steps) // 2, -1).astype(np.int32)
    poses = np.stack([t_s, 2 * t_s, 0.1 * t_s], axis=1)
    lane = np.zeros(steps, np.int32)
    return Samples(t_s, np.full(steps, 0.1), t_s + 1, t_s - 1, frame, poses, t_s, lane, t_s, ("a_0", "b_0"))


def frames_of(samples, chunk):
    rng = np.random.default_rng(chunk)
    count = min(CHUNK_FRAMES, len(samples.frame_steps) - chunk * CHUNK_FRAMES)
    return [rng.integers(0, 256, (12, 16, 3), dtype=np.uint8) for _ in range(count)]


@pytest.fixture
def recording(tmp_path):
    samples = make_samples(2 * CHUNK_FRAMES + 20)
    arrays = {name: np.asarray(getattr(samples, name)) for name in Samples.__dataclass_fields__}
    write_arrays(tmp_path / "samples.npz", arrays)
    write_arrays(tmp_path / "drive.npz", {"nothing": np.zeros(1)})
    for chunk in range(chunk_count(samples)):
        write_chunk(chunk_path(tmp_path, chunk), chunk * CHUNK_FRAMES, ((frame,) for frame in frames_of(samples, chunk)))
    return seal(tmp_path, {"scenario": "test"}, samples)


def test_round_trip(recording):
    again = open_recording(recording.folder)
    assert again.frame_count == CHUNK_FRAMES + 10
    assert_array_equal(again.frame(3), frames_of(recording.samples, 0)[3])
    assert_array_equal(again.frame(CHUNK_FRAMES + 9), frames_of(recording.samples, 1)[9])
    steps = list(again)
    assert len(steps) == len(recording.samples.t_s)
    observation, truth = steps[1]
    assert steps[0][0].frame is None
    assert_array_equal(observation.frame, frames_of(recording.samples, 0)[0])
    assert (observation.speed, truth.x_m, truth.lane_id) == (pytest.approx(1.2), pytest.approx(0.2), "a_0")


def test_observations_carry_no_ground_truth(recording):
    observation = next(iter(recording.observations()))
    assert set(observation.__dataclass_fields__) == {"t_s", "dt_s", "speed", "yaw_rate_radps", "frame"}


def test_stereo_pairs_keep_their_sides(tmp_path):
    left, right = np.zeros((4, 4, 3), np.uint8), np.full((4, 4, 3), 9, np.uint8)
    write_chunk(tmp_path / "frames-0000.zip", 0, iter([(left, right)]))
    assert zipfile.ZipFile(tmp_path / "frames-0000.zip").namelist() == ["000000.png", "000000r.png"]


@pytest.mark.parametrize("name", ["samples.npz", "frames-0001.zip", "drive.npz", "manifest.json"])
@pytest.mark.parametrize("damage", ["truncated", "flipped", "removed"])
def test_damage_is_refused(recording, name, damage):
    path = recording.folder / name
    blob = path.read_bytes()
    if damage == "removed":
        path.unlink()
    elif damage == "truncated":
        path.write_bytes(blob[: len(blob) // 2])
    else:
        middle = blob.index(b'"samples.npz": "') + 20 if name == "manifest.json" else len(blob) // 2
        path.write_bytes(blob[:middle] + bytes([blob[middle] ^ 1]) + blob[middle + 1 :])
    with pytest.raises(HippodromeError) as error:
        open_recording(recording.folder)
    assert str(recording.folder) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_frame_damaged_after_opening_is_refused(recording):
    path = chunk_path(recording.folder, 0)
    blob = bytearray(path.read_bytes())
    blob[60:90] = bytes(30)
    path.write_bytes(blob)
    with pytest.raises(HippodromeError, match="frame 0 cannot be read"):
        recording.frame(0)


def test_a_packed_sample_file_is_refused_unread(tmp_path):
    np.savez_compressed(tmp_path / "samples.npz", t_s=np.zeros(10_000_000))
    with pytest.raises(HippodromeError, match="packed"):
        read_samples(tmp_path / "samples.npz")


def test_a_manifest_cannot_name_files_elsewhere(recording):
    path = recording.folder / "manifest.json"
    manifest = json.loads(path.read_text())
    manifest["sha256"]["../../etc/passwd"] = "0"
    del manifest["manifest_sha256"]
    path.write_text(json.dumps(manifest))
    with pytest.raises(HippodromeError, match="passwd"):
        open_recording(recording.folder)


def test_an_unfinished_recording_says_how_to_finish_it(tmp_path):
    with pytest.raises(HippodromeError, match="hippodrome render"):
        open_recording(tmp_path)


def test_an_interrupted_chunk_leaves_nothing(tmp_path):
    def frames():
        yield (np.zeros((4, 4, 3), np.uint8),)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_chunk(tmp_path / "frames-0000.zip", 0, frames())
    assert list(tmp_path.iterdir()) == []
