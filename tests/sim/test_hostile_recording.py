"""A recording that is not what it says is refused with a sentence, before it takes memory or time."""

import io
import json
import resource
import struct
import zipfile
import zlib

import numpy as np
import pytest

from hippodrome._files import sha256_of
from hippodrome.sim.array_file import write_arrays
from hippodrome.sim.episode import Samples
from hippodrome.sim.recording import (
    MANIFEST,
    RecordingError,
    chunk_path,
    frame_name,
    open_recording,
    read_samples,
    seal,
    write_chunk,
)
from hippodrome.sim.recording_checks import CHECKSUM, MAX_FRAME_BYTES, check_truth, decoded_png, with_checksum

STEPS = 20


def arrays_of(**changed):
    t_s = 0.1 * np.arange(1, STEPS + 1)
    whole = {"t_s": t_s, "dt_s": np.full(STEPS, 0.1), "speed": t_s + 1.0, "yaw_rate_radps": 0.1 * t_s,
             "frame": np.arange(STEPS, dtype=np.int32), "poses_m": np.stack([t_s, t_s, t_s], axis=1), "speed_mps": t_s,
             "lane": np.zeros(STEPS, np.int32), "lane_position_m": t_s, "lane_ids": np.array(["a_0", "b_0"])}  # fmt: skip
    return {**whole, **changed}


@pytest.fixture
def recording(tmp_path):
    arrays = arrays_of()
    write_arrays(tmp_path / "samples.npz", arrays)
    write_arrays(tmp_path / "drive.npz", {"nothing": np.zeros(1)})
    rng = np.random.default_rng(1)
    frames = [rng.integers(0, 256, (12, 16, 3), dtype=np.uint8) for _ in range(STEPS)]
    write_chunk(chunk_path(tmp_path, 0), 0, ((frame,) for frame in frames))
    seal(tmp_path, {"scenario": "test"}, Samples(**{**arrays, "lane_ids": ("a_0", "b_0")}))
    return tmp_path


def resealed(folder):
    """The recording with right hashes of whatever is in its files: somebody made it so on purpose."""
    manifest = json.loads((folder / MANIFEST).read_text())
    manifest["sha256"] = {name: sha256_of(folder / name) for name in manifest["sha256"]}
    (folder / MANIFEST).write_text(json.dumps(with_checksum({key: manifest[key] for key in manifest if key != CHECKSUM})))
    return open_recording(folder)


@pytest.mark.parametrize("change", [{"scenario": "tess"}, {"new": 1}, {CHECKSUM: "0" * 64}, {CHECKSUM: None}])
def test_a_manifest_that_was_changed_is_refused(recording, change):
    path = recording / MANIFEST
    manifest = json.loads(path.read_text())
    path.write_text(json.dumps({**manifest, **change}))
    with pytest.raises(RecordingError, match="manifest_sha256 does not hold"):
        open_recording(recording)
    path.write_text(json.dumps(manifest, indent=7))
    assert open_recording(recording).manifest == manifest
    path.write_text(json.dumps({key: manifest[key] for key in manifest if key != CHECKSUM}))  # as before there was one
    open_recording(recording)


def with_value(name, value, row=3):
    array = arrays_of()[name].copy()
    array[row] = value
    return {name: array}


@pytest.mark.parametrize(("changed", "reason"), [
    (with_value("dt_s", -0.1), r"dt_s\[3\] is not above zero"),
    (with_value("dt_s", 0.0), r"dt_s\[3\] is not above zero"),
    (with_value("dt_s", np.nan), r"dt_s\[3\] is not finite"),
    (with_value("t_s", 0.0), r"t_s\[2\] is followed by an earlier or the same one"),
    (with_value("t_s", np.inf), r"t_s\[3\] is not finite"),
    (with_value("speed", 1e300), r"speed\[3\] is not finite, or beyond"),
    (with_value("speed", np.nan), r"speed\[3\] is not finite"),
    (with_value("yaw_rate_radps", -1e12), r"yaw_rate_radps\[3\] is not finite, or beyond"),
    (with_value("poses_m", 1e12), r"poses_m\[3\] is not finite, or beyond"),
    (with_value("frame", 7), "frame does not count"),
    (with_value("frame", -5, 0), "frame does not count"),
    (with_value("lane", 2), r"lane\[3\] is none of 2 lanes"),
    (with_value("lane", -2), r"lane\[3\] is none of 2 lanes"),
    ({"speed": np.array(1.0)}, r"speed is float64 \(\), a recording of 20 steps has \(20,\)"),
    ({"t_s": np.array(1.0)}, "t_s is no list of times"),
    ({"t_s": np.zeros(0)}, "0 steps, it may be 1 to"),
    ({"lane_ids": np.array("a")}, "lane_ids is no list of names"),
    ({"lane_ids": np.zeros((2, 2))}, "lane_ids is no list of names"),
    ({"speed": np.array(["x"] * STEPS)}, r"speed is <U1"),
    ({"speed": np.zeros(STEPS, complex)}, "speed is complex128"),
    ({"frame": np.zeros(STEPS)}, "frame is float64"),
    ({"poses_m": np.zeros((STEPS, 2))}, "poses_m is float64"),
])  # fmt: skip
def test_arrays_that_make_no_drive(recording, changed, reason):
    write_arrays(recording / "samples.npz", arrays_of(**changed))
    with pytest.raises(RecordingError, match=f"samples.npz: not a readable sample file \\({reason}.*delete the recording"):
        resealed(recording)


def test_truth_may_be_unknown(recording):
    unknown = np.full(STEPS, np.nan)
    write_arrays(recording / "samples.npz", arrays_of(speed_mps=unknown, lane_position_m=unknown, lane_ids=np.zeros(0, "<U1"),
                                                      lane=np.full(STEPS, -1, np.int32)))  # fmt: skip
    assert len(resealed(recording).samples.t_s) == STEPS


