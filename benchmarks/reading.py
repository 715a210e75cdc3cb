"""Reading the road: how far off what the frames say of the lane and of its end is, and how often they say it.

Short drives through towns of several kinds are recorded with a driver who wanders in the lane, and read frame by frame, with the
way between the frames as the odometry says it (its scale being known, its noise not). A frame has markings where its lane goes on
for 9 m and is no way through a junction. What is said of the lane's middle and end is compared with the road network.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.table import Row
from hippodrome.core.reading import LaneEnd, RoadReader, RoadReading
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.se2 import wrap
from hippodrome.core.types import FloatArray
from hippodrome.core.views.config import CameraGeometry
from hippodrome.sim.record import RecordingPlan, close_renderer, record
from hippodrome.sim.recording import Recording
from hippodrome.sim.scenario import Scenario

MARKED_M = 9.0  # of lane ahead of the rear axle without which a frame hardly shows any markings
END_M = (5.0, 12.0)  # distances at which a lane's end is scored
BEFORE_END_M = 0.9  # from a stop line's near edge to the lane's end
STRAY_M = 1.5  # an end that is told so far off is no error of measurement: it is none
TOUR_M = 350.0
TOWNS: dict[str, tuple[int, dict[str, Any], dict[str, Any]]] = {
    "grid": (31, {"kind": "grid", "width_m": 270, "height_m": 270, "road_km": 2.8}, {"sun_elevation_deg": 12}),
    "rural, fog": (32, {"kind": "rural", "width_m": 230, "height_m": 300, "road_km": 2.4}, {"fog_visibility_m": 80}),
    "radial, dusk": (
        33,
        {"kind": "radial", "width_m": 300, "height_m": 300, "road_km": 2.4},
        {"dusk": 0.9, "noise_sigma": 6, "motion_blur": 0.03, "gain": 2.0},
    ),
    "two lanes": (34, {"kind": "grid", "width_m": 420, "height_m": 420, "road_km": 4.4, "lanes": 2}, {}),
    "keep left": (35, {"kind": "random", "width_m": 240, "height_m": 240, "road_km": 3.0, "driving_side": "left"}, {}),
}


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """What was read in F frames, and what is true."""

    read: tuple[RoadReading, ...]
    offset_m: FloatArray  # (F,) of the rear axle from the lane's middle
    heading_rad: FloatArray  # (F,)
    to_end_m: FloatArray  # (F,) along the lane
    in_junction: FloatArray  # (F,) bool
    ms: float  # CPU time a frame

    def column(self, name: str) -> FloatArray:
        """One field of the readings (F,)."""
        return np.array([getattr(reading, name) for reading in self.read], dtype=np.float64)


def run() -> list[Row]:
    rows: list[Row] = []
    for name, (seed, town, conditions) in TOWNS.items():
        with TemporaryDirectory() as folder:
            plan = RecordingPlan(scenario_of(seed, town, conditions), "localization", Path(folder))
            rows += rows_of(name, read_recording(record(plan), plan.town().network))
            close_renderer()
    return rows


def scenario_of(seed: int, town: dict[str, Any], conditions: dict[str, Any], length_m: float = TOUR_M) -> Scenario:
    """A short drive with a driver who wanders in the lane."""
    drive = {"tour": {"length_m": length_m}, "traffic": {"vehicles": 8}, "conditions": conditions}
    return Scenario.model_validate(
        {"name": "reading", "seed": seed, "town": town, "camera": {"rate_hz": 5}, "noise": "realistic", "localization": drive}
    )


def read_recording(recording: Recording, network: RoadNetwork) -> Readings:
    """Read all frames, the way between them being that of the odometry."""
    samples, steps = recording.samples, recording.samples.frame_steps
    scale = float(np.sum(samples.speed) / np.sum(samples.speed_mps))
    way = np.concatenate([[0.0], np.cumsum(samples.speed * samples.dt_s) / scale])[steps + 1]
    turn = np.concatenate([[0.0], np.cumsum(samples.yaw_rate_radps * samples.dt_s)])[steps + 1]
    frames = [recording.frame(number) for number in range(recording.frame_count)]
    camera = CameraGeometry().on_road(frames[0].shape[1], frames[0].shape[0])
    RoadReader(camera).read(frames[0])  # compiles
    reader = RoadReader(camera)
    began = time.process_time()
    read = tuple(reader.read(*step) for step in zip(frames, np.diff(way, prepend=0.0), np.diff(turn, prepend=0.0), strict=True))
    spent = time.process_time() - began
    lane = samples.lane[steps]
    truth = np.array([_in_lane(network, int(k), pose) for k, pose in zip(lane, samples.poses_m[steps], strict=True)])
    return Readings(read, truth[:, 0], truth[:, 1], truth[:, 2], network.is_internal[lane], 1e3 * spent / len(frames))


def _in_lane(network: RoadNetwork, lane: int, pose_m: FloatArray) -> tuple[float, float, float]:
    """Offset to the left of the lane's middle (m), heading against it (rad), and distance to its end (m)."""
    points = network.lane_points_m(lane)
    step = np.diff(points, axis=0)
    length = np.hypot(*step.T)
    ahead = step / length[:, None]
    away = pose_m[:2] - points[:-1]
    along = np.clip(np.sum(away * ahead, axis=1), 0.0, length)
    k = int(np.argmin(np.hypot(*(away - along[:, None] * ahead).T)))
    offset = ahead[k, 0] * away[k, 1] - ahead[k, 1] * away[k, 0]
    heading = float(wrap(pose_m[2] - np.arctan2(ahead[k, 1], ahead[k, 0])))
    return float(offset), heading, float(np.sum(length[k:]) - np.sum(away[k] * ahead[k]))


