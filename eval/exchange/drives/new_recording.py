"""The files of a recording that is made of a foreign drive."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from hippodrome._files import sha256_of, write_atomically
from hippodrome.core.types import Frame
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.foreign import ForeignFrame
from hippodrome.eval.exchange.drives.images import decode
from hippodrome.eval.exchange.drives.truth import TRUTH_FILE
from hippodrome.sim.array_file import write_arrays
from hippodrome.sim.episode import Samples
from hippodrome.sim.recording import CHUNK_FRAMES, FORMAT, MANIFEST, chunk_count, chunk_path, write_chunk
from hippodrome.sim.recording_checks import with_checksum

FOV_DEG: Final = (20.0, 150.0)  # fields of view that a camera of ours can have; others are left out as unknown


def write_frames(
    folder: Path,
    frames: Sequence[ForeignFrame],
    size_px: tuple[int, int] | None,
    undistort: Callable[[Frame], Frame] | None = None,
) -> tuple[int, int]:
    """Write all frames, freed of the lens's distortion and scaled where that is asked for.

    Args:
        folder: The recording.
        frames: What to write.
        size_px: Width and height to scale to; None: as they are.
        undistort: Takes a frame as recorded; None: as they are.

    Returns:
        Width and height of what was written; 0, 0 if there are no frames.

    Raises:
        ExchangeError: A frame cannot be read or has not the size of the first.
    """
    if not frames:
        return 0, 0
    first = decode(frames[0])
    own = (first.shape[1], first.shape[0])

    def images(part: Sequence[ForeignFrame]) -> Iterator[tuple[Frame, ...]]:
        for frame in part:
            image = decode(frame)
            width, height = image.shape[1], image.shape[0]
            if (width, height) != own:
                raise ExchangeError(f"{frame.name}: {width} x {height} pixels, the first frame has {own[0]} x {own[1]}")
            if undistort is not None:
                image = undistort(image)
            if size_px is not None:
                image = np.asarray(cv2.resize(image, size_px, interpolation=cv2.INTER_AREA), np.uint8)
            yield (image,)

    for begin in range(0, len(frames), CHUNK_FRAMES):
        write_chunk(chunk_path(folder, begin // CHUNK_FRAMES), begin, images(frames[begin : begin + CHUNK_FRAMES]))
    return size_px or own


def write_steps(folder: Path, samples: Samples) -> None:
    """Write the steps of the drive."""
    write_arrays(folder / "samples.npz", {field.name: np.asarray(getattr(samples, field.name)) for field in fields(Samples)})


def camera_record(samples: Samples, size_px: tuple[int, int], fov_deg: float | None) -> dict[str, Any]:
    """What the manifest says of the camera: nothing if there was none, its field of view only where it is known."""
    frame_s = samples.t_s[samples.frame_steps]
    if not len(frame_s):
        return {}
    rate_hz = float(1.0 / np.median(np.diff(frame_s))) if len(frame_s) > 1 else 1.0
    camera: dict[str, Any] = {"width": size_px[0], "height": size_px[1], "rate_hz": round(rate_hz, 6)}
    return camera if fov_deg is None else {**camera, "fov_deg": fov_deg}


def field_of_view_deg(focal_px: float | None, width_px: int) -> float | None:
    """Horizontal field of view from the focal length, in pixels of frames of this width; None if it is unknown or unusual."""
    if not focal_px or focal_px <= 0.0:
        return None
    fov_deg = float(np.degrees(2.0 * np.arctan(0.5 * width_px / focal_px)))
    return fov_deg if FOV_DEG[0] <= fov_deg <= FOV_DEG[1] else None


def seal(folder: Path, content: dict[str, Any], samples: Samples) -> None:
    """Write the manifest, which makes the folder a recording. There is no ``drive.npz``: how the vehicle really drove, and among
    which others, nobody knows.
    """
    names = ["samples.npz", *(chunk_path(folder, chunk).name for chunk in range(chunk_count(samples)))]
    if (folder / TRUTH_FILE).exists():
        names.append(TRUTH_FILE)
    manifest = with_checksum({"format": FORMAT, **content, "sha256": {name: sha256_of(folder / name) for name in names}})
    write_atomically(folder / MANIFEST, (json.dumps(manifest, indent=1, sort_keys=True) + "\n").encode())