@pytest.mark.parametrize(("changed", "reason"), [
    ({"t_s": np.array(1.0)}, r"t_s is float64 \(\)"),
    ({"t_s": np.array([1.0, 1.0])}, r"t_s\[0\] is followed by an earlier"),
    ({"t_s": np.array([1, 2])}, "t_s is int64"),
    ({"poses_m": np.zeros((3, 3))}, r"poses_m is float64 \(3, 3\), a truth of 2 poses has \(2, 3\)"),
    ({"poses_m": np.full((2, 3), np.nan)}, r"poses_m\[0\] is not finite"),
    ({"height_m": np.array([0.0, 1e300])}, r"height_m\[1\] is not finite, or beyond"),
    ({"sigma_m": np.array([np.nan, -1.0])}, r"sigma_m\[1\] is below zero"),
    ({"has_heading": np.array(True)}, r"has_heading is bool \(\)"),
    ({"has_heading": np.array([1.0])}, "has_heading is float64"),
    ({}, None),
])  # fmt: skip
def test_a_truth_with_times_of_its_own(changed, reason):
    whole = {"t_s": np.array([1.0, 2.0]), "poses_m": np.zeros((2, 3)), "height_m": np.zeros(2),
             "sigma_m": np.array([np.nan, 1.0]), "has_heading": np.array([True])}  # fmt: skip
    if reason is None:
        check_truth(whole)
        return
    with pytest.raises(ValueError, match=reason):
        check_truth({**whole, **changed})


def npz(**members):
    blob = io.BytesIO()
    with zipfile.ZipFile(blob, "w") as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return blob.getvalue()


def test_arrays_that_claim_more_than_there_is(recording):
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (400000000000,), }"
    huge = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header) + 1) + header + b"\n" + bytes(80)
    names = list(arrays_of())
    for content in (npz(**dict.fromkeys(names, huge)), npz(**dict.fromkeys(names, b"")), npz(), b"PK", b"", bytes(4096)):
        (recording / "samples.npz").write_bytes(content)
        with pytest.raises(RecordingError, match="not a readable sample file"):
            read_samples(recording / "samples.npz")


def chunk_with(folder, blob, **entry):
    info = zipfile.ZipInfo(frame_name(0))
    info.compress_type = entry.get("compress_type", zipfile.ZIP_STORED)
    path = chunk_path(folder, 0)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(info, blob)
    data = bytearray(path.read_bytes())
    if "flags" in entry:  # in the local and in the central header
        data[6] |= entry["flags"]
        data[data.rindex(b"PK\x01\x02") + 8] |= entry["flags"]
    if "method" in entry:
        data[8:10] = data[data.rindex(b"PK\x01\x02") + 10 : data.rindex(b"PK\x01\x02") + 12] = struct.pack("<H", entry["method"])
    path.write_bytes(data)
    return resealed(folder)


def png(width, height, depth=8, body=b""):
    def part(name, content):
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))

    head = struct.pack(">IIBBBBB", width, height, depth, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + part(b"IHDR", head) + part(b"IDAT", zlib.compress(body)) + part(b"IEND", b"")


@pytest.mark.parametrize(("blob", "entry", "reason"), [
    (b"", {}, "not a PNG image"),
    (b"GIF89a" + bytes(100), {}, "not a PNG image"),
    (png(30_000, 30_000), {}, "30000 x 30000 pixels, the limit is"),
    (png(2**31, 2**31), {}, "pixels, the limit is"),
    (png(0, 5), {}, "0 x 5 pixels"),
    (png(16, 12)[:30], {}, "not a whole PNG|not a PNG"),
    (png(16, 12), {"flags": 1}, "encrypted"),
    (png(16, 12), {"method": 99}, "compression method"),
    (png(16, 12), {"method": 8}, ""),
    (png(16, 12), {"method": 14}, ""),
    (bytes(MAX_FRAME_BYTES + 1), {"compress_type": zipfile.ZIP_DEFLATED}, "bytes, the limit is"),
])  # fmt: skip
def test_frames_that_are_none(recording, blob, entry, reason):
    opened = chunk_with(recording, blob, **entry)
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(RecordingError, match=f"frame 0 cannot be read .*({reason}).*") as caught:
        opened.frame(0)
    assert "\n" not in str(caught.value)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb < 200_000


def test_a_frame_that_is_missing_or_whose_file_is_none(recording):
    with pytest.raises(RecordingError, match="frame 1 cannot be read"):
        chunk_with(recording, png(16, 12)).frame(1)
    chunk_path(recording, 0).write_bytes(b"PK\x05\x06" + bytes(18) + b"x")
    with pytest.raises(RecordingError, match="frame 0 cannot be read"):
        resealed(recording).frame(0)
    with pytest.raises(ValueError, match="bytes, the limit is"):
        decoded_png(bytes(MAX_FRAME_BYTES + 1))


@pytest.mark.parametrize("text", [
    '{"format": ' + "9" * 5000 + "}", "[]", "null", "{", '{"sha256": 3, "format": 1}', '{"sha256": {}, "format": 1}',
    '{"sha256": {"samples.npz": "0", "../x": "0"}, "format": 1}', '{"sha256": {"samples.npz": "0", "a\\u0000": 1}, "format": 1}',
    "[" * 100_000, "\udcff",
])  # fmt: skip
def test_manifests_that_are_none(recording, text):
    (recording / MANIFEST).write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(RecordingError) as caught:
        open_recording(recording)
    assert str(caught.value).startswith(str(recording)) and "\n" not in str(caught.value)
