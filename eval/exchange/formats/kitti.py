"""KITTI odometry layout: ``poses/NN.txt`` and ``sequences/NN`` with ``times.txt``, ``calib.txt``, grey and colour images."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from hippodrome.core.types import FloatArray, HippodromeError, Trajectory
from hippodrome.eval.exchange.drives.camera import (
    camera_in_body,
    camera_of,
    intrinsics,
    pictures,
    right_in_left,
)
from hippodrome.eval.exchange.drives.exported import ExportedDrive
from hippodrome.eval.exchange.drives.poses import matrices
from hippodrome.eval.exchange.drives.tables import (
    ODOMETRY,
    flat,
    write_odometry,
    write_rows,
)
from hippodrome.sim.recording import PNG_LEVEL
from hippodrome.sim.render.camera import CameraSpec

CONVENTIONS = (
    "poses: left camera (x right, y down, z forward) in its own first true pose; metres; 12 numbers printed to read back exactly",
    "sequences/NN/origin.txt: that first pose (4x4) in the road network's frame",
    "estimates/METHOD/NN.txt with NN-times.txt: topometric* as above; others: rear axle, map units, from own start",
    "poses/NN.tum, estimates/METHOD/NN.tum: the same with their times, for evo_ape tum, as estimates have times of their own",
    "image_2 (right: image_3): colour as recorded, bit for bit; image_0 (right: image_1): the same in grey",
)


def write(drives: Sequence[ExportedDrive], folder: Path) -> None:
    """Write sequences 00, 01, ... in the order of the drives."""
    for number, drive in enumerate(drives):
        _write_sequence(drive, folder, f"{number:02d}")


def _write_sequence(drive: ExportedDrive, folder: Path, number: str) -> None:
    here, camera = folder / "sequences" / number, camera_of(drive.recording)
    in_body = camera_in_body(camera)
    t_s = drive.recording.samples.t_s[drive.recording.samples.frame_steps]
    _write_images(drive, here)
    write_rows(here / "times.txt", ((t,) for t in t_s))
    write_odometry(here / ODOMETRY, drive.recording)
    (here / "name.txt").write_text(f"{drive.name}\n", encoding="utf-8")
    if camera is not None:
        _write_calibration(here / "calib.txt", camera)
    origin = None
    if drive.truth is not None:
        at_frames = np.isin(drive.truth.t_s, t_s)
        cameras = matrices(drive.truth.poses[at_frames]) @ in_body
        origin = cameras[0]
        write_rows(here / "origin.txt", origin)
        _write_poses(folder / "poses" / f"{number}.txt", np.linalg.inv(origin) @ cameras)
        _write_timed(folder / "poses" / f"{number}.tum", drive.truth.t_s[at_frames], np.linalg.inv(origin) @ cameras)
        if not np.isin(t_s, drive.truth.t_s).all():  # truth of a part: KITTI has no place to say which
            write_rows(here / "truth_times.txt", ((t,) for t in drive.truth.t_s[at_frames]))
    for method, estimate in drive.estimates.items():
        placed = origin is not None and estimate.frame == "network"
        found = _in_camera(estimate.trajectory, origin, in_body) if placed else _from_own_start(estimate.trajectory)
        _write_poses(folder / "estimates" / method / f"{number}.txt", found)
        write_rows(folder / "estimates" / method / f"{number}-times.txt", ((t,) for t in estimate.trajectory.t_s))
        _write_timed(folder / "estimates" / method / f"{number}.tum", estimate.trajectory.t_s, found)


def _in_camera(trajectory: Trajectory, origin: FloatArray | None, in_body: FloatArray) -> FloatArray:
    assert origin is not None
    found: FloatArray = np.linalg.inv(origin) @ matrices(trajectory.poses) @ in_body
    return found


def _from_own_start(trajectory: Trajectory) -> FloatArray:
    """Poses (N, 4, 4) relative to the first, turned to the camera's axes.

    They are not moved to the camera: nobody knows how many map units it sits ahead of the axle.
    """
    turned = camera_in_body(None)
    poses = matrices(trajectory.poses) @ turned
    found: FloatArray = np.linalg.inv(poses[0]) @ poses
    return found


def _write_poses(path: Path, poses: FloatArray) -> None:
    write_rows(path, (flat(pose[:3]) for pose in poses))


def _write_timed(path: Path, t_s: FloatArray, poses: FloatArray) -> None:
    """Write the same poses as TUM, with their times: evo compares KITTI's only where both files have the same number of them."""
    turns = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    write_rows(
        path, ((float(t), *map(float, pose[:3, 3]), *map(float, turn)) for t, pose, turn in zip(t_s, poses, turns, strict=True))
    )


def _write_calibration(path: Path, camera: CameraSpec) -> None:
    """Write P0 to P3, the projections of rectified points; the right camera is shifted by the baseline."""
    left = np.hstack([intrinsics(camera), np.zeros((3, 1))])
    right = left.copy()
    right[0, 3] = -intrinsics(camera)[0, 0] * right_in_left(camera)[0, 3]
    write_rows(path, ([f"P{i}:", *flat(matrix)] for i, matrix in enumerate((left, right, left, right))))


def _write_images(drive: ExportedDrive, here: Path) -> None:
    for name in ("image_0", "image_2"):
        (here / name).mkdir(parents=True)
    for picture in pictures(drive.recording):
        name = f"{picture.number:06d}.png"
        (here / "image_2" / name).write_bytes(picture.left)
        (here / "image_0" / name).write_bytes(_grey(picture.left, drive.name))
        if picture.right is not None:
            for folder, png in (("image_3", picture.right), ("image_1", _grey(picture.right, drive.name))):
                (here / folder).mkdir(exist_ok=True)
                (here / folder / name).write_bytes(png)


def _grey(png: bytes, name: str) -> bytes:
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise HippodromeError(f"{name}: a frame is not a PNG image; delete the recording to make it anew")
    return cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, PNG_LEVEL])[1].tobytes()
