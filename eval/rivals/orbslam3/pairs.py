"""Stereo pairs of a drive on disk: grey JPEG images in resumable chunks, a quarter of what colour PNG would take.

A drive of 20 minutes has 15,000 pairs: 10 GB as PNG. Cameras that record for SLAM compress as well, and the tracker reads grey.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from hippodrome._files import replacing
from hippodrome.core.types import Frame, HippodromeError, Trajectory
from hippodrome.sim.episode import Samples
from hippodrome.sim.record import RecordingPlan, draw_chunk
from hippodrome.sim.recording import CHUNK_FRAMES, read_samples
from hippodrome.sim.render.camera import CameraSpec

QUALITY = 92  # changes a level by 1.4 of 255 in the mean: a good camera's noise


@dataclass(frozen=True, slots=True)
class StereoDrive:
    """``frames`` consecutive stereo pairs of a drive, from number ``first`` on; those beyond need not be drawn yet."""

    folder: Path
    samples: Samples
    camera: CameraSpec
    first: int
    frames: int

    @property
    def times_s(self) -> list[float]:
        steps = self.samples.frame_steps[self.first : self.first + self.frames]
        return [float(t_s) for t_s in self.samples.t_s[steps]]

    @property
    def duration_s(self) -> float:
        """Of the sequence: what CPU time is a share of."""
        return self.frames / self.camera.rate_hz

    def truth(self) -> Trajectory:
        """Body poses of the whole drive, for scoring only."""
        return Trajectory(self.samples.t_s, self.samples.poses_m)

    def part(self, first: int, frames: int) -> StereoDrive:
        """A stretch of it, numbered from its own first pair."""
        return StereoDrive(self.folder, self.samples, self.camera, self.first + first, frames)

    def pairs(self) -> Iterator[bytes]:
        """Time stamp and both grey images of each frame, as the runner reads them."""
        for number, t_s in enumerate(self.times_s, start=self.first):
            left, right = read_pair(self.folder, number)
            yield np.float64(t_s).astype("<f8").tobytes() + left.tobytes() + right.tobytes()


def stereo_drive(plan: RecordingPlan, frames: int | None = None) -> StereoDrive:
    """The drive of a prepared plan, or its first ``frames`` pairs."""
    samples = read_samples(plan.folder() / "samples.npz")
    every = len(samples.frame_steps)
    return StereoDrive(plan.folder(), samples, plan.scenario.camera, 0, every if frames is None else min(frames, every))


def missing_chunks(drive: StereoDrive) -> list[int]:
    """Chunks that the drive needs and that are not on disk."""
    needed = range(drive.first // CHUNK_FRAMES, (drive.first + drive.frames - 1) // CHUNK_FRAMES + 1)
    return [chunk for chunk in needed if not _chunk_path(drive.folder, chunk).exists()]


def draw_pairs(task: tuple[RecordingPlan, int]) -> None:
    """Draw one chunk of a prepared plan to disk."""
    plan, chunk = task
    path = _chunk_path(plan.folder(), chunk)
    with replacing(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED) as archive:
        for number, images in enumerate(draw_chunk(plan, chunk), start=chunk * CHUNK_FRAMES):
            for side, image in zip("lr", images, strict=True):
                grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
                _, jpeg = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
                archive.writestr(zipfile.ZipInfo(_name(number, side)), jpeg.tobytes())


def read_pair(folder: Path, number: int) -> tuple[Frame, Frame]:
    """Left and right grey image (H, W). Raises HippodromeError."""
    path = _chunk_path(folder, number // CHUNK_FRAMES)
    try:
        blobs = [_open(path, path.stat().st_mtime_ns).read(_name(number, side)) for side in "lr"]
        left, right = (cv2.imdecode(np.frombuffer(blob, np.uint8), cv2.IMREAD_GRAYSCALE) for blob in blobs)
    except (OSError, KeyError, zipfile.BadZipFile, cv2.error) as error:
        raise HippodromeError(f"{path}: pair {number} cannot be read ({error}); delete the file to draw it anew") from None
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
