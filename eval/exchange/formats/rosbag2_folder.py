"""ROS 2 bags: one a drive, for ``ros2 bag play``, ``evo_traj bag2`` and whatever reads them without ROS."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from hippodrome.core.types import FloatArray, Trajectory
from hippodrome.eval.exchange.drives.camera import pictures
from hippodrome.eval.exchange.drives.exported import ExportedDrive
from hippodrome.eval.exchange.drives.poses import nanoseconds, quaternions
from hippodrome.eval.exchange.drives.scene import (
    CAMERA_FRAME,
    NETWORK_FRAME,
    VEHICLE_FRAME,
    frame_id,
)
from hippodrome.eval.methods.stages import dead_reckoning

CONVENTIONS = (
    "a bag (MCAP storage) a drive; messages of ROS 2 Humble; time: whole nanoseconds from the start of the drive; doubles, exact",
    "/camera/image/compressed: PNG as recorded; /odometry: twist as sensed, map units/s, pose integrated from it",
    "/ground_truth, /estimate/METHOD: geometry_msgs/PoseStamped; network: metres; own/METHOD: map units from own start",
)
IMAGE, ODOMETRY, TRUTH = "/camera/image/compressed", "/odometry", "/ground_truth"
ROS = get_typestore(Stores.ROS2_HUMBLE)
FORMAT_VERSION: Final = 8  # version of the bag's metadata that ROS 2 Humble and later read


def write(drives: Sequence[ExportedDrive], folder: Path) -> None:
    """Write one bag for each drive."""
    for drive in drives:
        streams = [_images(drive), _odometry(drive)]
        if drive.truth is not None:
            streams.append(_poses(TRUTH, NETWORK_FRAME, drive.truth))
        for method, estimate in drive.estimates.items():
            streams.append(_poses(f"/estimate/{_ros_name(method)}", frame_id(drive, method), estimate.trajectory))
        with Writer(folder / drive.name, version=FORMAT_VERSION, storage_plugin=StoragePlugin.MCAP) as bag:
            known: dict[str, Any] = {}
            for stamp, topic, kind, message in heapq.merge(*streams, key=lambda event: event[0]):
                if topic not in known:
                    known[topic] = bag.add_connection(topic, kind, typestore=ROS)
                bag.write(known[topic], stamp, ROS.serialize_cdr(message, kind))


def _images(drive: ExportedDrive) -> Iterator[tuple[int, str, str, Any]]:
    for picture in pictures(drive.recording):
        stamp, kind = _stamp(picture.t_s), "sensor_msgs/msg/CompressedImage"
        yield stamp, IMAGE, kind, ROS.types[kind](_header(stamp, CAMERA_FRAME), "png", np.frombuffer(picture.left, np.uint8))


def _odometry(drive: ExportedDrive) -> Iterator[tuple[int, str, str, Any]]:
    samples, kind, unknown = drive.recording.samples, "nav_msgs/msg/Odometry", np.zeros(36)
    reckoned, _ = dead_reckoning(drive.recording.self_motion())
    vector = ROS.types["geometry_msgs/msg/Vector3"]
    for t_s, pose, speed, yaw_rate in zip(samples.t_s, reckoned.poses, samples.speed, samples.yaw_rate_radps, strict=True):
        stamp = _stamp(t_s)
        motion = ROS.types["geometry_msgs/msg/Twist"](vector(float(speed), 0.0, 0.0), vector(0.0, 0.0, float(yaw_rate)))
        twist = ROS.types["geometry_msgs/msg/TwistWithCovariance"](motion, unknown)
        place = ROS.types["geometry_msgs/msg/PoseWithCovariance"](_pose(pose), unknown)
        yield stamp, ODOMETRY, kind, ROS.types[kind](_header(stamp, "own/dead-reckoning"), VEHICLE_FRAME, place, twist)


def _poses(topic: str, frame: str, trajectory: Trajectory) -> Iterator[tuple[int, str, str, Any]]:
    kind = "geometry_msgs/msg/PoseStamped"
    for t_s, pose in zip(trajectory.t_s, trajectory.poses, strict=True):
        stamp = _stamp(t_s)
        yield stamp, topic, kind, ROS.types[kind](_header(stamp, frame), _pose(pose))


def _ros_name(method: str) -> str:
    """A method's name without the hyphens and dots that ROS names must not have."""
    return "".join(letter if letter.isalnum() else "_" for letter in method)


def _pose(pose: FloatArray) -> Any:
    point = ROS.types["geometry_msgs/msg/Point"](float(pose[0]), float(pose[1]), 0.0)
    x, y, z, w = (float(value) for value in quaternions(pose[None])[0])
    return ROS.types["geometry_msgs/msg/Pose"](point, ROS.types["geometry_msgs/msg/Quaternion"](x, y, z, w))


def _header(stamp: int, frame: str) -> Any:
    time = ROS.types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
    return ROS.types["std_msgs/msg/Header"](time, frame)


def _stamp(t_s: float) -> int:
    return int(nanoseconds(np.array(t_s)))
