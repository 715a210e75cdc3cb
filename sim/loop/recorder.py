"""Closed-loop drives as recordings, in the format of all others."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from hippodrome._files import PACKAGE, code_sha256, sha256_of
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import Frame, HippodromeError
from hippodrome.sim.array_file import write_arrays
from hippodrome.sim.episode import Samples
from hippodrome.sim.loop.types import Event, Sensed, Truth
from hippodrome.sim.loop.users import Users
from hippodrome.sim.record import RECORDING_CODE, numpy_simd, write_drive
from hippodrome.sim.recording import CHUNK_FRAMES, Recording, chunk_path, seal, write_chunk
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.types import Drive, TrafficLog

ROLE = "loop"  # of these recordings, where those of a scenario's drives have mapping or localization
NOWHERE = ""  # the name of the lane of a vehicle that is off the road; it stands last, where index -1 finds it


@dataclass(slots=True)
class _Rows:
    """What is written down at each step."""

    truths: list[Truth] = field(default_factory=list)
    sensed: list[tuple[float, float]] = field(default_factory=list)  # speed in map units per second, yaw rate
    has_frame: list[bool] = field(default_factory=list)
    height_m: list[float] = field(default_factory=list)
    start: list[int] = field(default_factory=lambda: [0])
    vehicle: list[int] = field(default_factory=list)
    vehicle_poses_m: list[list[float]] = field(default_factory=list)
    kind: list[int] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)


class Recorder:
    """Takes a drive step by step; frames go to disk in chunks as they come."""

    def __init__(self, folder: Path, scenario: Scenario, network: RoadNetwork) -> None:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise HippodromeError(f"{folder}: exists already and nothing is overwritten; name another folder, or remove it")
        self._folder, self._scenario, self._network = folder, scenario, network
        self._rows, self._frames, self._chunks = _Rows(), list[Frame](), 0
        self._seed = 0

    def add(self, sensed: Sensed, users: Users, seed: int, height_m: tuple[float, ...]) -> None:
        """Writes a step down; the drive of an earlier reset is given up. Raises HippodromeError where it has begun on disk."""
        truth, rows = sensed.truth, self._rows
        if rows.truths and truth.t_s <= rows.truths[-1].t_s:
            if self._chunks:
                raise HippodromeError(f"{self._folder}: a recording is one drive; leave the block before the next reset")
            rows = self._rows = _Rows()
            self._frames = []
        self._seed = seed
        rows.truths.append(truth)
        rows.sensed.append((sensed.observation.speed, sensed.observation.yaw_rate_radps))
        rows.height_m.extend(height_m)
        rows.vehicle.extend(users.ids.tolist())
        rows.vehicle_poses_m.extend(users.poses_m.tolist())
        rows.kind.extend(users.kinds.tolist())
        rows.start.append(len(rows.vehicle))
        rows.events.extend(sensed.events)
        rows.has_frame.append(sensed.observation.frame is not None)
        if sensed.observation.frame is not None:
            self._frames.append(sensed.observation.frame)
        if len(self._frames) == CHUNK_FRAMES:
            self._write_frames()

    def finish(self, net_file: Path) -> Recording:
        """Writes what is left, and the manifest."""
        if not self._rows.truths:
            raise HippodromeError(f"{self._folder}: no drive was made; call reset() and step() within the block")
        self._folder.mkdir(parents=True, exist_ok=True)
        if self._frames:
            self._write_frames()
        samples = self._samples()
        arrays = {name: np.asarray(getattr(samples, name)) for name in Samples.__slots__}
        write_arrays(self._folder / "samples.npz", arrays)
        write_drive(self._folder / "drive.npz", self._drive(samples))
        return seal(self._folder, self._content(net_file), samples)

    def _write_frames(self) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)
        images = ((frame,) for frame in self._frames)
        write_chunk(chunk_path(self._folder, self._chunks), self._chunks * CHUNK_FRAMES, images)
        self._frames, self._chunks = [], self._chunks + 1

    def _samples(self) -> Samples:
        rows, truths = self._rows, self._rows.truths
        t_s = np.array([truth.t_s for truth in truths])
        frame = np.where(rows.has_frame, np.cumsum(rows.has_frame) - 1, -1)
        return Samples(
            t_s=t_s,
            dt_s=np.full(len(t_s), 0.1),
            speed=np.array([speed for speed, _ in rows.sensed]),
            yaw_rate_radps=np.array([yaw_rate for _, yaw_rate in rows.sensed]),
            frame=frame.astype(np.int32),
            poses_m=np.array([truth.pose_m for truth in truths]),
            speed_mps=np.array([truth.speed_mps for truth in truths]),
            lane=np.array([truth.lane for truth in truths], dtype=np.int32),
            lane_position_m=np.array([truth.lane_position_m for truth in truths]),
            lane_ids=(*self._network.lane_ids, NOWHERE),
        )

    def _drive(self, samples: Samples) -> Drive:
        rows = self._rows
        columns = 5 if rows.height_m else 3
        return Drive(
            t_s=samples.t_s,
            poses_m=samples.poses_m,
            speed_mps=samples.speed_mps,
            yaw_rate_radps=np.array([truth.yaw_rate_radps for truth in rows.truths]),
            lane=samples.lane,
            lane_position_m=samples.lane_position_m,
            traffic=TrafficLog(
                t_s=samples.t_s,
                start=np.array(rows.start, dtype=np.int32),
                vehicle=np.array(rows.vehicle, dtype=np.int32),
                poses_m=np.array(rows.vehicle_poses_m, dtype=np.float64).reshape(-1, columns),
                kind=np.array(rows.kind, dtype=np.uint8),
            ),
            coverage=0.0,  # a drive in the loop has no tour
            revisit_share=0.0,
            heights_m=np.array(rows.height_m) if rows.height_m else None,
        )

    def _content(self, net_file: Path) -> dict[str, Any]:
        """What the manifest says beside the hashes, with the names that other recordings have."""
        scenario = self._scenario
        return {
            "scenario": scenario.name,
            "role": ROLE,
            "seed": self._seed,
            "town": scenario.town.model_dump(mode="json", exclude={"network"}),
            "network_sha256": sha256_of(net_file),
            "drive": scenario.localization.model_dump(mode="json", exclude={"recording", "tour"}),
            "camera": scenario.camera.model_dump(mode="json"),
            "odometry_rate_hz": 10.0,
            "noise": scenario.self_motion_noise.model_dump(mode="json"),
            "versions": {name: version(name) for name in ("eclipse-sumo", "highway-env", "numpy", "pyrender")},
            "numpy_simd": numpy_simd(),
            "code_sha256": code_sha256(PACKAGE, RECORDING_CODE),
            "events": [asdict(event) for event in self._rows.events],
        }
