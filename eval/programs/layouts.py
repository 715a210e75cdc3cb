"""A drive as a folder for a program: frames, times, self-motion, calibration. Made of observations, it holds no truth."""

from __future__ import annotations

import json
import shutil
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import IO, Final

import cv2

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import Frame, HippodromeError, Observation
from hippodrome.eval.methods.protocol import Given, StereoObservation
from hippodrome.eval.programs.bags import Mcap, Rosbag2
from hippodrome.sim.method_spec import Layout
from hippodrome.sim.recording import PNG_LEVEL

ODOMETRY: Final = "odometry.csv"
ODOMETRY_HEAD: Final = "#t_s,speed [map units/s],yaw_rate [rad/s], means since the line before\n"  # as `hippodrome export` has it
ROOM_BYTES: Final = 1 << 30  # that must be free beside the frames
NANOSECONDS: Final = 1_000_000_000


def write_sequence(observations: Iterable[Observation], given: Given, layout: Layout, folder: Path) -> list[float]:
    """Write a drive; the times of all observations.

    Beside the frames in their layout there are ``odometry.csv`` and ``camera.json``, and what the method needs: ``roads.csv``
    with the lanes' centrelines, ``start.txt`` with the pose at which the drive began (x_m y_m heading_rad),
    ``metres_per_unit.txt`` with the length of the speeds' unit.

    Raises:
        HippodromeError: The disk is full.
    """
    folder.mkdir(parents=True, exist_ok=True)
    times_s: list[float] = []
    if shutil.disk_usage(folder).free < ROOM_BYTES:
        raise HippodromeError(f"{folder}: less than {ROOM_BYTES >> 30} GiB is free for the frames; set TMPDIR to a larger disk")
    with (folder / ODOMETRY).open("w", encoding="utf-8") as odometry, _FRAMES[layout](folder) as frames:
        odometry.write(ODOMETRY_HEAD)
        for one in observations:
            odometry.write(f"{one.t_s!r},{one.speed!r},{one.yaw_rate_radps!r}\n")
            times_s.append(one.t_s)
            frames.motion(one)
            if one.frame is not None:
                frames.add(one.t_s, one.frame, one.right if isinstance(one, StereoObservation) else None)
    camera = given.camera
    calibration = {
        "width": camera.width,
        "height": camera.height,
        "focal_px": camera.focal_px(),
        "centre_px": [camera.width / 2.0 - 0.5, camera.height / 2.0 - 0.5],
        "rate_hz": camera.rate_hz,
        "ahead_of_rear_axle_m": camera.forward_m,
        "height_m": camera.height_m,
        **({} if camera.stereo_baseline_m is None else {"baseline_m": camera.stereo_baseline_m}),
    }
    (folder / "camera.json").write_text(json.dumps(calibration, indent=1) + "\n", encoding="utf-8")
    if given.roads is not None:
        _write_roads(folder / "roads.csv", given.roads)
    if given.start is not None:
        start = given.start
        (folder / "start.txt").write_text(f"{start.x_m!r} {start.y_m!r} {start.heading_rad!r}\n", encoding="utf-8")
    if given.metres_per_unit is not None:
        (folder / "metres_per_unit.txt").write_text(f"{given.metres_per_unit!r}\n", encoding="utf-8")
    return times_s


class _Frames(ABC):
    """Frames written one by one, and a list of them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.count = 0
        self._open: list[IO[str]] = []

    def __enter__(self) -> _Frames:
        return self

    def __exit__(self, *_: object) -> None:
        for stream in self._open:
            stream.close()

    def listing(self, path: Path, head: str = "") -> IO[str]:
        path.parent.mkdir(parents=True, exist_ok=True)
        stream = path.open("w", encoding="utf-8")
        stream.write(head)
        self._open.append(stream)
        return stream

    def motion(self, one: Observation) -> None:  # noqa: B027 - most layouts have nothing to add
        """Speed and yaw rate, for the layouts that have them beside the frames; ``odometry.csv`` has them for all."""

    @abstractmethod
    def add(self, t_s: float, frame: Frame, right: Frame | None) -> None:
        """Write the frame that was taken at ``t_s``, with the right one of a pair where there is one, and list it."""


class _Tum(_Frames):
    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        (folder / "rgb").mkdir()
        self._list = self.listing(folder / "rgb.txt", "# t_s filename\n")

    def add(self, t_s: float, frame: Frame, right: Frame | None) -> None:
        name = f"rgb/{t_s:.6f}.png"
        _write_png(self.folder / name, frame)
        self._list.write(f"{t_s!r} {name}\n")


class _Euroc(_Frames):
    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._lists = {"cam0": self._camera("cam0")}

    def add(self, t_s: float, frame: Frame, right: Frame | None) -> None:
        for camera, image in zip(("cam0", "cam1"), (frame, right), strict=True):
            if image is not None:
                self._picture(camera, round(t_s * NANOSECONDS), image)

    def _picture(self, camera: str, stamp: int, image: Frame) -> None:
        if camera not in self._lists:
            self._lists[camera] = self._camera(camera)
        _write_png(self.folder / "mav0" / camera / f"data/{stamp}.png", image)
        self._lists[camera].write(f"{stamp},{stamp}.png\n")

    def _camera(self, camera: str) -> IO[str]:
        (self.folder / "mav0" / camera / "data").mkdir(parents=True)
        return self.listing(self.folder / "mav0" / camera / "data.csv", "#timestamp [ns],filename\n")


class _Kitti(_Frames):
    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        (folder / "image_2").mkdir()
        self._list = self.listing(folder / "times.txt")

    def add(self, t_s: float, frame: Frame, right: Frame | None) -> None:
        _write_png(self.folder / f"image_2/{self.count:06d}.png", frame)
        if right is not None:
            (self.folder / "image_3").mkdir(exist_ok=True)
            _write_png(self.folder / f"image_3/{self.count:06d}.png", right)
        self._list.write(f"{t_s!r}\n")
        self.count += 1


class _Bag(_Frames):
    """Frames and self-motion as messages."""

    def __init__(self, bag: Rosbag2 | Mcap) -> None:
        self._bag = bag

    def __enter__(self) -> _Bag:
        self._bag.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._bag.__exit__()

    def motion(self, one: Observation) -> None:
        self._bag.motion(one)

    def add(self, t_s: float, frame: Frame, right: Frame | None) -> None:
        self._bag.picture(t_s, _png(frame))


_FRAMES: Final[dict[Layout, Callable[[Path], _Frames]]] = {
    "tum": _Tum,
    "euroc": _Euroc,
    "kitti": _Kitti,
    "rosbag2": lambda folder: _Bag(Rosbag2(folder)),
    "mcap": lambda folder: _Bag(Mcap(folder)),
}


def _write_png(path: Path, frame: Frame) -> None:
    path.write_bytes(_png(frame))


def _png(frame: Frame) -> bytes:
    image = frame if frame.ndim == 2 else frame[:, :, ::-1]
    _, png = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, PNG_LEVEL])
    return png.tobytes()


def _write_roads(path: Path, roads: RoadNetwork) -> None:
    """Centrelines of all lanes, a point a line: number of the lane, x, y."""
    with path.open("w", encoding="utf-8") as stream:
        stream.write("#lane,x_m,y_m\n")
        for lane in range(roads.lane_count):
            stream.writelines(f"{lane},{float(x)!r},{float(y)!r}\n" for x, y in roads.lane_points_m(lane)[:, :2])
