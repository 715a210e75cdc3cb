"""Logs become recordings: MCAP files and ROS bags that are whole, cut, broken, or lie about their images."""

import shutil

import numpy as np
import pytest

from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import BAD_INPUT, DONE
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import ForeignFrame
from hippodrome.eval.exchange.drives.images import decode
from hippodrome.eval.exchange.readers.messages import CHANNELS, png_of, without_repeats
from hippodrome.sim.recording import open_recording
from tests.eval.exchange.results import imported


@pytest.mark.parametrize("keep", [0, 8, 2000])
def test_a_broken_mcap(exported, tmp_path, capsys, keep):
    pytest.importorskip("mcap")
    blob = (exported("mcap") / "hamlet-mapping.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(blob[:keep])
    assert imported(tmp_path / "cut.mcap", "mcap", tmp_path / "in") == BAD_INPUT
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "cut.mcap" in line


def test_an_mcap_whose_index_is_cut_off_is_whole(run, exported, tmp_path):
    pytest.importorskip("mcap")
    blob = (exported("mcap") / "hamlet-mapping.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(blob[:-100])
    assert imported(tmp_path / "cut.mcap", "mcap", tmp_path / "in") == DONE
    assert open_recording(tmp_path / "in").frame_count == run.mapping.frame_count


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8", "mono8", "rgba8", "bgra8"])
def test_raw_images_with_padded_rows(encoding):
    image = np.random.default_rng(1).integers(0, 256, (16, 20, CHANNELS[encoding]), dtype=np.uint8)
    rows = np.zeros((16, 96), np.uint8)
    rows[:, : image[0].size] = image.reshape(16, -1)
    found = decode(ForeignFrame(0.0, "test", lambda: png_of(rows.tobytes(), encoding, 20, 16, 96, "test")))
    expected = (
        image[:, :, 2::-1]
        if encoding.startswith("bgr")
        else image[:, :, :3]
        if encoding.startswith("rgb")
        else np.broadcast_to(image, (16, 20, 3))
    )
    assert np.array_equal(found, expected)


@pytest.mark.parametrize(
    ("encoding", "width", "step", "complaint"),
    [
        ("bayer", 20, 60, "encoding 'bayer'"),
        ("rgb8", 20, 59, "do not hold"),
        ("rgb8", 2**30, 2**32, "do not hold"),
        ("mono8", 0, 9, "do not"),
    ],
)
def test_raw_images_that_lie_about_their_size(encoding, width, step, complaint):
    with pytest.raises(ExchangeError, match=complaint):
        png_of(bytes(100), encoding, width, 16, step, "bag: /image at 5 ns")


@pytest.mark.parametrize("name", ["metadata.yaml", "hamlet-mapping.mcap"])
@pytest.mark.parametrize("content", [None, b"", b"{"])
def test_a_broken_bag(exported, tmp_path, capsys, name, content):
    pytest.importorskip("mcap")
    bag = tmp_path / "bag"
    shutil.copytree(exported("rosbag2") / "hamlet-mapping", bag)
    (bag / name).unlink()
    if content is not None:
        (bag / name).write_bytes(content)
    assert imported(bag, "rosbag", tmp_path / "in") == BAD_INPUT
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "not a readable ROS bag" in line or "metadata.yaml:1: not valid YAML" in line


def test_messages_that_repeat_a_time_are_counted(capsys):
    assert without_repeats([(1, "a"), (2, "b"), (2, "c"), (3, "d")], "bag: /odom") == [(1, "a"), (2, "b"), (3, "d")]
    assert "bag: /odom: 1 message(s)" in capsys.readouterr().out


def odometry_bag(path, twisted):
    """A ROS 1 bag of frames, and an odometry whose poses drive 0.5 m ahead each 0.1 s; its twist says so, or is all zeros."""
    rosbag1, typesys = pytest.importorskip("rosbags.rosbag1"), pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    of = {name.split("/")[-1]: kind for name, kind in store.types.items()}
    zeros = np.zeros(36)

    def header(number):
        return of["Header"](number, store.types["builtin_interfaces/msg/Time"](100, number * 10**8), "base")

    with rosbag1.Writer(path) as writer:
        for topic, name in (("/rear", "Image"), ("/front", "Image"), ("/odom", "Odometry")):
            kind = f"{'sensor_msgs' if name == 'Image' else 'nav_msgs'}/msg/{name}"
            connection = writer.add_connection(topic, kind, typestore=store)
            for number in range(9):
                if name == "Image":
                    message = store.types[kind](header(number), 16, 16, "bgra8", 0, 64, np.zeros(1024, np.uint8))
                else:
                    pose = of["Pose"](of["Point"](0.5 * number, 0.0, 0.0), of["Quaternion"](0.0, 0.0, 0.0, 1.0))
                    twist = of["Twist"](of["Vector3"](5.0 * twisted, 0.0, 0.0), of["Vector3"](0.0, 0.0, 0.0))
                    with_zeros = of["PoseWithCovariance"](pose, zeros), of["TwistWithCovariance"](twist, zeros)
                    message = store.types[kind](header(number), "base", *with_zeros)
                writer.write(connection, 100 * 10**9 + number * 10**8, store.serialize_ros1(message, kind))


@pytest.mark.parametrize("twisted", [True, False])
def test_an_odometry_without_velocities_is_differentiated_and_the_topics_are_named(tmp_path, capsys, twisted):
    odometry_bag(tmp_path / "a.bag", twisted)
    assert main(["import", str(tmp_path / "a.bag"), "--out", str(tmp_path / "in")]) == DONE
    said = capsys.readouterr().out
    assert ("the poses are differentiated" in said) != twisted
    assert "images of /rear (not of /front)" in said
    assert open_recording(tmp_path / "in").samples.speed == pytest.approx(5.0)
