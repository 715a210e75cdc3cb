"""``hippodrome import``: a drive that somebody else recorded becomes a recording, for ``map``, ``refine`` and ``localize``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

import numpy as np

from hippodrome.core.types import Trajectory
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.folder import new_folder
from hippodrome.eval.exchange.drives.foreign import ForeignDrive, Motion, motion_of
from hippodrome.eval.exchange.drives.new_recording import camera_record, field_of_view_deg, seal, write_frames, write_steps
from hippodrome.eval.exchange.drives.poses import Axes
from hippodrome.eval.exchange.drives.steps import begin_s, frames_within, steps_of
from hippodrome.eval.exchange.drives.truth import read_truth, require_overlap, truth_of_trajectory, write_truth
from hippodrome.eval.exchange.extra import optional_module
from hippodrome.eval.exchange.readers.tables import read_motion
from hippodrome.eval.files.spatial import flatten, read_poses

# Layout -> module below ``readers`` and its function, which takes the source and the axes of its poses.
READERS: Final = {
    "tum": ("tables", "read_tum_folder"),
    "kitti": ("tables", "read_kitti_sequence"),
    "euroc": ("tables", "read_euroc_folder"),
    "mcap": ("mcap_file", "read_mcap"),
    "rosbag": ("rosbag", "read_rosbag"),
}
FROM_TRUTH: Final = "truth"  # the value of --odometry that differentiates the truth
TruthFrame: TypeAlias = Literal["network", "own"]


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """What to import and, where the layout itself does not say it, how to take it."""

    source: Path
    kind: str  # a key of ``READERS``
    out: Path
    odometry: str | None = None  # a .csv of t_s,speed,yaw_rate, a .tum of poses, or "truth"; None: what the layout has
    truth: Path | None = None  # TUM poses or fixes that replace the layout's own
    network: Path | None = None  # whose frame fixes are projected into
    truth_sigma_m: float | None = None  # accuracy of the truth along one axis
    axes: Axes = "body"
    truth_frame: TruthFrame = "own"
    size_px: tuple[int, int] | None = None  # width and height to scale frames to; None: as they are


def import_drive(options: ImportOptions) -> None:
    """Write the recording ``options.out`` and say what it is made of. Raises HippodromeError, and then leaves nothing."""
    name, reader = READERS[options.kind]
    module = optional_module(f"hippodrome.eval.exchange.readers.{name}")
    drive: ForeignDrive = getattr(module, reader)(options.source, options.axes)
    known = (
        read_truth(options.truth, options.axes, options.network, options.truth_sigma_m)
        if options.truth
        else truth_of_trajectory(drive.truth)
        if drive.truth is not None
        else None
    )
    truth = known.trajectory if known is not None else None
    motion, origin = _motion(options, drive, truth)
    frames = frames_within(drive.frames, motion, options.source)
    samples = steps_of(frames, motion, truth)
    require_overlap(options.truth, known, begin_s(motion), float(motion.t_s[-1]))
    truth_share = float(np.isfinite(samples.poses_m).all(axis=1).mean())
    with new_folder(options.out) as building:
        width, height = write_frames(building, frames, options.size_px)
        write_steps(building, samples)
        write_truth(building, known, begin_s(motion))
        fov_deg = field_of_view_deg(drive.focal_px, drive.frames[0])
        content: dict[str, Any] = {
            "scenario": None,
            "imported": {
                "format": options.kind,
                "source": options.source.name,
                "self_motion": origin,
                "time_origin_s": begin_s(motion),
            },
            "camera": camera_record(samples, (width, height), fov_deg),
            "truth_share": round(truth_share, 6),
            "truth_frame": "network" if known is not None and known.in_network else options.truth_frame,
        }
        seal(building, content, samples)
    print(f"{options.out}: {len(frames)} frames of {width} x {height}, {len(samples.t_s)} steps over {samples.t_s[-1]:.1f} s; "
          f"self-motion: {origin}; truth for {truth_share:.0%} of the steps")  # fmt: skip
    for note in known.notes if known is not None else ():
        print(f"note: {note}")
    if (lost := len(drive.frames) - len(frames)) > 0:
        print(f"note: {lost} frame(s) outside of the self-motion's time are left out")
    if options.odometry == FROM_TRUTH:
        print("note: the self-motion is the truth's own: scores of this drive say nothing about drift")


def _motion(options: ImportOptions, drive: ForeignDrive, truth: Trajectory | None) -> tuple[Motion, str]:
    """The self-motion, and words that say where it comes from. Raises ExchangeError if there is none."""
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
    return motion_of(flatten(read_poses(path, options.axes)), str(path)), f"{path.name}, poses differentiated"
