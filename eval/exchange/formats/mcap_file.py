"""MCAP with Foxglove's schemas: one file a drive, frames, poses, transforms, roads and growing maps over time."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp
from mcap_protobuf.writer import Writer
from scipy.spatial.transform import Rotation

from hippodrome.core.types import FloatArray, Trajectory
from hippodrome.eval.exchange.drives.camera import (
    camera_in_body,
    camera_of,
    intrinsics,
    pictures,
)
from hippodrome.eval.exchange.drives.exported import ExportedDrive
from hippodrome.eval.exchange.drives.poses import nanoseconds, quaternions
from hippodrome.eval.exchange.drives.scene import (
    CAMERA_FRAME,
    NETWORK_FRAME,
    VEHICLE_FRAME,
    colour_of,
    frame_id,
    growth,
    lanes,
    map_frame_id,
    own_frames,
)
from hippodrome.eval.methods.stages import dead_reckoning

CONVENTIONS = (
    "messages: Foxglove's protobuf schemas; log time: whole nanoseconds from the start of the drive (of an imported one: of "
    "its source's clock); poses: doubles, exact",
    "frames: network (metres, road network's) -> vehicle (rear axle) -> camera; own/METHOD: map units, laid on the true start",
    "/camera: PNG as recorded; /self_motion: as sensed, map units/s; /estimate/METHOD, /map/NAME, /network: what was found",
    "maps grow in steps of 5 s, their vertices where the finished map has them; a localization drive has them whole from 0 s on",
)
IMAGE, RIGHT_IMAGE, SELF_MOTION, TRUTH = "/camera", "/camera_right", "/self_motion", "/ground_truth"

Event: TypeAlias = tuple[int, int, str, Any]  # nanoseconds, order among equals, topic, message

ROAD: Final = Color(r=0.6, g=0.6, b=0.65, a=1.0)
CLOSURE: Final = Color(r=0.95, g=0.55, b=0.15, a=1.0)


def write(drives: Sequence[ExportedDrive], folder: Path) -> None:
    """Write one file for each drive."""
    for drive in drives:
        with (folder / f"{drive.name}.mcap").open("wb") as stream, Writer(stream) as writer:
            for stamp, _, topic, message in heapq.merge(*_streams(drive), key=lambda event: event[:2]):
                moment = stamp + drive.origin_ns()
                if moment != stamp:
                    _set_time(message, moment)
                writer.write_message(topic, message, log_time=moment, publish_time=moment)


def _streams(drive: ExportedDrive) -> list[Iterable[Event]]:
    """All streams of messages of a drive, each in order of time; at one instant they keep this order."""
    streams = [_static(drive), _images(drive), _self_motion(drive)]
    if drive.truth is not None:
        streams += [_poses(TRUTH, NETWORK_FRAME, drive.truth), _vehicle(drive.truth)]
    for method, estimate in drive.estimates.items():
        streams.append(_poses(f"/estimate/{method}", frame_id(drive, method), estimate.trajectory))
    streams += [_map(drive, name) for name in drive.maps]
    return [_ranked(order, stream) for order, stream in enumerate(streams)]


def _ranked(order: int, stream: Iterable[tuple[int, str, Any]]) -> Iterator[Event]:
    return ((stamp, order, topic, message) for stamp, topic, message in stream)


def _static(drive: ExportedDrive) -> Iterator[tuple[int, str, Any]]:
    """Messages of what holds from the start on: where the camera sits, where the methods' own frames lie, the roads."""
    stamp = 0
    camera = camera_of(drive.recording)
    in_body = camera_in_body(camera)
    yield (
        stamp,
        "/tf",
        _transform(stamp, VEHICLE_FRAME, CAMERA_FRAME, in_body[:3, 3], Rotation.from_matrix(in_body[:3, :3]).as_quat()),
    )
    for name, pose in own_frames(drive).items():
        yield stamp, "/tf", _transform(stamp, NETWORK_FRAME, name, _xyz(pose), quaternions(pose[None])[0])
    if camera is not None:
        pinhole = intrinsics(camera)
        projection = np.hstack([pinhole, np.zeros((3, 1))])
        yield stamp, "/calibration", CameraCalibration(
            timestamp=_time(stamp), frame_id=CAMERA_FRAME, width=camera.width, height=camera.height,
            K=pinhole.ravel(), R=np.eye(3).ravel(), P=projection.ravel())  # fmt: skip
    if drive.network is not None:
        lines = [_line(points, ROAD, 1.0) for points in lanes(drive)]
        yield stamp, "/network", _scene(stamp, NETWORK_FRAME, "network", lines)


