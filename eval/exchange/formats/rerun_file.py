"""Rerun recordings: one ``.rrd`` a drive, on the timeline "drive", column by column."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr

from hippodrome.core.types import FloatArray, Trajectory
from hippodrome.eval.exchange.drives.camera import (
    camera_in_body,
    camera_of,
    intrinsics,
    pictures,
)
from hippodrome.eval.exchange.drives.exported import ExportedDrive
from hippodrome.eval.exchange.drives.poses import quaternions
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

CONVENTIONS = (
    "timeline drive: seconds from the start; /network: metres, road network's frame; positions are 32-bit floats in this format",
    "/network/vehicle: true pose of the rear axle, its camera below it (PNG as recorded); /network/lanes: the roads",
    "/network/estimate/METHOD, /network/map/NAME; /network/own/METHOD/...: map units, laid on the true start, not scaled",
    "/self_motion/speed, /self_motion/yaw_rate: as sensed; a file's row ids are random, so two exports differ in bytes",
)
APPLICATION, TIMELINE, ROOT = "hippodrome", "drive", NETWORK_FRAME
CAMERA = f"{ROOT}/{VEHICLE_FRAME}/{CAMERA_FRAME}"
ROAD, CLOSURE, TRUTH = (150, 150, 165), (242, 140, 38), (220, 220, 220)


def write(drives: Sequence[ExportedDrive], folder: Path) -> None:
    """Write one file for each drive."""
    for drive in drives:
        stream = rr.RecordingStream(APPLICATION, recording_id=drive.name, send_properties=False)
        stream.save(folder / f"{drive.name}.rrd")
        _log_static(stream, drive)
        _log_frames(stream, drive)
        _log_self_motion(stream, drive)
        if drive.truth is not None:
            _log_poses(stream, ROOT, VEHICLE_FRAME, drive.truth)
        for method, estimate in drive.estimates.items():
            _log_poses(stream, frame_id(drive, method), f"estimate/{method}", estimate.trajectory)
        for name in drive.maps:
            _log_map(stream, drive, name)
        stream.disconnect()


def entity_of(frame: str, name: str) -> str:
    """Path in Rerun's tree of something that is given in ``frame``."""
    return f"{ROOT}/{name}" if frame == ROOT else f"{ROOT}/{frame}/{name}"


def _log_static(stream: rr.RecordingStream, drive: ExportedDrive) -> None:
    for name, pose in own_frames(drive).items():
        stream.log(f"{ROOT}/{name}", _transform(pose), static=True)
    if drive.network is not None:
        stream.log(f"{ROOT}/lanes", rr.LineStrips3D([_raised(points) for points in lanes(drive)], colors=ROAD), static=True)
    camera = camera_of(drive.recording)
    in_body = camera_in_body(camera)
    stream.log(CAMERA, rr.Transform3D(translation=in_body[:3, 3], mat3x3=in_body[:3, :3]), static=True)
    if camera is not None:
        pinhole = rr.Pinhole(image_from_camera=intrinsics(camera), resolution=[camera.width, camera.height])
        stream.log(CAMERA, pinhole, static=True)


def _log_frames(stream: rr.RecordingStream, drive: ExportedDrive) -> None:
    """Log the frames one by one, so that a long drive need not fit into memory."""
    for picture in pictures(drive.recording):
        stream.set_time(TIMELINE, duration=picture.t_s)
        stream.log(CAMERA, rr.EncodedImage(contents=picture.left, media_type="image/png"))
        if picture.right is not None:
            stream.log(f"{CAMERA}/right", rr.EncodedImage(contents=picture.right, media_type="image/png"))


def _log_self_motion(stream: rr.RecordingStream, drive: ExportedDrive) -> None:
    samples = drive.recording.samples
    for name, values in (("speed", samples.speed), ("yaw_rate", samples.yaw_rate_radps)):
        stream.send_columns(f"self_motion/{name}", indexes=[_times(samples.t_s)], columns=rr.Scalars.columns(scalars=values))


def _log_poses(stream: rr.RecordingStream, frame: str, name: str, trajectory: Trajectory) -> None:
    """Log the moving pose, and the whole path beside it in the tree: below it, the path would move along."""
    places = _raised(trajectory.poses[:, :2])
    columns = rr.Transform3D.columns(translation=places, quaternion=quaternions(trajectory.poses))
    stream.send_columns(entity_of(frame, name), indexes=[_times(trajectory.t_s)], columns=columns)
    method = name.removeprefix("estimate/")
    colour = TRUTH if method == name else colour_of(method)
    stream.log(entity_of(frame, f"path/{name}"), rr.LineStrips3D([places], colors=colour), static=True)


def _log_map(stream: rr.RecordingStream, drive: ExportedDrive, name: str) -> None:
    entity = entity_of(map_frame_id(name, drive.maps[name]), f"map/{name}")
    for state in growth(drive, name):
        stream.set_time(TIMELINE, duration=state.t_s)
        stream.log(entity, rr.LineStrips3D([_raised(state.path)], colors=colour_of(name)))
        stream.log(f"{entity}/closures", rr.LineStrips3D([_raised(ends) for ends in state.closures], colors=CLOSURE))


def _transform(pose: FloatArray) -> rr.Transform3D:
    return rr.Transform3D(translation=[pose[0], pose[1], 0.0], quaternion=quaternions(pose[None])[0])


def _times(t_s: FloatArray) -> rr.TimeColumn:
    return rr.TimeColumn(TIMELINE, duration=t_s)


def _raised(points: FloatArray) -> FloatArray:
    return np.column_stack([points, np.zeros(len(points))])
