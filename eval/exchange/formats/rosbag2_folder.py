"""ROS 2 bags: one a drive, for ``ros2 bag play``, ``evo_traj bag2`` and whatever reads them without ROS."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from hippodrome.core.types import FloatArray, Trajectory
from hippodrome.eval.exchange.drives.camera import camera_in_body, camera_of, intrinsics, pictures, right_in_left
from hippodrome.eval.exchange.drives.exported import ExportedDrive
from hippodrome.eval.exchange.drives.poses import matrices, nanoseconds, quaternions
from hippodrome.eval.exchange.drives.scene import CAMERA_FRAME, NETWORK_FRAME, VEHICLE_FRAME, frame_id, own_frames
from hippodrome.eval.methods.stages import dead_reckoning

CONVENTIONS = (
    "a bag (MCAP storage) a drive; messages of ROS 2 Humble; time: whole nanoseconds from the start of the drive (of an imported "
    "one: of its source's clock); doubles, exact",
    "/camera/image/compressed: PNG as recorded; /camera/camera_info with each of them, where the field of view is known (right: "
    "/camera_right); /odometry: twist as sensed, map units/s, pose integrated from it",
    "/ground_truth, /estimate/METHOD: geometry_msgs/PoseStamped; network: metres; own/METHOD: map units from own start",
    "/tf: network -> vehicle (rear axle), the truth; /tf_static: vehicle -> camera, network -> own/METHOD, as it lies",
)
IMAGE, INFO = "/camera/image/compressed", "/camera/camera_info"
RIGHT_IMAGE, RIGHT_INFO = "/camera_right/image/compressed", "/camera_right/camera_info"
ODOMETRY, TRUTH, TF, TF_STATIC = "/odometry", "/ground_truth", "/tf", "/tf_static"
ROS = get_typestore(Stores.ROS2_HUMBLE)
FORMAT_VERSION: Final = 8  # version of the bag's metadata that ROS 2 Humble and later read
RIGHT_CAMERA_FRAME: Final = "camera_right"
# Who subscribes later gets the static transforms, too, as tf2 expects; without this `ros2 bag play` would offer them but once.
NEVER: Final = QosTime(0, 0)
LATCHED: Final = Qos(QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL, NEVER, NEVER,
                     QosLiveliness.AUTOMATIC, NEVER, False)  # fmt: skip

Event: TypeAlias = tuple[int, str, str, Any]  # nanoseconds, topic, type, message


def write(drives: Sequence[ExportedDrive], folder: Path) -> None:
    """Write one bag for each drive."""
    for drive in drives:
        origin_ns = drive.origin_ns()
        streams = [_static(drive, origin_ns), _images(drive, origin_ns), _odometry(drive, origin_ns)]
        if drive.truth is not None:
            streams += [_poses(TRUTH, NETWORK_FRAME, drive.truth, origin_ns), _vehicle(drive.truth, origin_ns)]
        for method, estimate in drive.estimates.items():
            topic = f"/estimate/{_ros_name(method)}"
            streams.append(_poses(topic, frame_id(drive, method), estimate.trajectory, origin_ns))
        with Writer(folder / drive.name, version=FORMAT_VERSION, storage_plugin=StoragePlugin.MCAP) as bag:
            known: dict[str, Any] = {}
            for stamp, topic, kind, message in heapq.merge(*streams, key=lambda event: event[0]):
                if topic not in known:
                    latched = [LATCHED] if topic == TF_STATIC else []
                    known[topic] = bag.add_connection(topic, kind, typestore=ROS, offered_qos_profiles=latched)
                bag.write(known[topic], stamp, ROS.serialize_cdr(message, kind))


def _static(drive: ExportedDrive, origin_ns: int) -> Iterator[Event]:
    """Where the cameras sit, and where the methods' own frames lie."""
    camera = camera_of(drive.recording)
    in_body = camera_in_body(camera)
    found = [_transform(origin_ns, VEHICLE_FRAME, CAMERA_FRAME, in_body)]
    if camera is not None and camera.stereo_baseline_m:
        found.append(_transform(origin_ns, CAMERA_FRAME, RIGHT_CAMERA_FRAME, right_in_left(camera)))
    found += [_transform(origin_ns, NETWORK_FRAME, name, _matrix(pose)) for name, pose in own_frames(drive).items()]
    yield origin_ns, TF_STATIC, "tf2_msgs/msg/TFMessage", ROS.types["tf2_msgs/msg/TFMessage"](found)


def _vehicle(truth: Trajectory, origin_ns: int) -> Iterator[Event]:
    kind = "tf2_msgs/msg/TFMessage"
    for t_s, pose in zip(truth.t_s, truth.poses, strict=True):
        stamp = _stamp(t_s, origin_ns)
        yield stamp, TF, kind, ROS.types[kind]([_transform(stamp, NETWORK_FRAME, VEHICLE_FRAME, _matrix(pose))])


