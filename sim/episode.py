"""A drive as the vehicle's senses deliver it: what is sampled when, and the frames drawn for it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.se2 import interpolate
from hippodrome.core.types import FloatArray, Frame, GroundTruth, IntArray, Observation, Step
from hippodrome.sim.drive import drive_pitch_rad
from hippodrome.sim.scene.conditions import apply_camera
from hippodrome.sim.scene.conditions_spec import Conditions
from hippodrome.sim.self_motion import SelfMotion
from hippodrome.sim.traffic import traffic_at
from hippodrome.sim.types import Drive

if TYPE_CHECKING:
    from hippodrome.sim.render.renderer import FrameRenderer


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Everything of an episode but the frames: N steps, of which those with ``frame >= 0`` have one."""

    t_s: FloatArray  # (N,)
    dt_s: FloatArray  # (N,)
    speed: FloatArray  # (N,) map units per second
    yaw_rate_radps: FloatArray  # (N,)
    frame: IntArray  # (N,) frame number, -1: none
    poses_m: FloatArray  # (N, 3) ground truth
    speed_mps: FloatArray  # (N,)
    lane: IntArray  # (N,) index into lane_ids
    lane_position_m: FloatArray  # (N,)
    lane_ids: tuple[str, ...]

    def observation(self, i: int, frame: Frame | None) -> Observation:
        """Step ``i`` as the mapper sees it."""
        return Observation(float(self.t_s[i]), float(self.dt_s[i]), float(self.speed[i]), float(self.yaw_rate_radps[i]), frame)

    def ground_truth(self, i: int) -> GroundTruth:
        """Step ``i`` as only the scoring sees it."""
        x_m, y_m, heading_rad = (float(value) for value in self.poses_m[i])
        lane_id = self.lane_ids[self.lane[i]]
        return GroundTruth(
            float(self.t_s[i]), x_m, y_m, heading_rad, float(self.speed_mps[i]), lane_id, float(self.lane_position_m[i])
        )

    @property
    def frame_steps(self) -> IntArray:
        """Steps (F,) at which frame 0, 1, ... is taken."""
        return np.flatnonzero(self.frame >= 0).astype(np.int32)


def sample_drive(drive: Drive, network: RoadNetwork, motion: SelfMotion, camera_every: int) -> Samples:
    """Ground truth at the odometry's times; every ``camera_every``-th step takes a frame."""
    steps = np.arange(len(motion.t_s))
    nearest = np.clip(np.searchsorted(drive.t_s, motion.t_s - 1e-9), 0, len(drive.t_s) - 1)
    frame = np.where((steps + 1) % camera_every == 0, (steps + 1) // camera_every - 1, -1)
    return Samples(
        t_s=motion.t_s,
        dt_s=np.full(len(steps), motion.dt_s),
        speed=motion.speed,
        yaw_rate_radps=motion.yaw_rate_radps,
        frame=frame.astype(np.int32),
        poses_m=interpolate(drive.t_s, drive.poses_m, motion.t_s),
        speed_mps=np.interp(motion.t_s, drive.t_s, drive.speed_mps),
        lane=drive.lane[nearest],
        lane_position_m=drive.lane_position_m[nearest],
        lane_ids=network.lane_ids,
    )


def draw_frame(
    renderer: FrameRenderer, drive: Drive, samples: Samples, number: int, conditions: Conditions, seed: int
) -> tuple[Frame, ...]:
    """Frame ``number`` of the episode: one image, or (left, right) when the camera is a stereo pair."""
    step = samples.frame_steps[number]
    vehicles = traffic_at(drive.traffic, float(samples.t_s[step]))
    rng = np.random.default_rng([seed, number])
    pose_m = np.concatenate([samples.poses_m[step], _height_and_pitch(drive, float(samples.t_s[step]))])
    if renderer.camera.stereo_baseline_m is None:
        images: tuple[Frame, ...] = (renderer.render(pose_m, *vehicles),)
    else:
        images = renderer.render_stereo(pose_m, *vehicles)
    return tuple(apply_camera(image, conditions, rng) for image in images)


def _height_and_pitch(drive: Drive, t_s: float) -> FloatArray:
    """Height [m] and pitch [rad] of the ego at a time; nothing (0,) in a flat town."""
    if drive.heights_m is None:
        return np.zeros(0)
    pitch_rad = drive_pitch_rad(drive.poses_m, drive.heights_m)
    return np.array([np.interp(t_s, drive.t_s, drive.heights_m), np.interp(t_s, drive.t_s, pitch_rad)])


def episode(renderer: FrameRenderer, drive: Drive, samples: Samples, conditions: Conditions, seed: int) -> Iterator[Step]:
    """The drive step by step, each frame drawn when it is asked for."""
    for i in range(len(samples.t_s)):
        number = int(samples.frame[i])
        frame = draw_frame(renderer, drive, samples, number, conditions, seed)[0] if number >= 0 else None
        yield samples.observation(i, frame), samples.ground_truth(i)