def _images(drive: ExportedDrive) -> Iterator[tuple[int, str, Any]]:
    for picture in pictures(drive.recording):
        stamp = _stamp(picture.t_s)
        for topic, png in ((IMAGE, picture.left), (RIGHT_IMAGE, picture.right)):
            if png is not None:
                yield stamp, topic, CompressedImage(timestamp=_time(stamp), frame_id=CAMERA_FRAME, data=png, format="png")


def _self_motion(drive: ExportedDrive) -> Iterator[tuple[int, str, Any]]:
    """Messages of speed and yaw rate as sensed; their pose is these integrated."""
    samples = drive.recording.samples
    reckoned, _ = dead_reckoning(drive.recording.self_motion())
    for t_s, pose, speed, yaw_rate in zip(samples.t_s, reckoned.poses, samples.speed, samples.yaw_rate_radps, strict=True):
        stamp = _stamp(t_s)
        yield stamp, SELF_MOTION, Odometry(
            timestamp=_time(stamp), frame_id="own/dead-reckoning", body_frame_id=VEHICLE_FRAME, pose=_pose(pose),
            linear_velocity=Vector3(x=speed), angular_velocity=Vector3(z=yaw_rate))  # fmt: skip


def _poses(topic: str, frame: str, trajectory: Trajectory) -> Iterator[tuple[int, str, Any]]:
    for t_s, pose in zip(trajectory.t_s, trajectory.poses, strict=True):
        stamp = _stamp(t_s)
        yield stamp, topic, PoseInFrame(timestamp=_time(stamp), frame_id=frame, pose=_pose(pose))


def _vehicle(truth: Trajectory) -> Iterator[tuple[int, str, Any]]:
    for t_s, pose in zip(truth.t_s, truth.poses, strict=True):
        stamp = _stamp(t_s)
        yield stamp, "/tf", _transform(stamp, NETWORK_FRAME, VEHICLE_FRAME, _xyz(pose), quaternions(pose[None])[0])


def _map(drive: ExportedDrive, name: str) -> Iterator[tuple[int, str, Any]]:
    frame = map_frame_id(name, drive.maps[name])
    red, green, blue = (value / 255 for value in colour_of(name))
    for state in growth(drive, name):
        stamp = _stamp(state.t_s)
        lines = [_line(state.path, Color(r=red, g=green, b=blue, a=1.0), 0.8)]
        if len(state.closures):
            lines.append(_line(state.closures.reshape(-1, 2), CLOSURE, 0.4, LinePrimitive.LINE_LIST))
        yield stamp, f"/map/{name}", _scene(stamp, frame, name, lines)


def _scene(stamp: int, frame: str, name: str, lines: list[LinePrimitive]) -> SceneUpdate:
    """Lines to draw, under a name; they replace what was drawn under it before."""
    return SceneUpdate(entities=[SceneEntity(timestamp=_time(stamp), frame_id=frame, id=name, lines=lines)])


def _line(points: FloatArray, color: Color, thickness: float, kind: Any = LinePrimitive.LINE_STRIP) -> LinePrimitive:
    corners = [Point3(x=x, y=y, z=0.0) for x, y in points.tolist()]
    pose = Pose(position=Vector3(), orientation=Quaternion(w=1.0))
    return LinePrimitive(type=kind, pose=pose, thickness=thickness, points=corners, color=color)


def _transform(stamp: int, parent: str, child: str, position: FloatArray, quaternion: FloatArray) -> FrameTransform:
    return FrameTransform(
        timestamp=_time(stamp), parent_frame_id=parent, child_frame_id=child,
        translation=_vector(position), rotation=_quaternion(quaternion))  # fmt: skip


def _pose(pose: FloatArray) -> Pose:
    return Pose(position=_vector(_xyz(pose)), orientation=_quaternion(quaternions(pose[None])[0]))


def _xyz(pose: FloatArray) -> FloatArray:
    return np.array([pose[0], pose[1], 0.0])


def _vector(xyz: FloatArray) -> Vector3:
    return Vector3(x=xyz[0], y=xyz[1], z=xyz[2])


def _quaternion(xyzw: FloatArray) -> Quaternion:
    return Quaternion(x=xyzw[0], y=xyzw[1], z=xyzw[2], w=xyzw[3])


def _set_time(message: Any, stamp: int) -> None:
    """Give a message another time."""
    for dated in message.entities if isinstance(message, SceneUpdate) else [message]:
        dated.timestamp.CopyFrom(_time(stamp))


def _stamp(t_s: float) -> int:
    return int(nanoseconds(np.array(t_s)))


def _time(stamp: int) -> Timestamp:
    return Timestamp(seconds=stamp // 10**9, nanos=stamp % 10**9)
