"""The camera of a recording: its PNG files as they are, its intrinsics, and its pose in the optical convention."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pydantic import ValidationError

from hippodrome._files import why_unreadable
from hippodrome.core.types import FloatArray
from hippodrome.sim.key_words import first_fault
from hippodrome.sim.recording import CHUNK_FRAMES, MANIFEST, Recording, RecordingError, chunk_path, frame_name
from hippodrome.sim.render.camera import CameraSpec

# Columns: the optical axes (x right, y down, z forward) in body axes (x forward, y left, z up).
OPTICAL_IN_BODY = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """One frame as it lies on disk: the bytes of its PNG file."""

    t_s: float
    number: int  # number of the frame, from 0
    left: bytes
    right: bytes | None  # None: the camera is no stereo pair


def camera_of(recording: Recording) -> CameraSpec | None:
    """The camera's specification; None for an imported drive whose calibration is unknown.

    Raises RecordingError for a camera that is none of ours: of more pixels a side, or more frames a second, than ours may have.
    """
    values = recording.manifest.get("camera", {})
    try:
        return CameraSpec.model_validate(values) if "fov_deg" in values else None
    except ValidationError as error:
        place, cure = recording.folder / MANIFEST, "import the drive anew, with other frames (--size, --fps)"
        raise RecordingError(f"{place}: camera.{first_fault(error, values, CameraSpec)}; {cure}") from None


def intrinsics(camera: CameraSpec) -> FloatArray:
    """The pinhole matrix (3, 3) in pixels; pixel centres lie at whole numbers."""
    focal_px = camera.focal_px()
    return np.array([[focal_px, 0.0, camera.width / 2 - 0.5], [0.0, focal_px, camera.height / 2 - 0.5], [0.0, 0.0, 1.0]])


def camera_in_body(camera: CameraSpec | None) -> FloatArray:
    """Pose (4, 4) of the left camera, optical axes, in the vehicle's frame; without a calibration it is at the rear axle."""
    pose = np.eye(4)
    pose[:3, :3] = OPTICAL_IN_BODY
    if camera is not None:
        yaw = np.radians(camera.yaw_offset_deg)
        turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
        pose[:3, :3] = turn @ OPTICAL_IN_BODY
        pose[:3, 3] = camera.forward_m, 0.0, camera.height_m
    return pose


def right_in_left(camera: CameraSpec) -> FloatArray:
    """Pose (4, 4) of a stereo pair's right camera in the left one's axes."""
    pose = np.eye(4)
    pose[0, 3] = camera.stereo_baseline_m or 0.0
    return pose


def pictures(recording: Recording) -> Iterator[Picture]:
    """Every frame in order, undecoded: what is exported is bit for bit what was recorded."""
    t_s = recording.samples.t_s[recording.samples.frame_steps]
    for first in range(0, len(t_s), CHUNK_FRAMES):
        path = chunk_path(recording.folder, first // CHUNK_FRAMES)
        try:
            with zipfile.ZipFile(path) as archive:
                names = set(archive.namelist())
                for number in range(first, min(first + CHUNK_FRAMES, len(t_s))):
                    right = archive.read(frame_name(number, "r")) if frame_name(number, "r") in names else None
                    yield Picture(float(t_s[number]), number, archive.read(frame_name(number)), right)
        except (OSError, KeyError, zipfile.BadZipFile) as error:
            raise RecordingError(
                f"{path}: frames cannot be read ({why_unreadable(error)}); delete the recording to make it anew"
            ) from None
