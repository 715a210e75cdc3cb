"""From a scenario to recordings: simulate a drive, sense it, draw it chunk by chunk. Nothing that is on disk is made again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from hippodrome._files import PACKAGE, code_sha256, sha256_of
from hippodrome.core.types import Frame
from hippodrome.sim.array_file import read_arrays, write_arrays
from hippodrome.sim.drive import simulate_drive
from hippodrome.sim.episode import Samples, draw_frame, sample_drive
from hippodrome.sim.recording import (
    ANEW,
    CHUNK_FRAMES,
    MANIFEST,
    Recording,
    RecordingError,
    chunk_count,
    chunk_path,
    open_recording,
    read_samples,
    seal,
    write_chunk,
)
from hippodrome.sim.render.camera import camera_divider
from hippodrome.sim.scenario import DriveSpec, Scenario
from hippodrome.sim.scene.build import build_scene
from hippodrome.sim.self_motion import SelfMotionNoise, sense_self_motion
from hippodrome.sim.town import build_town
from hippodrome.sim.types import Drive, Town, TrafficLog

if TYPE_CHECKING:
    from hippodrome.sim.render.renderer import FrameRenderer

Role: TypeAlias = Literal["mapping", "localization"]
ROLES: tuple[Role, ...] = ("mapping", "localization")
RECORDING_CODE = ("sim/**/*.py",)  # the code that makes recordings: a changed renderer must not be served old frames


@dataclass(frozen=True, slots=True)
class RecordingPlan:
    """One drive of a scenario and the folder below which towns and recordings live."""

    scenario: Scenario
    role: Role
    root: Path

    @property
    def drive_spec(self) -> DriveSpec:
        spec: DriveSpec = getattr(self.scenario, self.role)
        return spec

    @property
    def seed(self) -> int:
        """A seed of its own for each role, so that the two drives differ in route, traffic and noise."""
        return int(np.random.SeedSequence([self.scenario.seed, ROLES.index(self.role)]).generate_state(1)[0] >> 1)

    def town(self) -> Town:
        return _town(self.scenario, self.root)

    def content(self) -> dict[str, Any]:
        """All that the recording's bytes depend on, as JSON values."""
        scenario = self.scenario
        return {
            "scenario": scenario.name,
            "role": self.role,
            "seed": scenario.seed,
            "town": scenario.town.model_dump(mode="json", exclude={"network"}),
            "network_sha256": _network_sha256(self.town()),
            "drive": self.drive_spec.model_dump(mode="json", exclude={"recording", "closed"}),
            "camera": scenario.camera.model_dump(mode="json"),
            "odometry_rate_hz": scenario.odometry_rate_hz,
            "noise": scenario.self_motion_noise.model_dump(mode="json"),
            "versions": {name: version(name) for name in ("eclipse-sumo", "highway-env", "numpy", "pyrender")},
            "numpy_simd": numpy_simd(),
            "code_sha256": code_sha256(PACKAGE, RECORDING_CODE),
        }

    def folder(self) -> Path:
        """Where the recording is, or will be; a drive that was recorded elsewhere stays where it is."""
        if self.drive_spec.recording is not None:
            return self.drive_spec.recording
        key = hashlib.sha256(json.dumps(self.content(), sort_keys=True).encode()).hexdigest()[:16]
        return self.root / "recordings" / f"{self.scenario.name}-{self.role}-{key}"


@lru_cache(maxsize=1)
def numpy_simd() -> list[str]:
    """The processor's extensions that NumPy computes with here: with others it rounds differently and draws another drive."""
    extensions: Any = np.show_config(mode="dicts")
    simd = extensions.get("SIMD Extensions", {})
    return [*simd.get("baseline", ()), *simd.get("found", ())]


@lru_cache(maxsize=4)
def _network_sha256(town: Town) -> str:
    """Of the town's file; asked for with each chunk of frames, and a large network takes a tenth of a second."""
    return sha256_of(town.net_file)


@lru_cache(maxsize=4)
def _town(scenario: Scenario, root: Path) -> Town:
    return build_town(scenario.town, scenario.seed, root / "towns")


def prepare(plan: RecordingPlan) -> list[int]:
    """Simulate and sense the drive unless that is on disk already; the chunks of frames still to draw."""
    folder = plan.folder()
    if (folder / MANIFEST).exists():
        return []
    if plan.drive_spec.recording is not None:
        raise RecordingError(
            f"{folder}: the scenario's {plan.role}.recording is no finished recording; `hippodrome import` makes one"
        )
    for abandoned in folder.glob(".*.part"):
        abandoned.unlink()
    if not (folder / "samples.npz").exists():
        _simulate(plan, folder)
    samples = read_samples(folder / "samples.npz")
    return [chunk for chunk in range(chunk_count(samples)) if not chunk_path(folder, chunk).exists()]


