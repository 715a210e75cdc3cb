"""MCAP files and ROS bags as people have them: which topics, what encodings, cut short, damaged, blown up."""

import base64
import json
import struct

import cv2
import numpy as np
import pytest

pytest.importorskip("mcap")
pytest.importorskip("rosbags")

import lz4.frame
import rosbags.rosbag2.reader as rosbag2_reader
import zstandard
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from hippodrome.core.types import HippodromeError
from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import BAD_INPUT, DONE
from hippodrome.eval.exchange.drives.images import decode
from hippodrome.eval.exchange.readers.mcap_file import read_mcap
from hippodrome.eval.exchange.readers.rosbag import _bounded, _bounded_chunks, read_rosbag

COUNT = 40
PNG = cv2.imencode(".png", np.random.default_rng(0).integers(0, 256, (16, 24, 3), np.uint8))[1].tobytes()


def message(name, number, json_times=None):
    """Message ``number`` of a drive to the left at 5 m/s and 0.2 rad/s, 10 a second."""
    stamp = 1_700_000_000 * 10**9 + number * 10**8
    time = Timestamp(seconds=stamp // 10**9, nanos=stamp % 10**9)
    turn = 0.02 * number
    place = {"x": 25.0 * np.sin(turn), "y": 25.0 * (1.0 - np.cos(turn)), "z": 0.0}
    attitude = {"x": 0.0, "y": 0.0, "z": np.sin(turn / 2), "w": np.cos(turn / 2)}
    pose = {"position": place, "orientation": attitude}
    fields = {
        "camera": {"frame_id": "c", "format": "png", "data": base64.b64encode(PNG).decode()},
        "odom": {
            "linear_velocity": {"x": 5.0},
            "angular_velocity": {"z": 0.2},
            "pose": pose,
        },
        "truth": {"pose": pose},
    }[name]
    iso = time.ToJsonString()
    fields["timestamp"] = {"sec": stamp // 10**9, "nsec": stamp % 10**9} if json_times == "sec" else iso
    return stamp, fields


TYPES = {"camera": CompressedImage, "odom": Odometry, "truth": PoseInFrame}
TOPICS = {"camera": "/cam", "odom": "/odom", "truth": "/ground_truth"}


def write(path, encoding="protobuf", json_times=None, finish=True, change=None, names=("camera", "odom", "truth"), **options):
    from google.protobuf.json_format import ParseDict

    with path.open("wb") as stream:
        writer = Writer(stream, **{"compression": CompressionType.ZSTD, "chunk_size": 4000, **options})
        writer.start("test", "test")
        channels = {}
        for name in names:
            schema = writer.register_schema(
                TYPES[name].DESCRIPTOR.full_name, "jsonschema" if encoding == "json" else "protobuf", b""
            )
            channels[name] = writer.register_channel(TOPICS[name], encoding, schema)
        for number in range(COUNT):
            for name in names:
                stamp, fields = message(name, number, json_times)
                data = json.dumps(fields).encode()
                if encoding == "protobuf":
                    data = ParseDict(fields, TYPES[name]()).SerializeToString()
                for one in [data] if change is None else change(name, number, data):
                    writer.add_message(channels[name], stamp, one, stamp)
        if finish:
            writer.finish()
    return path


@pytest.mark.parametrize(
    "options",
    [
        {}, {"compression": CompressionType.LZ4}, {"compression": CompressionType.NONE}, {"use_chunking": False},
        {"repeat_channels": False, "repeat_schemas": False}, {"use_statistics": False, "use_summary_offsets": False},
        {"encoding": "json"}, {"encoding": "json", "json_times": "sec"}, {"enable_crcs": False},
    ],
)  # fmt: skip
def test_every_way_to_write_a_file_is_read(tmp_path, options):
    drive = read_mcap(write(tmp_path / "a.mcap", **options), "body")
    assert len(drive.frames) == len(drive.motion.t_s) == len(drive.truth.t_s) == COUNT
    assert set(drive.motion.speed) == {5.0} and set(drive.motion.yaw_rate_radps) == {0.2}
    assert drive.truth.poses[:, 2] == pytest.approx(0.02 * np.arange(COUNT))
    assert decode(drive.frames[7]).shape == (16, 24, 3)
    assert drive.frames[7].t_s == 1_700_000_000.7


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE])
def test_a_file_that_was_cut_is_read_as_far_as_it_goes(tmp_path, capsys, compression):
    whole = write(tmp_path / "a.mcap", compression=compression).read_bytes()
    counts = []
    for share in (0.3, 0.6, 0.85):
        (tmp_path / "cut.mcap").write_bytes(whole[: int(share * len(whole))])
        counts.append(len(read_mcap(tmp_path / "cut.mcap", "body").frames))
        assert "cut short: it ends at byte" in capsys.readouterr().out
    assert 0 < counts[0] < counts[1] <= counts[2] <= COUNT
    write(tmp_path / "open.mcap", finish=False)
    assert len(read_mcap(tmp_path / "open.mcap", "body").frames) > 0
    (tmp_path / "begun.mcap").write_bytes(whole[:40])
    with pytest.raises(HippodromeError, match="was cut short, at byte 40"):
        read_mcap(tmp_path / "begun.mcap", "body")


