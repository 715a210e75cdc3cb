"""``hippodrome import``: a drive that somebody else recorded becomes a recording, for ``map``, ``refine`` and ``localize``."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final, Literal

import cv2
import numpy as np

from hippodrome._files import sha256_of, write_atomically
from hippodrome.core.types import FloatArray, Frame, Trajectory
from hippodrome.eval.exchange.drives.exported import ExchangeError
from hippodrome.eval.exchange.drives.foreign import (
    ForeignDrive,
    ForeignFrame,
    Motion,
    decode,
    motion_of,
    require_increasing,
    truth_at,
)
from hippodrome.eval.exchange.drives.poses import Axes
from hippodrome.eval.exchange.export import format_module, new_folder
from hippodrome.eval.exchange.readers.tables import read_motion, read_tum_poses
from hippodrome.sim.episode import Samples
from hippodrome.sim.recording import (
    CHUNK_FRAMES,
    FORMAT,
    MANIFEST,
    MAX_STEPS,
    chunk_count,
    chunk_path,
    write_arrays,
    write_chunk,
)

READERS: Final = {
    "tum": ("tables", "read_tum_folder"),
    "kitti": ("tables", "read_kitti_sequence"),
    "euroc": ("tables", "read_euroc_folder"),
    "mcap": ("mcap_file", "read_mcap"),
    "rosbag": ("rosbag", "read_rosbag"),
}
SAME_TIME_S = 1e-4  # a frame and a row of self-motion closer than this are of one instant: stamps are rounded
FROM_TRUTH = "truth"  # --odometry truth
TruthFrame = Literal["network", "own"]


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """What the layout itself does not say."""

    source: Path
    kind: str
    out: Path
    odometry: str | None = None  # a .csv of t_s,speed,yaw_rate, a .tum of poses, or "truth"
    truth: Path | None = None  # TUM poses, instead of the layout's own
    axes: Axes = "body"
    truth_frame: TruthFrame = "own"
    size_px: tuple[int, int] | None = None  # width, height


def import_drive(options: ImportOptions) -> None:
    """Write the recording ``options.out`` and say what it is made of. Raises HippodromeError, and then leaves nothing."""
    name, reader = READERS[options.kind]
    module = format_module(f"hippodrome.eval.exchange.readers.{name}")
    drive: ForeignDrive = getattr(module, reader)(options.source, options.axes)
    truth = read_tum_poses(options.truth, options.axes) if options.truth else drive.truth
    motion, origin = _motion(options, drive, truth)
    frames = _usable(drive.frames, motion, options.source)
    samples = _samples(frames, motion, truth)
    with new_folder(options.out) as building:
        size_px = _write_frames(building, frames, options.size_px)
        arrays = {field.name: np.asarray(getattr(samples, field.name)) for field in fields(Samples)}
        write_arrays(building / "samples.npz", arrays)
        known = float(np.isfinite(samples.poses_m).all(axis=1).mean())
        content = _content(options, drive, samples, size_px, origin, known, _begin(motion))
        _seal(building, content, samples)
    width, height = size_px
    print(f"{options.out}: {len(frames)} frames of {width} x {height}, {len(samples.t_s)} steps over {samples.t_s[-1]:.1f} s; "
          f"self-motion: {origin}; truth for {known:.0%} of the steps")  # fmt: skip
    if (lost := len(drive.frames) - len(frames)) > 0:
        print(f"note: {lost} frame(s) outside of the self-motion's time are left out")
    if options.odometry == FROM_TRUTH:
        print("note: the self-motion is the truth's own: scores of this drive say nothing about drift")


def _motion(options: ImportOptions, drive: ForeignDrive, truth: Trajectory | None) -> tuple[Motion, str]:
    """Self-motion, and where it comes from."""
    given = options.odometry
    if given is None:
        if drive.motion is None:
            raise ExchangeError(
                f"{options.source}: no self-motion in it; give --odometry FILE.csv (t_s,speed,yaw_rate), FILE.tum (poses), "
                "or 'truth' to differentiate the truth"
            )
        return drive.motion, "as in the layout"
    if given == FROM_TRUTH:
        if truth is None:
            raise ExchangeError(f"{options.source}: no truth to differentiate; give --odometry FILE.csv or FILE.tum")
        return motion_of(truth, f"{options.source}: truth"), "the truth differentiated"
    path = Path(given)
    if path.suffix == ".csv":
        return read_motion(path), f"{path.name}, speed and yaw rate"
    return motion_of(read_tum_poses(path, options.axes), str(path)), f"{path.name}, poses differentiated"


def _usable(frames: Any, motion: Motion, source: Path) -> list[ForeignFrame]:
    """Frames within the time that the self-motion covers."""
    if not frames:
        raise ExchangeError(f"{source}: no frames")
    require_increasing(np.array([frame.t_s for frame in frames]), f"{source}: frames")
    begins_s = _begin(motion)
    found = [frame for frame in frames if begins_s + SAME_TIME_S < frame.t_s <= motion.t_s[-1] + SAME_TIME_S]
    if not found:
        raise ExchangeError(
            f"{source}: no frame within the self-motion's time, {begins_s:.3f} to {motion.t_s[-1]:.3f} s; "
            "give both the same clock"
        )
    return found


def _samples(frames: list[ForeignFrame], motion: Motion, truth: Trajectory | None) -> Samples:
    """A step wherever a row of self-motion or a frame ends one; the row that a frame cuts in two holds in both parts."""
    frame_s = np.array([frame.t_s for frame in frames])
    near = np.abs(motion.t_s[_nearest(motion.t_s, frame_s)] - frame_s) <= SAME_TIME_S
    t_s = np.union1d(motion.t_s, frame_s[~near])
    if len(t_s) > MAX_STEPS:
        raise ExchangeError(f"{len(t_s)} steps, a recording has at most {MAX_STEPS}")
    begins_s = _begin(motion)
    row = np.minimum(np.searchsorted(motion.t_s, t_s), len(motion.t_s) - 1)
    frame = np.full(len(t_s), -1, dtype=np.int32)
    frame[_nearest(t_s, frame_s)] = np.arange(len(frame_s), dtype=np.int32)
    if np.count_nonzero(frame >= 0) != len(frame_s):
        raise ExchangeError(f"two frames within {SAME_TIME_S:g} s of one another: not a drive of one camera")
    count = len(t_s)
    return Samples(
        t_s=t_s - begins_s,
        dt_s=np.diff(t_s, prepend=begins_s),
        speed=motion.speed[row],
        yaw_rate_radps=motion.yaw_rate_radps[row],
        frame=frame,
        poses_m=np.full((count, 3), np.nan) if truth is None else truth_at(truth, t_s),
        speed_mps=np.full(count, np.nan),
        lane=np.zeros(count, dtype=np.int32),
        lane_position_m=np.full(count, np.nan),
        lane_ids=("",),
    )


def _begin(motion: Motion) -> float:
    """When the first row of self-motion began: it lasted as long as the second."""
    return float(motion.t_s[0] - (motion.t_s[1] - motion.t_s[0]))


def _nearest(t_s: FloatArray, wanted_s: FloatArray) -> Any:
    """Index (M,) of the time (N,) nearest to each wanted one."""
    after = np.clip(np.searchsorted(t_s, wanted_s), 1, len(t_s) - 1)
    return after - (wanted_s - t_s[after - 1] < t_s[after] - wanted_s)


def _write_frames(folder: Path, frames: list[ForeignFrame], size_px: tuple[int, int] | None) -> tuple[int, int]:
    """All chunks; every frame has the size of the first. The size, width and height."""
    first = decode(frames[0])
    own = (first.shape[1], first.shape[0])

    def images(part: list[ForeignFrame]) -> Iterator[tuple[Frame, ...]]:
        for frame in part:
            image = decode(frame)
            width, height = image.shape[1], image.shape[0]
            if (width, height) != own:
                raise ExchangeError(f"{frame.name}: {width} x {height} pixels, the first frame has {own[0]} x {own[1]}")
            if size_px is not None:
                image = np.asarray(cv2.resize(image, size_px, interpolation=cv2.INTER_AREA), np.uint8)
            yield (image,)

    for begin in range(0, len(frames), CHUNK_FRAMES):
        write_chunk(chunk_path(folder, begin // CHUNK_FRAMES), begin, images(frames[begin : begin + CHUNK_FRAMES]))
    return size_px or own


def _content(
    options: ImportOptions,
    drive: ForeignDrive,
    samples: Samples,
    size_px: tuple[int, int],
    origin: str,
    known: float,
    begins_s: float,
) -> dict[str, Any]:
    """What the manifest says in place of a scenario."""
    frame_s = samples.t_s[samples.frame_steps]
    rate_hz = float(1.0 / np.median(np.diff(frame_s))) if len(frame_s) > 1 else 1.0
    camera: dict[str, Any] = {"width": size_px[0], "height": size_px[1], "rate_hz": round(rate_hz, 6)}
    if drive.focal_px and drive.focal_px > 0.0:
        with_first = decode(drive.frames[0]).shape[1]  # the focal length is of the size as recorded
        fov_deg = float(np.degrees(2.0 * np.arctan(0.5 * with_first / drive.focal_px)))
        if 20.0 <= fov_deg <= 150.0:
            camera["fov_deg"] = fov_deg
    return {
        "scenario": None,
        "imported": {"format": options.kind, "source": options.source.name, "self_motion": origin, "time_origin_s": begins_s},
        "camera": camera,
        "truth_share": round(known, 6),
        "truth_frame": options.truth_frame,
    }


def _seal(folder: Path, content: dict[str, Any], samples: Samples) -> None:
    """The manifest of a recording without ``drive.npz``: how the vehicle really drove, and among whom, nobody knows."""
    names = ["samples.npz", *(chunk_path(folder, chunk).name for chunk in range(chunk_count(samples)))]
    manifest = {"format": FORMAT, **content, "sha256": {name: sha256_of(folder / name) for name in names}}
    write_atomically(folder / MANIFEST, (json.dumps(manifest, indent=1, sort_keys=True) + "\n").encode())
