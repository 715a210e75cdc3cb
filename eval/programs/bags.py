"""A drive as a bag for a program: ``drive/`` in the layout of rosbag2, or ``drive.mcap`` with Foxglove's schemas; without truth.

Topics are those of ``hippodrome export``. The packages come with the extra ``exchange``, and are imported when asked for.
"""

from __future__ import annotations

from contextlib import ExitStack
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np

from hippodrome.core.types import Observation
from hippodrome.eval.methods.protocol import MethodError

NANOSECONDS: Final = 1_000_000_000
BAG_VERSION: Final = 8  # of the bag's metadata, which ROS 2 Humble and later read
ROS_IMAGE, ROS_ODOMETRY = "/camera/image/compressed", "/odometry"
MCAP_IMAGE, MCAP_ODOMETRY = "/camera", "/self_motion"
CAMERA, VEHICLE, OWN = "camera", "vehicle", "own/dead-reckoning"


class Rosbag2:
    """A bag written message by message: compressed images, and odometry whose twist is as sensed."""

    def __init__(self, folder: Path) -> None:
        rosbag2, typesys = _module("rosbags.rosbag2"), _module("rosbags.typesys")
        self._types = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
        plugin = rosbag2.StoragePlugin.MCAP
        self._bag = rosbag2.Writer(folder / "drive", version=BAG_VERSION, storage_plugin=plugin)
        self._known: dict[str, Any] = {}

    def __enter__(self) -> Rosbag2:
        self._bag.open()
        return self

    def __exit__(self, *_: object) -> None:
        self._bag.close()

    def motion(self, one: Observation) -> None:
        """Speed and yaw rate; no pose is known."""
        make, vector = self._make, self._types.types["geometry_msgs/msg/Vector3"]
        twist = make("geometry_msgs/msg/Twist", vector(one.speed, 0.0, 0.0), vector(0.0, 0.0, one.yaw_rate_radps))
        point, turn = make("geometry_msgs/msg/Point", 0.0, 0.0, 0.0), make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
        place = make("geometry_msgs/msg/PoseWithCovariance", make("geometry_msgs/msg/Pose", point, turn), np.zeros(36))
        moved = make("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36))
        self._write(ROS_ODOMETRY, one.t_s, "nav_msgs/msg/Odometry", self._header(one.t_s, OWN), VEHICLE, place, moved)

    def picture(self, t_s: float, png: bytes) -> None:
        """A frame."""
        data = np.frombuffer(png, np.uint8)
        self._write(ROS_IMAGE, t_s, "sensor_msgs/msg/CompressedImage", self._header(t_s, CAMERA), "png", data)

    def _header(self, t_s: float, frame: str) -> Any:
        stamp = round(t_s * NANOSECONDS)
        time = self._make("builtin_interfaces/msg/Time", stamp // NANOSECONDS, stamp % NANOSECONDS)
        return self._make("std_msgs/msg/Header", time, frame)

    def _make(self, kind: str, *fields: Any) -> Any:
        return self._types.types[kind](*fields)

    def _write(self, topic: str, t_s: float, kind: str, *fields: Any) -> None:
        if topic not in self._known:
            self._known[topic] = self._bag.add_connection(topic, kind, typestore=self._types)
        message = self._types.serialize_cdr(self._make(kind, *fields), kind)
        self._bag.write(self._known[topic], round(t_s * NANOSECONDS), message)


class Mcap:
    """A file written message by message: compressed images, and odometry whose velocities are as sensed."""

    def __init__(self, folder: Path) -> None:
        self._path, self._stack = folder / "drive.mcap", ExitStack()
        self._writer = _module("mcap_protobuf.writer").Writer
        names = ("CompressedImage", "Odometry", "Pose", "Quaternion", "Vector3")
        self._kinds = {name: getattr(_module(f"foxglove_schemas_protobuf.{name}_pb2"), name) for name in names}

    def __enter__(self) -> Mcap:
        self._out = self._stack.enter_context(self._writer(self._stack.enter_context(self._path.open("wb"))))
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def motion(self, one: Observation) -> None:
        """Speed and yaw rate; no pose is known."""
        vector, pose = self._kinds["Vector3"], self._kinds["Pose"](orientation=self._kinds["Quaternion"](w=1.0))
        self._write(
            MCAP_ODOMETRY, one.t_s, "Odometry", frame_id=OWN, body_frame_id=VEHICLE, pose=pose,
            linear_velocity=vector(x=one.speed), angular_velocity=vector(z=one.yaw_rate_radps),
        )  # fmt: skip

    def picture(self, t_s: float, png: bytes) -> None:
        """A frame."""
        self._write(MCAP_IMAGE, t_s, "CompressedImage", frame_id=CAMERA, data=png, format="png")

    def _write(self, topic: str, t_s: float, kind: str, **fields: Any) -> None:
        stamp, message = round(t_s * NANOSECONDS), self._kinds[kind](**fields)
        message.timestamp.FromNanoseconds(stamp)
        self._out.write_message(topic, message, log_time=stamp, publish_time=stamp)


def _module(name: str) -> Any:
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        missing = (error.name or name).split(".")[0]
        cure = "install the extra: pip install 'hippodrome[exchange]'"
        raise MethodError(f"input: the package '{missing}' is missing; {cure}") from None
