"""Recordings: an episode on disk, keyed by its content, made in resumable pieces, read back lazily.

A recording is a folder. ``samples.npz`` and ``drive.npz`` come first, then chunks of frames (ZIP archives of PNG images, which
any tool opens), then ``manifest.json`` with the hash of each file: its presence says that all is there. Every file is whole or
absent, so a killed run continues where it was, and the bytes do not depend on how many processes made them.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2

from hippodrome._files import read_bounded, replacing, sha256_of, why_unreadable
from hippodrome._json import parse_json
from hippodrome.core.types import Frame, HippodromeError, Observation, Step, Trajectory
from hippodrome.sim.array_file import read_arrays
from hippodrome.sim.episode import Samples
from hippodrome.sim.recording_checks import MAX_FRAME_BYTES, check_samples, decoded_png, require_checksum, with_checksum

FORMAT = 1
CHUNK_FRAMES = 250  # a few seconds of rendering: what a kill can cost at most, and what a second process can take over
PNG_LEVEL = 1  # fastest: level 3 saves 6 % of the space for twice the time
MANIFEST = "manifest.json"
MAX_MANIFEST_BYTES = 16 << 20  # a line for each quarter of a minute
ANEW = "delete the recording to make it anew"
MAX_STEPS = 20_000_000  # refuse hostile sizes before memory is taken: 20 days at 11 Hz


class RecordingError(HippodromeError):
    """A recording that cannot be read, or is not one."""


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """A finished recording. Iterating yields (Observation, GroundTruth); frames are decoded when their step is reached."""

    folder: Path
    manifest: dict[str, Any]
    samples: Samples

    def __iter__(self) -> Iterator[Step]:
        for i, observation in enumerate(self.observations()):
            yield observation, self.samples.ground_truth(i)

    def observations(self) -> Iterator[Observation]:
        """What the mapper and the localizer may have: no ground truth travels with it."""
        for i, number in enumerate(self.samples.frame):
            yield self.samples.observation(i, self.frame(int(number)) if number >= 0 else None)

    def self_motion(self) -> Iterator[Observation]:
        """The observations of a blindfolded vehicle: no frame is decoded."""
        return (self.samples.observation(i, None) for i in range(len(self.samples.t_s)))

    def ground_truth(self) -> Trajectory:
        """The reference for scoring."""
        return Trajectory(t_s=self.samples.t_s, poses=self.samples.poses_m)

    @property
    def frame_count(self) -> int:
        return len(self.samples.frame_steps)

    def frame(self, number: int, side: str = "") -> Frame:
        """RGB frame (H, W, 3); ``side`` is "r" for the right image of a stereo pair."""
        path = chunk_path(self.folder, number // CHUNK_FRAMES)
        try:
            archive = _open_chunk(path, path.stat().st_mtime_ns)
            entry = archive.getinfo(frame_name(number, side))
            if entry.file_size > MAX_FRAME_BYTES:  # no more than this is unpacked of it, whatever comes
                raise ValueError(f"{entry.file_size} bytes, the limit is {MAX_FRAME_BYTES}")
            return decoded_png(archive.read(entry))
        except MemoryError:
            raise
        except Exception as error:  # packed in a way that is not known, encrypted, cut short: zipfile has an exception for each
            raise RecordingError(f"{path}: frame {number} cannot be read ({_said(error)}); {ANEW}") from None


@lru_cache(maxsize=4)
def _open_chunk(path: Path, _modified_ns: int) -> zipfile.ZipFile:
    archive = zipfile.ZipFile(path)
    names = archive.namelist()
    if len(names) != len(set(names)):
        raise ValueError("two of its members have the same name")
    return archive


def chunk_path(folder: Path, chunk: int) -> Path:
    return folder / f"frames-{chunk:04d}.zip"


def chunk_count(samples: Samples) -> int:
    return -(-len(samples.frame_steps) // CHUNK_FRAMES)


def frame_name(number: int, side: str = "") -> str:
    return f"{number:06d}{side}.png"


def write_chunk(path: Path, first: int, frames: Iterator[tuple[Frame, ...]]) -> None:
    """One archive of consecutive frames; (left, right) pairs become ``N.png`` and ``Nr.png``."""
    with replacing(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED) as archive:
        for number, images in enumerate(frames, start=first):
            for side, image in zip(("", "r"), images, strict=False):
                _, png = cv2.imencode(".png", image[:, :, ::-1], [cv2.IMWRITE_PNG_COMPRESSION, PNG_LEVEL])
                archive.writestr(zipfile.ZipInfo(frame_name(number, side)), png.tobytes())


def read_samples(path: Path) -> Samples:
    """Samples back from disk, checked. Raises RecordingError."""
    try:
        arrays = read_arrays(path, [field.name for field in fields(Samples)])
        check_samples(arrays, MAX_STEPS)
    except Exception as error:  # NumPy, zipfile and zlib have many, and a claimed size may be beyond all memory
        raise RecordingError(f"{path}: not a readable sample file ({_said(error)}); {ANEW}") from None
    lane_ids = tuple(str(name) for name in arrays.pop("lane_ids"))
    return Samples(**arrays, lane_ids=lane_ids)


def _said(error: Exception) -> str:
    """An exception in a line; some say nothing but their name."""
    return why_unreadable(error)[:200]


def seal(folder: Path, content: dict[str, Any], samples: Samples) -> Recording:
    """Write the manifest: what the recording was made from, and the hash of each of its files."""
    names = ["samples.npz", "drive.npz", *(chunk_path(folder, chunk).name for chunk in range(chunk_count(samples)))]
    manifest = with_checksum({"format": FORMAT, **content, "sha256": {name: sha256_of(folder / name) for name in names}})
    with replacing(folder / MANIFEST) as temporary:
        temporary.write_text(json.dumps(manifest, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    return Recording(folder, manifest, samples)


def open_recording(folder: Path, verify: bool = True) -> Recording:
    """A finished recording; ``verify`` compares every file with its hash first. Raises RecordingError."""
    path = folder / MANIFEST
    try:
        manifest = parse_json(read_bounded(path, MAX_MANIFEST_BYTES))
        files = manifest["sha256"]
        version = manifest["format"]
        require_checksum(manifest)
    except FileNotFoundError:
        raise RecordingError(
            f"{folder}: not a finished recording (no {MANIFEST}); run `hippodrome render` to finish it"
        ) from None
    except NotADirectoryError:
        raise RecordingError(
            f"{folder}: a file, or below one, where a recording's folder is wanted; name the folder with {MANIFEST} in it, "
            f"as `hippodrome render` or `hippodrome import` made it"
        ) from None
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise RecordingError(f"{path}: not a recording's manifest ({_said(error)}); {ANEW}") from None
    if version != FORMAT:
        raise RecordingError(f"{path}: recording format {version}, this version reads {FORMAT}")
    if not isinstance(files, dict) or "samples.npz" not in files:
        raise RecordingError(f"{path}: not a recording's manifest (no file list)")
    for name, digest in files.items():
        _check_file(folder, name, digest if verify else None)
    samples = read_samples(folder / "samples.npz")
    if any(chunk_path(folder, chunk).name not in files for chunk in range(chunk_count(samples))):
        raise RecordingError(f"{path}: frames are missing from the manifest; delete the recording to make it anew")
    return Recording(folder, manifest, samples)


def _check_file(folder: Path, name: str, digest: str | None) -> None:
    path = folder / name
    if Path(name).name != name or not path.is_file():
        raise RecordingError(f"{path}: named in the manifest and not there; delete the recording to make it anew")
    if digest is not None and sha256_of(path) != digest:
        raise RecordingError(f"{path}: truncated or changed since it was recorded; delete the recording to make it anew")
