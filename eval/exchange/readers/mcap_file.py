"""MCAP files with Foxglove's protobuf messages: images, an odometry with velocities, poses."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf.message import DecodeError
from mcap.exceptions import McapError
from mcap.reader import McapReader, make_reader
from mcap_protobuf.decoder import DecoderFactory

from hippodrome.core.types import FloatArray, Trajectory
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import (
    ForeignDrive,
    ForeignFrame,
    Motion,
    motion_table,
    trajectory_of,
)
from hippodrome.eval.exchange.drives.poses import Axes
from hippodrome.eval.exchange.readers.messages import TRUTH_TOPICS, png_of, told, without_repeats
from hippodrome.eval.exchange.readers.spool import Spool

IMAGES = ("foxglove.CompressedImage", "foxglove.RawImage")
ODOMETRY, POSE = "foxglove.Odometry", "foxglove.PoseInFrame"


def read_mcap(path: Path, axes: Axes) -> ForeignDrive:
    """Read an MCAP file: the first topic of images, the first of odometry, and the truth by its customary names.

    Raises ExchangeError if the file cannot be read or has no images.
    """
    try:
        with path.open("rb") as stream:
            topics = _topics(make_reader(stream), path)
            images = next((topic for topic, kind in topics.items() if kind in IMAGES), None)
            if images is None:
                raise ExchangeError(f"{path}: no topic of {' or '.join(IMAGES)}; it has: {_listed(topics)}")
            odometry = next((topic for topic, kind in topics.items() if kind == ODOMETRY), None)
            truth = next((topic for topic in TRUTH_TOPICS if topics.get(topic) in (POSE, ODOMETRY)), None)
            others = [topic for topic, kind in topics.items() if kind in IMAGES and topic != images]
            told(path, images, others, odometry, truth)
            spool = Spool()
            frames = [_frame(path, images, stamp, message, spool) for stamp, message in _messages(stream, images)]
            motion = (
                _motion(path, odometry, without_repeats(list(_messages(stream, odometry)), f"{path}: {odometry}"))
                if odometry
                else None
            )
            poses = (
                _poses(path, truth, without_repeats(list(_messages(stream, truth)), f"{path}: {truth}"), axes) if truth else None
            )
    except OSError as error:
        raise ExchangeError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (McapError, DecodeError, struct.error, ValueError, KeyError, TypeError, MemoryError, EOFError) as error:
        raise ExchangeError(f"{path}: not a readable MCAP file ({type(error).__name__}: {_one_line(error)})") from None
    return ForeignDrive(frames, motion, poses, None)


def _topics(reader: McapReader, path: Path) -> dict[str, str]:
    """The schema of each topic, by the topic's name, in the order of the file's channels."""
    summary = reader.get_summary()
    if summary is None:
        raise ExchangeError(f"{path}: no summary in it, so it was cut short; repair it with `mcap recover`")
    return {
        channel.topic: summary.schemas[channel.schema_id].name
        for channel in sorted(summary.channels.values(), key=lambda channel: channel.id)
        if channel.schema_id in summary.schemas
    }


def _messages(stream: Any, topic: str) -> Iterator[tuple[int, Any]]:
    """Time in nanoseconds and message of one topic: the message's own time stamp or, without one, the log's."""
    stream.seek(0)
    reader = make_reader(stream, decoder_factories=[DecoderFactory()])
    for decoded in reader.iter_decoded_messages(topics=[topic]):
        message = decoded.decoded_message
        stamp = message.timestamp.seconds * 10**9 + message.timestamp.nanos
        yield stamp or decoded.message.log_time, message


def _frame(path: Path, topic: str, stamp: int, message: Any, spool: Spool) -> ForeignFrame:
    name = f"{path}: {topic} at {stamp} ns"
    if hasattr(message, "format"):
        return ForeignFrame(stamp / 1e9, name, spool.keep(bytes(message.data)))
    png = png_of(message.data, message.encoding, message.width, message.height, message.step, name)
    return ForeignFrame(stamp / 1e9, name, spool.keep(png))


def _motion(path: Path, topic: str, messages: list[tuple[int, Any]]) -> Motion:
    t_s, speed = _times(messages), np.array([message.linear_velocity.x for _, message in messages])
    return motion_table(t_s, speed, np.array([message.angular_velocity.z for _, message in messages]), f"{path}: {topic}")


def _poses(path: Path, topic: str, messages: list[tuple[int, Any]], axes: Axes) -> Trajectory:
    poses = [message.pose for _, message in messages]
    positions = np.array([(pose.position.x, pose.position.y, pose.position.z) for pose in poses])
    quaternions = np.array([(pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w) for pose in poses])
    return trajectory_of(_times(messages), positions, quaternions, axes, f"{path}: {topic}")


def _times(messages: list[tuple[int, Any]]) -> FloatArray:
    return np.array([stamp for stamp, _ in messages]) / 1e9


def _listed(topics: dict[str, str]) -> str:
    return ", ".join(f"{topic} ({kind})" for topic, kind in topics.items())[:300] or "none"


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())[:120]
