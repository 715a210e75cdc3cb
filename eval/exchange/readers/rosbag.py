"""ROS 1 and ROS 2 bags, read without ROS: images, an odometry with its twist or poses, true poses."""

from __future__ import annotations

import bz2
import sqlite3
import zlib
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final, cast
from urllib.parse import quote

import lz4.frame
import rosbags.rosbag1.reader
import rosbags.rosbag2.reader
import rosbags.rosbag2.storage_mcap
import zstandard
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from hippodrome._files import open_regular, read_bounded
from hippodrome.core.types import HippodromeError
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import ForeignDrive
from hippodrome.eval.exchange.drives.poses import Axes
from hippodrome.eval.exchange.readers.mcap_records import (
    FREE_BYTES,
    MAGIC,
    MAX_CHUNK_BYTES,
    MAX_GROWTH,
    MAX_RECORD_BYTES,
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
from hippodrome.eval.exchange.readers.text import read_values
from hippodrome.sim.yaml_file import MAX_BYTES

KINDS: Final[dict[str, Kind]] = {
    "sensor_msgs/msg/CompressedImage": "images",
    "sensor_msgs/msg/Image": "images",
    "nav_msgs/msg/Odometry": "odometry",
    "geometry_msgs/msg/PoseStamped": "poses",
}
SQLITE_MAGIC: Final = b"SQLite format 3\0"
ZSTD_MAGIC: Final = b"\x28\xb5\x2f\xfd"
CURE: Final = (
    "copy it anew; `rosbag reindex` or `ros2 bag reindex` mend an index; of a ROS 2 bag the .mcap file itself can be imported"
)


def read_rosbag(path: Path, axes: Axes, topics: Sequence[str] = ()) -> ForeignDrive:
    """Read a bag: a topic of images, one of odometry that is no truth, and the truth by its customary names, or ``topics``.

    Raises ExchangeError if the bag cannot be read, has no images, or holds more than one drive.
    """
    try:
        _require_bounded(path)
        with _bounded_chunks(_most_bytes(path)), AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
            _require_small_chunks(path, bag)
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
    """Raise ExchangeError if a file of a bag is none, or, of a ROS 2 bag, is damaged or unpacks to far more than it is."""
    for file in sorted(path.iterdir()) if path.is_dir() else [path]:
        if not file.is_file() and not file.is_dir():  # the reader would wait for ever for what a named pipe will bring
            raise ExchangeError(f"{file}: not a regular file, or not there; copy the bag anew")
    if path.is_dir() and (listed := path / "metadata.yaml").exists():
        read_values(listed, read_bounded(listed, MAX_BYTES).decode("utf-8"))  # its aliases make no more than a bag has
    for file in sorted(path.iterdir()) if path.is_dir() else ():
        if not file.is_file():
            continue
        if _begins_with(file, MAGIC):
            for _ in records(file, Reach()):
                pass
        elif _begins_with(file, SQLITE_MAGIC):
            _require_small_rows(file)
        elif _begins_with(file, ZSTD_MAGIC):
            limit, count = _most_bytes(file), 0
            with (
                file.open("rb") as stream,
                zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK_BYTES).stream_reader(stream) as plain,
            ):
                while piece := plain.read(1 << 20):
                    count += len(piece)
                    if count > limit:
                        raise ExchangeError(f"{file}: unpacked it is more than {limit} bytes; it is no log of a drive")


def _require_small_rows(file: Path) -> None:
    """Raise ExchangeError if a row of a bag's database holds more than a message may; it is measured, not read."""
    with suppress(sqlite3.Error), closing(sqlite3.connect(f"file:{quote(str(file))}?immutable=1", uri=True)) as database:
        if database.execute("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = 'messages'").fetchone() is None:
            return  # the reader says what is missing; a view, whose rows would be computed, is refused by it as well
        wrong = "SELECT rowid FROM messages WHERE typeof(data) <> 'blob' OR length(data) > ? LIMIT 1"
        if (row := database.execute(wrong, (MAX_RECORD_BYTES,)).fetchone()) is not None:
            raise ExchangeError(f"{file}: message {row[0]} is no message, or has more than {MAX_RECORD_BYTES} bytes; {CURE}")
        (lost,) = database.execute("SELECT count(*) FROM messages WHERE topic_id NOT IN (SELECT id FROM topics)").fetchone()
        if lost:
            raise ExchangeError(f"{file}: {lost} message(s) of topics that it does not describe; {CURE}")


def _require_small_chunks(path: Path, bag: AnyReader) -> None:
    """Raise ExchangeError if a chunk of a ROS 1 bag is larger than it may be, packed or not; none has been read by then."""
    sizes = [chunk.datasize for reader in bag.readers for chunk in getattr(reader, "chunks", {}).values()]
    if (largest := max(sizes, default=0)) > MAX_RECORD_BYTES:
        raise ExchangeError(f"{path}: a chunk of {largest} bytes, the limit is {MAX_RECORD_BYTES}; record it with smaller chunks")


def _begins_with(path: Path, magic: bytes) -> bool:
    with open_regular(path) as stream:
        return stream.read(len(magic)) == magic


def _most_bytes(path: Path) -> int:
    """How much a file, or the files of a folder, may unpack to."""
    files = [one for one in path.iterdir() if one.is_file()] if path.is_dir() else [path]
    return max(FREE_BYTES, MAX_GROWTH * sum(one.stat().st_size for one in files))


@contextmanager
def _bounded_chunks(most_bytes: int) -> Iterator[None]:
    """While this holds, rosbags unpacks no chunk and no message to more than ``MAX_CHUNK_BYTES``, and all messages of a ROS 2 bag
    to no more than ``most_bytes``; its own functions know no limit.
    """
    reader: Any = rosbags.rosbag2.reader
    one, two, unpacked = rosbags.rosbag1.reader.decompressors, rosbags.rosbag2.storage_mcap.DECOMPRESSORS, [0]
    before, before_two, zstd = dict(one), dict(two), reader.zstd

    def message(data: bytes) -> bytes:
        found = _bounded(zstd.ZstdDecompressor(), data)
        unpacked[0] += len(found)
        if unpacked[0] > most_bytes:
            raise ExchangeError(f"its messages unpack to more than {most_bytes} bytes; it is no log of a drive")
        return found

    one["bz2"] = lambda data: _bounded(bz2.BZ2Decompressor(), data)
    one["lz4"] = two_lz4 = lambda data, _=0: _bounded(lz4.frame.LZ4FrameDecompressor(), data)
    two.update({"lz4": two_lz4, "zstd": lambda data, _: _bounded(zstd.ZstdDecompressor(), data)})
    reader.zstd = SimpleNamespace(open=zstd.open, decompress=message)
    try:
        yield
    finally:
        one.update(before)
        two.update(before_two)
        reader.zstd = zstd


def _bounded(unpacker: Any, data: bytes) -> bytes:
    found: bytes = unpacker.decompress(data, max_length=MAX_CHUNK_BYTES + 1)
    if len(found) > MAX_CHUNK_BYTES:
        raise ExchangeError(f"a chunk of more than {MAX_CHUNK_BYTES} bytes when unpacked; record it with smaller chunks")
    if not unpacker.eof:
        raise ExchangeError("a chunk ends before what is packed in it does; copy the bag anew")
    return found
