"""Stereo pairs of a drive on disk: grey JPEG images in resumable chunks, a quarter of what colour PNG would take.

They are for methods that need another camera than the scenario's. A drive of 20 minutes has 15,000 pairs of 640x480, 10 GB as
PNG. Trackers use grey images only, and cameras that record for SLAM compress their images as well.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from hippodrome._files import replacing, why_unreadable
from hippodrome.core.types import Frame, HippodromeError, Trajectory
from hippodrome.eval.methods.protocol import StereoObservation
from hippodrome.sim.episode import Samples
from hippodrome.sim.record import RecordingPlan, draw_chunk
from hippodrome.sim.recording import CHUNK_FRAMES, read_samples
from hippodrome.sim.render.camera import CameraSpec

QUALITY = 92  # JPEG's; it changes a grey level by 1.4 of 255 in the mean, as much as a good camera's noise


@dataclass(frozen=True, slots=True)
class StereoDrive:
    """Consecutive stereo pairs of a drive. Pairs outside of this stretch need not have been drawn."""

    folder: Path
    samples: Samples
    camera: CameraSpec
    first: int  # number of the first pair
    frames: int  # number of pairs

    @property
    def times_s(self) -> list[float]:
        """Time stamps of the pairs."""
        steps = self.samples.frame_steps[self.first : self.first + self.frames]
        return [float(t_s) for t_s in self.samples.t_s[steps]]

    @property
    def duration_s(self) -> float:
        """Duration of the stretch, which CPU time is related to."""
        return self.frames / self.camera.rate_hz

    def truth(self) -> Trajectory:
        """True poses of the body over the whole drive, for scoring only."""
        return Trajectory(self.samples.t_s, self.samples.poses_m)

    def part(self, first: int, frames: int) -> StereoDrive:
        """The stretch of ``frames`` pairs from the pair ``first`` of this one on."""
        return StereoDrive(self.folder, self.samples, self.camera, self.first + first, frames)

    def observations(self) -> Iterator[StereoObservation]:
        """The steps that have a pair, with grey images (H, W)."""
        samples = self.samples
        for number in range(self.first, self.first + self.frames):
            step = int(samples.frame_steps[number])
            one, (left, right) = samples.observation(step, None), read_pair(self.folder, number)
            yield StereoObservation(one.t_s, one.dt_s, one.speed, one.yaw_rate_radps, left, right)


def stereo_drive(plan: RecordingPlan, frames: int | None = None) -> StereoDrive:
    """The pairs of a prepared plan, all or the first ``frames`` of them, whether they have been drawn or not."""
    samples = read_samples(plan.folder() / "samples.npz")
    every = len(samples.frame_steps)
    return StereoDrive(plan.folder(), samples, plan.scenario.camera, 0, every if frames is None else min(frames, every))


def missing_chunks(drive: StereoDrive) -> list[int]:
    """Numbers of the chunks of pairs that the drive needs and that are not on disk."""
    needed = range(drive.first // CHUNK_FRAMES, (drive.first + drive.frames - 1) // CHUNK_FRAMES + 1)
    return [chunk for chunk in needed if not _chunk_path(drive.folder, chunk).exists()]


def draw_pairs(task: tuple[RecordingPlan, int]) -> None:
    """Draw one chunk of pairs to disk; the task is a prepared plan and the chunk's number."""
    plan, chunk = task
    path = _chunk_path(plan.folder(), chunk)
    with replacing(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED) as archive:
        for number, images in enumerate(draw_chunk(plan, chunk), start=chunk * CHUNK_FRAMES):
            for side, image in zip("lr", images, strict=True):
                grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
                _, jpeg = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
                archive.writestr(zipfile.ZipInfo(_name(number, side)), jpeg.tobytes())


def read_pair(folder: Path, number: int) -> tuple[Frame, Frame]:
    """Left and right grey image (H, W) of one frame. Raises HippodromeError if they are not on disk or not readable."""
    path = _chunk_path(folder, number // CHUNK_FRAMES)
    try:
        blobs = [_open(path, path.stat().st_mtime_ns).read(_name(number, side)) for side in "lr"]
        left, right = (cv2.imdecode(np.frombuffer(blob, np.uint8), cv2.IMREAD_GRAYSCALE) for blob in blobs)
    except (OSError, KeyError, zipfile.BadZipFile, cv2.error) as error:
        raise HippodromeError(
            f"{path}: pair {number} cannot be read ({why_unreadable(error)}); delete the file to draw it anew"
        ) from None
    if left is None or right is None:
        raise HippodromeError(f"{path}: pair {number} is no image; delete the file to draw it anew")
    return np.asarray(left, dtype=np.uint8), np.asarray(right, dtype=np.uint8)


@lru_cache(maxsize=2)
def _open(path: Path, _modified_ns: int) -> zipfile.ZipFile:
    return zipfile.ZipFile(path)


def _chunk_path(folder: Path, chunk: int) -> Path:
    return folder / f"pairs-{chunk:04d}.zip"


def _name(number: int, side: str) -> str:
    return f"{number:06d}{side}.jpg"