def test_a_flipped_bit_is_found(tmp_path):
    whole = write(tmp_path / "a.mcap", compression=CompressionType.NONE, enable_data_crcs=True).read_bytes()
    end = whole.rindex(b"\x0f\x04\x00\x00\x00\x00\x00\x00\x00")  # the end of the data
    rng = np.random.default_rng(0)
    for at in rng.integers(8, end, 40):
        broken = bytearray(whole)
        broken[at] ^= 1 << int(rng.integers(8))
        (tmp_path / "broken.mcap").write_bytes(broken)
        with pytest.raises(HippodromeError):
            read_mcap(tmp_path / "broken.mcap", "body")


def chunk(data, compression, size=None):
    body = struct.pack("<QQQII", 0, 0, size if size is not None else len(data), 0, len(compression)) + compression.encode()
    packed = zstandard.ZstdCompressor().compress(data) if compression == "zstd" else data
    body += struct.pack("<Q", len(packed)) + packed
    return b"\x06" + struct.pack("<Q", len(body)) + body


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (chunk(bytes(300_000_000), "zstd"), "the limit is 134217728"),
        (chunk(bytes(50_000_000), "zstd", 1000), "unpacks to 1001 or more"),
        (b"".join([chunk(b"\x77" + struct.pack("<Q", 119_999_991) + bytes(119_999_991), "zstd")] * 10), "no log of a drive"),
        (chunk(bytes(10_000_000), "zstd"), "kind 0"),
        (chunk(b"abc", "bzip9"), "compression 'bzip9'"),
        (chunk(bytes(5000), "zstd").replace(b"\x28\xb5\x2f\xfd", b"\x28\xb5\x2f\xfe"), "mcap recover"),
        (b"\x06" + struct.pack("<Q", 10) + bytes(10), "no chunk"),
        (b"\x05" + struct.pack("<Q", 3) + bytes(3), "record 5"),
        (b"\x06" + struct.pack("<Q", 2**62), "nothing to read"),
    ],
)
def test_bombs_and_lies_about_sizes_are_refused(tmp_path, content, complaint):
    (tmp_path / "bomb.mcap").write_bytes(b"\x89MCAP0\r\n" + content)
    with pytest.raises(HippodromeError, match=complaint):
        read_mcap(tmp_path / "bomb.mcap", "body")


def test_a_bomb_in_a_ros_bag_is_refused():
    with pytest.raises(HippodromeError, match="more than 134217728"):
        _bounded(lz4.frame.LZ4FrameDecompressor(), lz4.frame.compress(bytes(140_000_000)))


