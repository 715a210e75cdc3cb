"""MCAP files: Foxglove's messages as protobuf or JSON, ROS 2's as CDR; whole files, and those without summary or end."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeAlias

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.json_format import ParseDict
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.records import Channel, Message, Schema
from rosbags.typesys import Stores, get_typestore

from hippodrome._json import parse_json
from hippodrome.core.types import HippodromeError
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import ForeignDrive
from hippodrome.eval.exchange.drives.poses import Axes
from hippodrome.eval.exchange.readers.mcap_records import Reach, one_line, records
from hippodrome.eval.exchange.readers.messages import (
    Chosen,
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

FOXGLOVE: Final[dict[str, Any]] = {
    "foxglove.CompressedImage": CompressedImage,
    "foxglove.RawImage": RawImage,
    "foxglove.Odometry": Odometry,
    "foxglove.PoseInFrame": PoseInFrame,
}
# What messages of a schema may be used for.
KINDS: Final[dict[str, Kind]] = {
    "foxglove.CompressedImage": "images", "foxglove.RawImage": "images", "foxglove.Odometry": "odometry",
    "foxglove.PoseInFrame": "poses", "sensor_msgs/msg/CompressedImage": "images", "sensor_msgs/msg/Image": "images",
    "nav_msgs/msg/Odometry": "odometry", "geometry_msgs/msg/PoseStamped": "poses",
}  # fmt: skip
ROS: Final = get_typestore(Stores.ROS2_HUMBLE)
Decoder: TypeAlias = Callable[[bytes], Any]


@dataclass(frozen=True, slots=True)
class _Topic:
    """A channel that can be used: its topic, its schema, and how its messages are read."""

    name: str
    schema: str
    kind: Kind
    decode: Decoder


def read_mcap(path: Path, axes: Axes, topics: Sequence[str] = ()) -> ForeignDrive:
    """Read an MCAP file: a topic of images, one of odometry, and the truth by its customary names, or those of ``topics``.

    The file is gone through twice: for its topics, when all of it is verified, and for the messages. Raises ExchangeError if it
    is damaged, has no images, or holds more than one drive.
    """
    try:
        reach = Reach()
        channels, count = _channels(path, reach)
        chosen = choose(path, {topic.name: (topic.kind, topic.schema) for topic in channels.values()}, topics)
        if reach.cut:
            print(f"note: {path}: cut short: it ends at byte {path.stat().st_size}, inside of the record that begins at byte "
                  f"{reach.bytes}; the {count} messages before the cut are read")  # fmt: skip
        found = _messages(path, channels, chosen, Spool())
        motion = motion_of_odometry(found[chosen.odometry], f"{path}: {chosen.odometry}") if chosen.odometry else None
        truth = truth_of_poses(found[chosen.truth], axes, f"{path}: {chosen.truth}") if chosen.truth else None
        return ForeignDrive(frames_of(found[chosen.images], f"{path}: {chosen.images}"), motion, truth, None)
    except HippodromeError:
        raise
    except OSError as error:
        raise ExchangeError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (Exception, MemoryError) as error:  # of many parsers, each with errors of its own
        raise ExchangeError(f"{path}: not a readable MCAP file ({type(error).__name__}: {one_line(error)})") from None


def _channels(path: Path, reach: Reach) -> tuple[dict[int, _Topic], int]:
    """The channels by their number, those that cannot be used among them, and how many messages there are.

    Raises ExchangeError if the file has none, and says so if it ends before its first message.
    """
    schemas: dict[int, Schema] = {}
    found: dict[int, _Topic] = {}
    count = 0
    for record in records(path, reach):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            found[record.id] = _topic(record, schemas.get(record.schema_id))
        else:
            count += 1
    if count == 0:
        end = f"it was cut short, at byte {path.stat().st_size}: its writer was not closed" if reach.cut else "it has no messages"
        raise ExchangeError(f"{path}: nothing to read, {end}; record the drive anew")
    return found, count


def _topic(channel: Channel, schema: Schema | None) -> _Topic:
    name = schema.name if schema is not None else ""
    decode: Decoder | None = None
    if channel.message_encoding == "protobuf" and name in FOXGLOVE:
        decode = FOXGLOVE[name].FromString
    elif channel.message_encoding == "json" and name in FOXGLOVE:
        decode = partial(_of_json, FOXGLOVE[name])
    elif channel.message_encoding == "cdr" and name in KINDS:
        decode = partial(ROS.deserialize_cdr, typename=name)
    if decode is None:
        return _Topic(channel.topic, f"{name or 'no schema'}, {channel.message_encoding or 'no encoding'}", "", bytes)
    return _Topic(channel.topic, name, KINDS[name], decode)


def _of_json(kind: Any, data: bytes) -> Any:
    """A message of Foxglove's JSON schemas, whose fields are those of its protobuf; times are {sec, nsec} or ISO 8601."""
    return ParseDict(_with_dates(parse_json(data)), kind(), ignore_unknown_fields=True)


def _with_dates(value: Any) -> Any:
    if isinstance(value, dict):
        if value.keys() == {"sec", "nsec"}:
            return Timestamp(seconds=int(value["sec"]), nanos=int(value["nsec"])).ToJsonString()
        return {name: _with_dates(inner) for name, inner in value.items()}
    return [_with_dates(inner) for inner in value] if isinstance(value, list) and value and isinstance(value[0], dict) else value


def _messages(path: Path, channels: Mapping[int, _Topic], chosen: Chosen, spool: Spool) -> dict[str | None, list[Stamped]]:
    """The messages of the chosen topics by topic, in the order of the file's clock; images lie in the spool."""
    found: dict[str | None, list[tuple[int, Stamped]]] = {name: [] for name in (chosen.images, chosen.odometry, chosen.truth)}
    for record in records(path, Reach()):
        if not isinstance(record, Message):
            continue
        topic = channels.get(record.channel_id)
        if topic is None or topic.name not in found or not topic.kind:
            continue
        name = f"{path}: {topic.name} at {record.log_time} ns"
        if not record.data:  # protobuf would take it for a message whose every number is 0
            raise ExchangeError(f"{name}: a message of no bytes; `mcap filter` cuts it out, or record the drive anew")
        try:
            message = topic.decode(record.data)
        except Exception as error:  # every decoder has its own
            raise ExchangeError(f"{name}: not a message of {topic.schema} ({type(error).__name__}: {one_line(error)})") from None
        stamped = Stamped(_stamp(message) or record.log_time, zlib.crc32(record.data), _value(topic, message, spool, name))
        found[topic.name].append((record.log_time, stamped))
    return {name: [one for _, one in sorted(rows, key=lambda row: row[0])] for name, rows in found.items()}


def _value(topic: _Topic, message: Any, spool: Spool, name: str) -> Any:
    if topic.kind == "images":
        return kept_image(message, spool, name)
    if topic.kind == "poses":
        return pose_row(message.pose)
    if hasattr(message, "twist"):  # ROS
        motion = message.twist.twist
        return OdometryRow(pose_row(message.pose.pose), motion.linear.x, motion.angular.z)
    return OdometryRow(pose_row(message.pose), message.linear_velocity.x, message.angular_velocity.z)


def _stamp(message: Any) -> int:
    """The message's own time in nanoseconds, which is the sensor's; 0 where it was not filled in."""
    if hasattr(message, "header"):
        return int(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)
    return int(message.timestamp.seconds * 10**9 + message.timestamp.nanos)