def _images(drive: ExportedDrive, origin_ns: int) -> Iterator[Event]:
    kind = "sensor_msgs/msg/CompressedImage"
    for picture in pictures(drive.recording):
        stamp = _stamp(picture.t_s, origin_ns)
        for topic, info, frame, png in (
            (IMAGE, INFO, CAMERA_FRAME, picture.left),
            (RIGHT_IMAGE, RIGHT_INFO, RIGHT_CAMERA_FRAME, picture.right),
        ):
            if png is not None:
                yield stamp, topic, kind, ROS.types[kind](_header(stamp, frame), "png", np.frombuffer(png, np.uint8))
                yield from _info(drive, stamp, info, frame)


def _info(drive: ExportedDrive, stamp: int, topic: str, frame: str) -> Iterator[Event]:
    """The camera's calibration at the time of a frame; nothing where it is unknown. The frames have no distortion."""
    camera = camera_of(drive.recording)
    if camera is None:
        return
    pinhole, kind = intrinsics(camera), "sensor_msgs/msg/CameraInfo"
    projection = np.hstack([pinhole, np.zeros((3, 1))])
    if frame == RIGHT_CAMERA_FRAME:
        projection[0, 3] = -pinhole[0, 0] * right_in_left(camera)[0, 3]
    whole = ROS.types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    yield stamp, topic, kind, ROS.types[kind](
        _header(stamp, frame), camera.height, camera.width, "plumb_bob", np.zeros(5), pinhole.ravel(), np.eye(3).ravel(),
        projection.ravel(), 0, 0, whole)  # fmt: skip


def _odometry(drive: ExportedDrive, origin_ns: int) -> Iterator[Event]:
    samples, kind, unknown = drive.recording.samples, "nav_msgs/msg/Odometry", np.zeros(36)
    reckoned, _ = dead_reckoning(drive.recording.self_motion())
    vector = ROS.types["geometry_msgs/msg/Vector3"]
    for t_s, pose, speed, yaw_rate in zip(samples.t_s, reckoned.poses, samples.speed, samples.yaw_rate_radps, strict=True):
        stamp = _stamp(t_s, origin_ns)
        motion = ROS.types["geometry_msgs/msg/Twist"](vector(float(speed), 0.0, 0.0), vector(0.0, 0.0, float(yaw_rate)))
        twist = ROS.types["geometry_msgs/msg/TwistWithCovariance"](motion, unknown)
        place = ROS.types["geometry_msgs/msg/PoseWithCovariance"](_pose(pose), unknown)
        yield stamp, ODOMETRY, kind, ROS.types[kind](_header(stamp, "own/dead-reckoning"), VEHICLE_FRAME, place, twist)


def _poses(topic: str, frame: str, trajectory: Trajectory, origin_ns: int) -> Iterator[Event]:
    kind = "geometry_msgs/msg/PoseStamped"
    for t_s, pose in zip(trajectory.t_s, trajectory.poses, strict=True):
        stamp = _stamp(t_s, origin_ns)
        yield stamp, topic, kind, ROS.types[kind](_header(stamp, frame), _pose(pose))


def _ros_name(method: str) -> str:
    """A method's name without the hyphens and dots that ROS names must not have."""
    return "".join(letter if letter.isalnum() else "_" for letter in method)


def _pose(pose: FloatArray) -> Any:
    point = ROS.types["geometry_msgs/msg/Point"](float(pose[0]), float(pose[1]), 0.0)
    x, y, z, w = (float(value) for value in quaternions(pose[None])[0])
    return ROS.types["geometry_msgs/msg/Pose"](point, ROS.types["geometry_msgs/msg/Quaternion"](x, y, z, w))


def _matrix(pose: FloatArray) -> FloatArray:
    """The matrix (4, 4) of a pose (3,) of the plane."""
    found: FloatArray = matrices(pose[None])[0]
    return found


def _transform(stamp: int, parent: str, child: str, pose: FloatArray) -> Any:
    x, y, z = (float(value) for value in pose[:3, 3])
    turn = ROS.types["geometry_msgs/msg/Quaternion"](*(float(value) for value in Rotation.from_matrix(pose[:3, :3]).as_quat()))
    transform = ROS.types["geometry_msgs/msg/Transform"](ROS.types["geometry_msgs/msg/Vector3"](x, y, z), turn)
    return ROS.types["geometry_msgs/msg/TransformStamped"](_header(stamp, parent), child, transform)


def _header(stamp: int, frame: str) -> Any:
    time = ROS.types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
    return ROS.types["std_msgs/msg/Header"](time, frame)


def _stamp(t_s: float, origin_ns: int) -> int:
    return int(nanoseconds(np.array(t_s))) + origin_ns