def simulate(plan: RecordingPlan, town: Town | None = None) -> tuple[Drive, Samples]:
    """The plan's drive, and what is sensed on it, without frames. Nothing is written but a town that has to be generated.

    A large town takes seconds to read: who has it already gives it.
    """
    scenario, noise = plan.scenario, plan.scenario.self_motion_noise
    town = plan.town() if town is None else town
    spec = plan.drive_spec
    ego = spec.ego.model_copy(update={"lateral_wander_m": max(spec.ego.lateral_wander_m, noise.lateral_wander_m)})
    drive = simulate_drive(town, spec.tour, spec.traffic, ego, plan.seed)
    motion = sense_self_motion(drive, scenario.odometry_rate_hz, noise, np.random.default_rng([plan.seed, 1]))
    return drive, sample_drive(drive, town.network, motion, camera_divider(scenario.camera, scenario.odometry_rate_hz))


def _simulate(plan: RecordingPlan, folder: Path) -> None:
    drive, samples = simulate(plan)
    write_drive(folder / "drive.npz", drive)
    write_arrays(folder / "samples.npz", {field.name: np.asarray(getattr(samples, field.name)) for field in fields(samples)})


def render_chunk(plan: RecordingPlan, chunk: int) -> int:
    """Draw one chunk of frames to disk; the number of frames."""
    samples = _episode_of(plan.folder())[0]
    write_chunk(chunk_path(plan.folder(), chunk), chunk * CHUNK_FRAMES, draw_chunk(plan, chunk))
    return len(_numbers(samples, chunk))


def draw_chunk(plan: RecordingPlan, chunk: int) -> Iterator[tuple[Frame, ...]]:
    """The frames of one chunk of a prepared drive, each drawn when it is asked for; nothing is written."""
    samples, drive = _episode_of(plan.folder())
    renderer, conditions = _renderer(plan), plan.drive_spec.conditions
    return (draw_frame(renderer, drive, samples, number, conditions, plan.seed) for number in _numbers(samples, chunk))


def _numbers(samples: Samples, chunk: int) -> range:
    first = chunk * CHUNK_FRAMES
    return range(first, min(first + CHUNK_FRAMES, len(samples.frame_steps)))


@lru_cache(maxsize=1)
def _episode_of(folder: Path) -> tuple[Samples, Drive]:
    return read_samples(folder / "samples.npz"), read_drive(folder / "drive.npz")


_live: list[tuple[tuple[Scenario, Role], FrameRenderer]] = []


def _renderer(plan: RecordingPlan) -> FrameRenderer:
    """The process's one live renderer: a second EGL context beside it would break it."""
    from hippodrome.sim.render.renderer import FrameRenderer  # not before a frame is drawn: commands that draw none need no GL

    key = (plan.scenario, plan.role)
    if not _live or _live[0][0] != key:
        close_renderer()
        poses_m = _episode_of(plan.folder())[0].poses_m
        scene = build_scene(plan.town(), plan.scenario.seed, plan.drive_spec.conditions, poses_m)
        _live.append((key, FrameRenderer(scene, plan.scenario.camera)))
    return _live[0][1]


def close_renderer() -> None:
    """Free the live renderer, if there is one."""
    for _, renderer in _live:
        renderer.close()
    _live.clear()


def finish(plan: RecordingPlan) -> Recording:
    """Seal a recording whose chunks are all drawn, or open the finished one."""
    folder = plan.folder()
    if (folder / MANIFEST).exists():
        return open_recording(folder)
    drive = read_drive(folder / "drive.npz")
    tour = {"coverage": round(drive.coverage, 4), "revisit_share": round(drive.revisit_share, 4)}
    return seal(folder, {**plan.content(), "tour": tour}, read_samples(folder / "samples.npz"))


def sensed_anew(recording: Recording, noise: SelfMotionNoise, rng: np.random.Generator) -> Recording:
    """The same drive and frames with another self-motion: what changes is what the odometry says, not where the car was."""
    drive, samples = read_drive(recording.folder / "drive.npz"), recording.samples
    motion = sense_self_motion(drive, 1.0 / float(samples.dt_s[0]), noise, rng)
    return replace(recording, samples=replace(samples, speed=motion.speed, yaw_rate_radps=motion.yaw_rate_radps))


def record(plan: RecordingPlan) -> Recording:
    """The whole recording in this process."""
    for chunk in prepare(plan):
        render_chunk(plan, chunk)
    return finish(plan)


def write_drive(path: Path, drive: Drive) -> None:
    """A drive on disk, with the traffic around it."""
    log = {f"traffic_{field.name}": getattr(drive.traffic, field.name) for field in fields(TrafficLog)}
    own = {field.name: getattr(drive, field.name) for field in fields(Drive) if field.name != "traffic"}
    write_arrays(path, {**{name: value for name, value in own.items() if value is not None}, **log})


def read_drive(path: Path) -> Drive:
    """A drive back from disk. Raises RecordingError."""
    log_names = [field.name for field in fields(TrafficLog)]
    names = [field.name for field in fields(Drive) if field.name not in ("traffic", "heights_m")]
    try:
        arrays = read_arrays(path, [*names, *(f"traffic_{name}" for name in log_names)], optional=["heights_m"])
        log = TrafficLog(**{name: arrays.pop(f"traffic_{name}") for name in log_names})
        coverage, revisit_share = float(arrays.pop("coverage")), float(arrays.pop("revisit_share"))
    except Exception as error:  # as of the samples
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise RecordingError(f"{path}: not a readable drive ({reason}); {ANEW}") from None
    return Drive(**arrays, traffic=log, coverage=coverage, revisit_share=revisit_share)