def rows_of(name: str, readings: Readings) -> list[Row]:
    """The figures of one drive."""
    marked = ~readings.in_junction & (readings.to_end_m > MARKED_M)
    sees = np.array([reading.sees_lane for reading in readings.read])
    error = readings.column("offset_m") - readings.offset_m
    heading = readings.column("heading_rad") - readings.heading_rad
    lane, everywhere = error[marked & sees], error[sees]
    nees = np.mean(lane**2 / readings.column("offset_variance_m2")[marked & sees])
    worst = f"worst {np.max(np.abs(everywhere)):.2f} m, in junctions too"
    rows = [
        Row(
            "reading",
            f"{name}: speaks",
            100.0 * float(np.mean(sees[marked])),
            "%",
            f"of {int(np.sum(marked))} frames with markings",
        ),
        Row("reading", f"{name}: lateral error, rms", _rms(lane), "m", worst),
        Row("reading", f"{name}: lateral error, bias", float(np.mean(lane)), "m", f"NEES {nees:.2f}"),
        Row("reading", f"{name}: heading error, rms", np.degrees(_rms(heading[marked & sees])), "deg"),
    ]
    for kind, words, shift in ((LaneEnd.STOP_LINE, "stop line", BEFORE_END_M), (LaneEnd.MOUTH, "mouth", 0.0)):
        rows += _end_rows(f"{name}: {words}", readings, kind, shift)
    return [*rows, Row("reading", f"{name}: CPU time", readings.ms, "ms", "a frame of 160x120")]


def _end_rows(case: str, readings: Readings, kind: LaneEnd, shift_m: float) -> list[Row]:
    told = np.array([reading.end is kind for reading in readings.read])
    truth = readings.to_end_m - shift_m
    error = readings.column("end_m") - truth
    stray = told & (readings.in_junction | (np.abs(error) > STRAY_M))
    scored = told & ~stray & (truth > END_M[0]) & (truth < END_M[1])
    remark = f"{int(np.sum(scored))} at {END_M[0]:.0f}-{END_M[1]:.0f} m, {int(np.sum(stray))} told where there is none"
    return [Row("reading", f"{case}, error, rms", _rms(error[scored]), "m", remark)]


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) > 0 else float("nan")