def zstd_bag(folder, mode, body):
    """A ROS 2 bag of one message per topic whose bytes are ``body``, packed by message or as a whole file."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    writer = Writer2(folder, version=8)
    writer.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    with writer as bag:
        for topic, kind in (("/camera", "sensor_msgs/msg/CompressedImage"), ("/odom", "nav_msgs/msg/Odometry")):
            bag.write(bag.add_connection(topic, kind, typestore=store), 10**9, body)
    return folder


def test_messages_of_a_ros_2_bag_unpack_within_bounds(tmp_path):
    """rosbags itself knows no limit: a message of 5 kB would take 150 MB, and a thousand of them all there is."""
    with pytest.raises(HippodromeError, match="more than 134217728 bytes when unpacked"):
        read_rosbag(zstd_bag(tmp_path / "message", "MESSAGE", bytes(150_000_000)), "body")
    with _bounded_chunks(3000):
        assert rosbag2_reader.zstd.decompress(zstandard.compress(bytes(2000))) == bytes(2000)
        with pytest.raises(HippodromeError, match="it is no log of a drive"):
            rosbag2_reader.zstd.decompress(zstandard.compress(bytes(2000)))
    with pytest.raises(HippodromeError, match="ends before"), _bounded_chunks(3000):
        rosbag2_reader.zstd.decompress(zstandard.compress(bytes(2000))[:-3])


def test_the_list_of_a_ros_2_bag_is_bounded(tmp_path):
    bag = zstd_bag(tmp_path / "bag", "MESSAGE", b"x")
    lines = ["a0: &a0 [0]", *(f"a{n}: &a{n} [{', '.join(9 * [f'*a{n - 1}'])}]" for n in range(1, 9))]
    (bag / "metadata.yaml").write_text("\n".join(lines))
    with pytest.raises(HippodromeError, match="aliases and merge keys"):
        read_rosbag(bag, "body")
    (bag / "metadata.yaml").write_bytes(b"#" * 2_000_000)
    with pytest.raises(HippodromeError, match="more than 1048576 bytes"):
        read_rosbag(bag, "body")


def test_messages_that_are_none_are_named(tmp_path):
    broken = write(tmp_path / "a.mcap", change=lambda name, number, data: [b"\xff" if (name, number) == ("odom", 5) else data])
    with pytest.raises(HippodromeError, match=r"/odom at 1700000000500000000 ns: not a message of foxglove\.Odometry"):
        read_mcap(broken, "body")


def test_the_topics_that_are_used_are_said_and_can_be_chosen(tmp_path, capsys):
    path = write(tmp_path / "a.mcap")
    assert main(["import", str(path), "--topic", "/cam", "--topic", "/odom", "--out", str(tmp_path / "in")]) == DONE
    assert "images of /cam, self-motion of /odom, truth of /ground_truth" in capsys.readouterr().out
    assert main(["import", str(path), "--topic", "/nope", "--out", str(tmp_path / "no")]) == BAD_INPUT
    assert "no topic '/nope'; it has: /cam (foxglove.CompressedImage), /odom" in capsys.readouterr().err
    (tmp_path / "o.csv").write_text("0.1,5,0\n0.2,5,0\n0.3,5,0\n")
    assert main(["import", str(tmp_path / "o.csv"), "--topic", "/a", "--out", str(tmp_path / "no")]) == BAD_INPUT
    assert "--topic is for mcap and rosbag" in capsys.readouterr().err


def test_truth_of_other_axes_than_those_that_were_said(tmp_path, capsys):
    """``--axes camera`` was said of the odometry; the truth that the file has is the vehicle's."""
    drive = read_mcap(write(tmp_path / "a.mcap"), "camera")
    assert "taken so" in capsys.readouterr().out
    assert drive.truth.poses[:, 2] == pytest.approx(0.02 * np.arange(COUNT))
