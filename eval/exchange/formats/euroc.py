"""EuRoC (ASL) layout: ``mav0/cam0``, ``mav0/state_groundtruth_estimate0``, and the self-motion as a sensor of its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from hippodrome.core.types import Trajectory
from hippodrome.eval.exchange.drives.camera import (
    camera_in_body,
    camera_of,
    intrinsics,
    pictures,
    right_in_left,
)
from hippodrome.eval.exchange.drives.exported import ExportedDrive
from hippodrome.eval.exchange.drives.poses import nanoseconds, quaternions
from hippodrome.eval.exchange.drives.tables import flat, write_rows
from hippodrome.eval.files.trajectories import write_tum
from hippodrome.sim.recording import Recording
from hippodrome.sim.render.camera import CameraSpec

CONVENTIONS = (
    "time: whole nanoseconds from the start of the drive",
    "poses: rear axle (x forward, y left, z up), metres, road network's frame; quaternion w x y z; printed to read back exactly",
    "cam0/data (right: cam1/data): PNG as recorded, bit for bit",
    "odometry0: self-motion as sensed, map units; estimates/METHOD.csv, .tum: topometric* as above, others in map units from own "
    "start",
)
HEAD = (
    "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z [],"
    "v_RS_R_x [m s^-1],v_RS_R_y [m s^-1],v_RS_R_z [m s^-1],b_w_RS_S_x [rad s^-1],b_w_RS_S_y [rad s^-1],b_w_RS_S_z [rad s^-1],"
    "b_a_RS_S_x [m s^-2],b_a_RS_S_y [m s^-2],b_a_RS_S_z [m s^-2]"
)
ODOMETRY_SENSOR = "odometry0"
ODOMETRY_HEAD = "#timestamp [ns],speed [map units s^-1],yaw_rate [rad s^-1]"


def write(drives: Sequence[ExportedDrive], folder: Path) -> None:
    """Write one sequence for each drive."""
    for drive in drives:
        _write_sequence(drive, folder / drive.name / "mav0")


def _write_sequence(drive: ExportedDrive, here: Path) -> None:
    here.mkdir(parents=True)
    _write_yaml(here / "body.yaml", {"comment": f"{drive.name}, hippodrome"})
    _write_cameras(drive.recording, here)
    _write_odometry(drive.recording, here / ODOMETRY_SENSOR)
    if drive.truth is not None:
        sensor = here / "state_groundtruth_estimate0"
        _write_states(sensor / "data.csv", drive.truth)
        _write_yaml(sensor / "sensor.yaml", {"sensor_type": "visual-inertial", "T_BS": _matrix(np.eye(4))})
    for method, estimate in drive.estimates.items():
        _write_states(here / "estimates" / f"{method}.csv", estimate.trajectory)
        write_tum(here / "estimates" / f"{method}.tum", estimate.trajectory)  # evo takes estimates beside EuRoC's truth so


def _write_cameras(recording: Recording, here: Path) -> None:
    camera = camera_of(recording)
    rows: dict[str, list[tuple[int, str]]] = {"cam0": [], "cam1": []}
    for picture in pictures(recording):
        stamp = int(nanoseconds(np.array(picture.t_s)))
        for sensor, png in (("cam0", picture.left), ("cam1", picture.right)):
            if png is not None:
                data = here / sensor / "data"
                data.mkdir(parents=True, exist_ok=True)
                (data / f"{stamp}.png").write_bytes(png)
                rows[sensor].append((stamp, f"{stamp}.png"))
    for sensor, lines in rows.items():
        if lines:
            write_rows(here / sensor / "data.csv", lines, "#timestamp [ns],filename", ",")
            if camera is not None:
                _write_yaml(here / sensor / "sensor.yaml", _camera_yaml(camera, right=sensor == "cam1"))


def _camera_yaml(camera: CameraSpec, right: bool) -> dict[str, Any]:
    pinhole = intrinsics(camera)
    pose = camera_in_body(camera)
    return {
        "sensor_type": "camera",
        "T_BS": _matrix(pose @ right_in_left(camera) if right else pose),
        "rate_hz": camera.rate_hz,
        "resolution": [camera.width, camera.height],
        "camera_model": "pinhole",
        "intrinsics": [float(pinhole[i, j]) for i, j in ((0, 0), (1, 1), (0, 2), (1, 2))],
        "distortion_model": "radial-tangential",
        "distortion_coefficients": [0.0, 0.0, 0.0, 0.0],
    }


def _write_odometry(recording: Recording, here: Path) -> None:
    samples = recording.samples
    rows = zip(nanoseconds(samples.t_s), samples.speed, samples.yaw_rate_radps, strict=True)
    write_rows(here / "data.csv", rows, ODOMETRY_HEAD, ",")
    _write_yaml(
        here / "sensor.yaml", {"sensor_type": "odometry", "comment": "means since the line before", "T_BS": _matrix(np.eye(4))}
    )


def _write_states(path: Path, trajectory: Trajectory) -> None:
    """Write EuRoC's 17 columns: pose, velocity by differences, and zeros for the biases of an IMU that there is not."""
    quaternion = np.roll(quaternions(trajectory.poses), 1, axis=1)
    count, nothing = len(trajectory.t_s), np.zeros(7)
    velocity = np.zeros((count, 2)) if count < 2 else np.gradient(trajectory.poses[:, :2], trajectory.t_s, axis=0)
    rows = (
        (stamp, x, y, 0.0, *attitude, *speed, *nothing)
        for stamp, (x, y, _), attitude, speed in zip(
            nanoseconds(trajectory.t_s), trajectory.poses, quaternion, velocity, strict=True
        )
    )
    write_rows(path, rows, HEAD, ",")


def _matrix(pose: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> dict[str, Any]:
    return {"cols": 4, "rows": 4, "data": flat(pose)}


def _write_yaml(path: Path, values: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(yaml.safe_dump(values, sort_keys=False, default_flow_style=None), encoding="utf-8")
