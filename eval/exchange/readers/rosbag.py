"""ROS 1 and ROS 2 bags, read without ROS: images, an odometry with its twist, poses."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.typesys import Stores, get_typestore

from hippodrome.core.types import Trajectory
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import (
    ForeignDrive,
    ForeignFrame,
    Motion,
    motion_of,
    motion_table,
    trajectory_of,
)
from hippodrome.eval.exchange.drives.poses import Axes
from hippodrome.eval.exchange.readers.messages import TRUTH_TOPICS, png_of, told, without_repeats
from hippodrome.eval.exchange.readers.spool import Spool

COMPRESSED, RAW = "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"
ODOMETRY, POSE = "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped"


def read_rosbag(path: Path, axes: Axes) -> ForeignDrive:
    """Read a bag: the first topic of images, the first of odometry that is no truth, and the truth by its customary names.

    Raises ExchangeError if the bag cannot be read or has no images.
    """
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
            topics = {one.topic: one.msgtype for one in bag.connections}
            images = next((topic for topic, kind in topics.items() if kind in (COMPRESSED, RAW)), None)
            if images is None:
                listed = ", ".join(f"{topic} ({kind})" for topic, kind in topics.items())[:300] or "none"
                raise ExchangeError(f"{path}: no topic of {COMPRESSED} or {RAW}; it has: {listed}")
            truth = next((topic for topic in TRUTH_TOPICS if topics.get(topic) in (POSE, ODOMETRY)), None)
            odometry = next((topic for topic, kind in topics.items() if kind == ODOMETRY and topic != truth), None)
            others = [topic for topic, kind in topics.items() if kind in (COMPRESSED, RAW) and topic != images]
            told(path, images, others, odometry, truth)
            spool = Spool()
            frames = [_frame(path, images, stamp, message, spool) for stamp, message in _messages(bag, images)]
            motion = (
                _motion(path, odometry, without_repeats(list(_messages(bag, odometry)), f"{path}: {odometry}"))
                if odometry
                else None
            )
            poses = _poses(path, truth, without_repeats(list(_messages(bag, truth)), f"{path}: {truth}"), axes) if truth else None
    except (AnyReaderError, OSError, struct.error, ValueError, KeyError, TypeError, IndexError, MemoryError, EOFError) as error:
        said = " ".join(str(error).split())[:120]
        raise ExchangeError(f"{path}: not a readable ROS bag ({type(error).__name__}: {said})") from None
    return ForeignDrive(frames, motion, poses, None)


def _messages(bag: AnyReader, topic: str) -> Iterator[tuple[int, Any]]:
    """Time in nanoseconds and message of one topic: the header's stamp, which is the sensor's, else the time of recording."""
    for connection, recorded, raw in bag.messages([one for one in bag.connections if one.topic == topic]):
        message: Any = bag.deserialize(raw, connection.msgtype)
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        yield stamp or recorded, message


def _frame(path: Path, topic: str, stamp: int, message: Any, spool: Spool) -> ForeignFrame:
    name = f"{path}: {topic} at {stamp} ns"
    if hasattr(message, "format"):
        return ForeignFrame(stamp / 1e9, name, spool.keep(bytes(message.data)))
    png = png_of(bytes(message.data), message.encoding, message.width, message.height, message.step, name)
    return ForeignFrame(stamp / 1e9, name, spool.keep(png))


def _motion(path: Path, topic: str, messages: list[tuple[int, Any]]) -> Motion:
    twists = [message.twist.twist for _, message in messages]
    t_s = np.array([stamp for stamp, _ in messages]) / 1e9
    speed, yaw_rate = np.array([one.linear.x for one in twists]), np.array([one.angular.z for one in twists])
    if len(messages) > 2 and not speed.any() and not yaw_rate.any():
        poses = _poses(path, topic, messages, "body")
        if np.ptp(poses.poses[:, :2], axis=0).max() > 0.0:
            print(f"{path}: {topic}: its velocities are all 0 while its poses move: the poses are differentiated")
            return motion_of(poses, f"{path}: {topic}")
    return motion_table(t_s, speed, yaw_rate, f"{path}: {topic}")


def _poses(path: Path, topic: str, messages: list[tuple[int, Any]], axes: Axes) -> Trajectory:
    poses = [message.pose.pose if hasattr(message.pose, "pose") else message.pose for _, message in messages]
    positions = np.array([(pose.position.x, pose.position.y, pose.position.z) for pose in poses])
    quaternions = np.array([(pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w) for pose in poses])
    t_s = np.array([stamp for stamp, _ in messages]) / 1e9
    return trajectory_of(t_s, positions, quaternions, axes, f"{path}: {topic}")
