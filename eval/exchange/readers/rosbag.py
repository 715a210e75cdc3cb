"""ROS 1 and ROS 2 bags, read without ROS: images, an odometry with its twist or poses, true poses."""

from __future__ import annotations

import bz2
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, cast

import lz4.frame
import rosbags.rosbag1.reader
import zstandard
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from hippodrome.core.types import HippodromeError
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import ForeignDrive
from hippodrome.eval.exchange.drives.poses import Axes
from hippodrome.eval.exchange.readers.mcap_records import (
    FREE_BYTES,
    MAGIC,
    MAX_CHUNK_BYTES,
    MAX_GROWTH,
    Reach,
    one_line,
    records,
)
from hippodrome.eval.exchange.readers.messages import (
    Kind,
    OdometryRow,
    Stamped,
    choose,
    frames_of,
    kept_image,
    motion_of_odometry,
    pose_row,
    truth_of_poses,
)
from hippodrome.eval.exchange.readers.spool import Spool

KINDS: Final[dict[str, Kind]] = {
    "sensor_msgs/msg/CompressedImage": "images",
    "sensor_msgs/msg/Image": "images",
    "nav_msgs/msg/Odometry": "odometry",
    "geometry_msgs/msg/PoseStamped": "poses",
}
CURE: Final = (
    "copy it anew; `rosbag reindex` or `ros2 bag reindex` mend an index; of a ROS 2 bag the .mcap file itself can be imported"
)


def read_rosbag(path: Path, axes: Axes, topics: Sequence[str] = ()) -> ForeignDrive:
    """Read a bag: a topic of images, one of odometry that is no truth, and the truth by its customary names, or ``topics``.

    Raises ExchangeError if the bag cannot be read, has no images, or holds more than one drive.
    """
    try:
        _require_bounded(path)
        with _bounded_chunks(), AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
            of_type = {one.topic: one.msgtype for one in bag.connections}
            chosen = choose(path, {topic: (KINDS.get(name, ""), name) for topic, name in of_type.items()}, topics)
            spool = Spool()
            frames = frames_of(_messages(path, bag, chosen.images, spool), f"{path}: {chosen.images}")
            motion, truth = None, None
            if chosen.odometry:
                motion = motion_of_odometry(_messages(path, bag, chosen.odometry, spool), f"{path}: {chosen.odometry}")
            if chosen.truth:
                truth = truth_of_poses(_messages(path, bag, chosen.truth, spool), axes, f"{path}: {chosen.truth}")
        return ForeignDrive(frames, motion, truth, None)
    except HippodromeError:
        raise
    except (Exception, MemoryError) as error:  # of many parsers, each with errors of its own
        raise ExchangeError(f"{path}: not a readable ROS bag ({type(error).__name__}: {one_line(error)}); {CURE}") from None


def _messages(path: Path, bag: AnyReader, topic: str, spool: Spool) -> list[Stamped]:
    """The messages of one topic with the header's stamp, which is the sensor's, else the time of recording."""
    found = []
    for connection, recorded, raw in bag.messages([one for one in bag.connections if one.topic == topic]):
        message: Any = bag.deserialize(raw, connection.msgtype)
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        kind, value = KINDS[connection.msgtype], cast(Any, None)
        if kind == "images":
            value = kept_image(message, spool, f"{path}: {topic} at {stamp} ns")
        elif kind == "poses":
            value = pose_row(message.pose)
        else:
            motion = message.twist.twist
            value = OdometryRow(pose_row(message.pose.pose), motion.linear.x, motion.angular.z)
        found.append(Stamped(stamp or recorded, zlib.crc32(raw), value))
    return found


def _require_bounded(path: Path) -> None:
    """Raise ExchangeError if a file of a ROS 2 bag is damaged, or unpacks to far more than it is."""
    for file in sorted(path.iterdir()) if path.is_dir() else ():
        if file.suffix == ".mcap" and _begins_with(file, MAGIC):
            for _ in records(file, Reach()):
                pass
        elif file.suffix in (".zst", ".zstd"):
            limit, count = max(FREE_BYTES, MAX_GROWTH * file.stat().st_size), 0
            with (
                file.open("rb") as stream,
                zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK_BYTES).stream_reader(stream) as plain,
            ):
                while piece := plain.read(1 << 20):
                    count += len(piece)
                    if count > limit:
                        raise ExchangeError(f"{file}: unpacked it is more than {limit} bytes; it is no log of a drive")


def _begins_with(path: Path, magic: bytes) -> bool:
    with path.open("rb") as stream:
        return stream.read(len(magic)) == magic


@contextmanager
def _bounded_chunks() -> Iterator[None]:
    """While this holds, rosbags unpacks chunks of ROS 1 bags to ``MAX_CHUNK_BYTES`` at most; its own functions know no limit."""
    known = rosbags.rosbag1.reader.decompressors
    before = dict(known)
    known["bz2"] = lambda data: _bounded(bz2.BZ2Decompressor(), data)
    known["lz4"] = lambda data: _bounded(lz4.frame.LZ4FrameDecompressor(), data)
    try:
        yield
    finally:
        known.update(before)


def _bounded(unpacker: Any, data: bytes) -> bytes:
    found: bytes = unpacker.decompress(data, max_length=MAX_CHUNK_BYTES + 1)
    if len(found) > MAX_CHUNK_BYTES:
        raise ExchangeError(f"a chunk of more than {MAX_CHUNK_BYTES} bytes when unpacked; record it with smaller chunks")
    return found
