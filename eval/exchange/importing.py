"""``hippodrome import``: a drive that somebody else recorded becomes a recording, for ``map``, ``refine`` and ``localize``."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

import numpy as np

from hippodrome.core.types import FloatArray, Trajectory
from hippodrome.core.views.egomotion.camera import RoadCamera
from hippodrome.eval.exchange.drives.calibration import Calibration, scaled, undistorter
from hippodrome.eval.exchange.drives.clock import TimeUnit
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.folder import new_folder
from hippodrome.eval.exchange.drives.foreign import ForeignDrive, Motion, motion_of, require_increasing
from hippodrome.eval.exchange.drives.images import decode
from hippodrome.eval.exchange.drives.lever import Ahead
from hippodrome.eval.exchange.drives.new_recording import camera_record, field_of_view_deg, seal, write_frames, write_steps
from hippodrome.eval.exchange.drives.offset import (
    TimeOffset,
    Turns,
    told_offset,
    turns_of_frames,
    turns_of_motion,
    turns_of_trajectory,
)
from hippodrome.eval.exchange.drives.plausible import require_plausible
from hippodrome.eval.exchange.drives.poses import Axes
from hippodrome.eval.exchange.drives.steps import begin_s, frames_within, steps_of
from hippodrome.eval.exchange.drives.truth import Truth, read_truth, require_overlap, truth_of_trajectory, write_truth
from hippodrome.eval.exchange.drives.visual import pinhole, seen_focal_px, visual_motion
from hippodrome.eval.exchange.extra import optional_module
from hippodrome.eval.exchange.readers.calibration import read_calibration
from hippodrome.eval.exchange.readers.layouts import recognised
from hippodrome.eval.exchange.readers.pictures import read_image_folder, read_video
from hippodrome.eval.exchange.readers.self_motion import read_bare_odometry, read_self_motion
from hippodrome.eval.exchange.readers.tables import is_kitti_poses, read_poses
from hippodrome.eval.methods.beforehand import UNITS

# Layout -> module below ``readers`` and its function, which takes the source and the axes of its poses.
READERS: Final = {
    "tum": ("tables", "read_tum_folder"),
    "kitti": ("tables", "read_kitti_sequence"),
    "kitti-raw": ("kitti_raw", "read_kitti_raw"),
    "euroc": ("tables", "read_euroc_folder"),
    "donkeycar": ("donkeycar", "read_tub"),
    "mcap": ("mcap_file", "read_mcap"),
    "rosbag": ("rosbag", "read_rosbag"),
}
LOGS: Final = ("mcap", "rosbag")  # the layouts of messages on topics
FROM_TRUTH: Final = "truth"  # the value of --odometry that differentiates the truth
VISUAL: Final = "visual"  # the value of --odometry that looks at the frames
TruthFrame: TypeAlias = Literal["network", "own"]


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """What to import and, where the layout itself does not say it, how to take it."""

    source: Path
    kind: str | None  # a key of ``READERS``, "images", "video" or "odometry"; None: recognised by what the source holds
    out: Path
    odometry: str | None = None  # a .csv of t_s,speed,yaw_rate, a file of poses, "truth" or "visual"; None: what the layout has
    truth: Path | None = None  # poses or fixes that replace the layout's own
    network: Path | None = None  # whose frame fixes are projected into
    truth_sigma_m: float | None = None  # accuracy of the truth along one axis
    axes: Axes | None = None  # None: the layout's, which is the camera's for KITTI and else the vehicle's
    truth_frame: TruthFrame = "own"
    size_px: tuple[int, int] | None = None  # width and height to scale frames to; None: as they are
    fps: float | None = None  # frames a second, where nothing else says when they were taken
    time_unit: TimeUnit | None = None  # of the file of ``odometry``; None: recognised
    time_offset_s: TimeOffset = 0.0  # added to the times of the self-motion; "auto": told by turns
    calibration: Path | None = None  # of the camera
    camera_height_m: float = 1.5  # above the road, for "visual"
    camera_ahead: Ahead = "auto"  # how far ahead of the rear axle the poses of ``odometry`` lie, in their unit
    topics: tuple[str, ...] = ()  # those of a log that are used; the others are chosen by their names and types
    truth_ahead: Ahead | None = None  # the same of the truth's poses; None: as ``camera_ahead``
    truth_offset_s: TimeOffset = 0.0  # added to the times of the truth; "auto": told by turns
    metres_per_unit: float | None = None  # length of the self-motion's unit; None: unknown


def import_drive(options: ImportOptions) -> None:
    """Write the recording ``options.out`` and say what it is made of. Raises HippodromeError, and then leaves nothing."""
    kind = options.kind or recognised(options.source)
    axes: Axes = options.axes or ("camera" if kind == "kitti" else "body")
    options = replace(options, kind=kind, axes=axes)
    drive = _read(options, kind, axes)
    if not drive.frames and kind != "odometry":
        raise ExchangeError(f"{options.source}: no frames in it")
    require_increasing(np.array([frame.t_s for frame in drive.frames]), f"{options.source}: frames")
    own_px = _size_of(drive)
    calibration = _calibration(options, own_px)
    pose_t_s = drive.pose_t_s if drive.pose_t_s is not None else np.array([frame.t_s for frame in drive.frames])
    known = _known_truth(options, drive, axes, pose_t_s)
    truth = known.trajectory if known is not None else None
    motion, origin = _motion(options, drive, truth, calibration)
    if offset_s := _offset_s(options, drive, motion, known, calibration):
        motion = replace(motion, t_s=motion.t_s + offset_s)
        if options.odometry == FROM_TRUTH and known is not None:
            known = known.moved(offset_s)
            truth = known.trajectory
    if options.truth_offset_s == "auto" and (told_s := _truth_offset_s(options, motion, known)) and known is not None:
        known = known.moved(told_s)
        truth = known.trajectory
    require_plausible(motion, f"{options.source}: self-motion ({origin})")
    frames = frames_within(drive.frames, motion, options.source)
    samples = steps_of(frames, motion, truth)
    require_overlap(options.truth, known, begin_s(motion), float(motion.t_s[-1]))
    truth_share = float(np.isfinite(samples.poses_m).all(axis=1).mean())
    with new_folder(options.out) as building:
        undistort = undistorter(calibration, own_px) if calibration and own_px else None
        width, height = write_frames(building, frames, options.size_px, undistort)
        write_steps(building, samples)
        write_truth(building, known, begin_s(motion))
        focal_px = drive.focal_px if calibration is None else float(calibration.matrix[0, 0])
        fov_deg = field_of_view_deg(focal_px, own_px[0]) if own_px else None
        content: dict[str, Any] = {
            "scenario": None,
            "imported": {
                "format": kind,
                "source": options.source.name,
                "self_motion": origin,
                "time_origin_s": begin_s(motion),
                **({"truth_ahead": known.ahead_m} if known is not None and known.ahead_m else {}),
                **_intrinsics(calibration, own_px, (width, height)),
            },
            "camera": camera_record(samples, (width, height), fov_deg),
            "truth_share": round(truth_share, 6),
            "truth_frame": "network" if known is not None and known.in_network else options.truth_frame,
            **({} if options.metres_per_unit is None else {UNITS: options.metres_per_unit}),
        }
        seal(building, content, samples)
    truth_words = f"truth for {truth_share:.0%} of the steps"
    if known is not None and not known.has_heading:
        truth_words = f"truth: {len(known.trajectory.t_s)} fixes"
    pictures = f"{len(frames)} frames of {width} x {height}" if frames else "no frames"
    print(f"{options.out}: {kind}, {pictures}, {len(samples.t_s)} steps over {samples.t_s[-1]:.1f} s; "
          f"self-motion: {origin}; {truth_words}")  # fmt: skip
    for note in known.notes if known is not None else ():
        print(f"note: {note}")
    if (lost := len(drive.frames) - len(frames)) > 0:
        print(f"note: {lost} frame(s) outside of the self-motion's time are left out")
    if not frames:
        print("note: without frames no place is recognised: the map closes no loop, and no drive can be localized in it")
    if options.odometry == FROM_TRUTH:
        print("note: the self-motion is the truth's own: scores of this drive say nothing about drift")


def _read(options: ImportOptions, kind: str, axes: Axes) -> ForeignDrive:
    """The drive as its reader hands it over. Raises HippodromeError."""
    if options.topics and kind not in LOGS:
        raise ExchangeError(f"{options.source}: --topic is for {' and '.join(LOGS)}, this is {kind}; leave it out")
    if kind == "images":
        return read_image_folder(options.source, options.fps)
    if kind == "video":
        return read_video(options.source, options.fps)
    if kind == "odometry":
        return read_bare_odometry(options.source, axes, options.fps, options.time_unit, options.camera_ahead)
    name, reader = READERS[kind]
    module = optional_module(f"hippodrome.eval.exchange.readers.{name}")
    function: Any = getattr(module, reader)
    drive: ForeignDrive = function(options.source, axes, options.topics) if kind in LOGS else function(options.source, axes)
    return drive


def _size_of(drive: ForeignDrive) -> tuple[int, int] | None:
    """Width and height of the frames as recorded; None if there is none."""
    if not drive.frames:
        return None
    height, width = decode(drive.frames[0]).shape[:2]
    return width, height


def _calibration(options: ImportOptions, own_px: tuple[int, int] | None) -> Calibration | None:
    """The camera's calibration for frames of this size; None if there is no file of it or there are no frames."""
    if options.calibration is None or own_px is None:
        return None
    return scaled(read_calibration(options.calibration), own_px, str(options.calibration))


def _intrinsics(
    calibration: Calibration | None, own_px: tuple[int, int] | None, written_px: tuple[int, int]
) -> dict[str, dict[str, Any]]:
    """What the manifest keeps of a calibration, in pixels of the frames as written."""
    if calibration is None or own_px is None:
        return {}
    across, down = written_px[0] / own_px[0], written_px[1] / own_px[1]
    matrix = calibration.matrix
    return {
        "calibration": {
            "focal_px": [round(float(matrix[0, 0] * across), 6), round(float(matrix[1, 1] * down), 6)],
            "principal_px": [round(float(matrix[0, 2] * across), 6), round(float(matrix[1, 2] * down), 6)],
            "undistorted": calibration.distorted,
        }
    }


def _known_truth(options: ImportOptions, drive: ForeignDrive, axes: Axes, pose_t_s: FloatArray) -> Truth | None:
    """The truth that the options name, or the layout's own, of the rear axle; None where there is none.

    KITTI's poses have the frames' times.
    """
    if options.truth is None:
        known = truth_of_trajectory(drive.truth) if drive.truth is not None else None
    elif options.truth.suffix.lower() == ".txt" and is_kitti_poses(options.truth):
        known = truth_of_trajectory(read_poses(options.truth, axes, pose_t_s, None))
    else:
        known = read_truth(options.truth, axes, options.network, options.truth_sigma_m)
    said = options.camera_ahead if options.truth_ahead is None else options.truth_ahead
    if known is None:
        return None
    offset_s = 0.0 if options.truth_offset_s == "auto" else options.truth_offset_s
    return known.at_axle(said, "the truth").moved(offset_s)


def _truth_offset_s(options: ImportOptions, motion: Motion, known: Truth | None) -> float:
    """Seconds to add to the times of the truth, told by turns and printed. Raises ExchangeError where they do not tell."""
    if known is None or options.odometry == FROM_TRUTH:
        raise ExchangeError(
            f"{options.source}: --truth-offset auto needs a truth and a self-motion that is not the truth's; leave it out"
        )
    if len(known.trajectory.t_s) < 3:
        raise ExchangeError(f"{options.source}: a truth of less than three places tells no offset; give --truth-offset SECONDS")
    truth = turns_of_trajectory(known.trajectory, "the truth")
    if not known.has_heading:  # of a fix it is the direction to the next one, and so that of the time halfway there
        truth = Turns((truth.t_s[:-1] + truth.t_s[1:]) / 2.0, truth.angle[:-1], truth.name)
    return told_offset(truth, turns_of_motion(motion), "--truth-offset")


def _motion(
    options: ImportOptions, drive: ForeignDrive, truth: Trajectory | None, calibration: Calibration | None
) -> tuple[Motion, str]:
    """The self-motion, and words that say where it comes from. Raises ExchangeError if there is none."""
    given = options.odometry
    if given is None:
        if drive.motion is None:
            raise ExchangeError(
                f"{options.source}: no self-motion in it; give --odometry FILE.csv (t_s,speed,yaw_rate), FILE.tum (poses), "
                "'truth' to differentiate the truth, or 'visual' to estimate it from the frames"
            )
        return drive.motion, options.source.name if options.kind == "odometry" else "as in the layout"
    if given == FROM_TRUTH:
        if truth is None:
            raise ExchangeError(
                f"{options.source}: no truth to differentiate; give --odometry FILE.csv or FILE.tum, or --truth FILE"
            )
        return motion_of(truth, f"{options.source}: truth"), "the truth differentiated"
    if given == VISUAL:
        return _seen_motion(options, drive, calibration)
    pose_t_s = drive.pose_t_s if drive.pose_t_s is not None else np.array([frame.t_s for frame in drive.frames])
    return read_self_motion(Path(given), options.axes or "body", pose_t_s, options.time_unit, options.camera_ahead)


def _offset_s(
    options: ImportOptions, drive: ForeignDrive, motion: Motion, known: Truth | None, calibration: Calibration | None
) -> float:
    """Seconds to add to the times of the self-motion: as said, or told by the turns of truth or frames, and then printed.

    Raises ExchangeError where they do not tell.
    """
    if options.time_offset_s != "auto":
        return options.time_offset_s
    if options.odometry in (FROM_TRUTH, VISUAL):
        raise ExchangeError(f"{options.source}: --time-offset auto needs self-motion with a clock of its own; leave it out")
    if known is not None and known.has_heading and len(known.trajectory.t_s) > 2:
        return told_offset(turns_of_motion(motion), turns_of_trajectory(known.trajectory, "the truth"))
    own_px = _size_of(drive)
    if own_px is None or len(drive.frames) < 3:
        raise ExchangeError(f"{options.source}: neither frames nor true headings to tell the time offset by; give it in seconds")
    undistort = undistorter(calibration, own_px) if calibration else (lambda frame: frame)
    return told_offset(turns_of_motion(motion), turns_of_frames(drive.frames, undistort))


def _seen_motion(options: ImportOptions, drive: ForeignDrive, calibration: Calibration | None) -> tuple[Motion, str]:
    """Self-motion by visual odometry, with a note of what it takes for granted. Raises ExchangeError without a focal length."""
    own_px = _size_of(drive)
    if own_px is None:
        raise ExchangeError(f"{options.source}: no frames to estimate self-motion from; give --odometry FILE.csv or FILE.tum")
    known_px = drive.focal_px if drive.focal_px or calibration else seen_focal_px(drive.frames)
    matrix = pinhole(known_px, calibration, own_px)
    fov_deg = None if matrix is None else field_of_view_deg(float(matrix[0, 0]), own_px[0])
    if matrix is None or fov_deg is None:
        raise ExchangeError(
            f"{options.source}: --odometry visual needs the camera's focal length, which too few turns of the drive show; "
            "give --calibration FILE"
        )
    if calibration is None and not drive.focal_px:
        print(f"warning: focal length {matrix[0, 0]:.0f} pixels (field of view {fov_deg:.0f} degrees) by what the frames show in "
              "turns, within some 10 %: turns and speeds are as wrong as that; give --calibration FILE if you can")  # fmt: skip
    undistort = undistorter(calibration, own_px) if calibration else (lambda frame: frame)
    seen = visual_motion(drive.frames, RoadCamera(matrix, options.camera_height_m), own_px, undistort)
    print(f"warning: self-motion from the frames alone supposes a camera {options.camera_height_m:g} m above a flat road: "
          "speeds are as wrong as that height (--camera-height); wheels and a gyroscope are better if there are any")  # fmt: skip
    for note in seen.notes:
        print(f"note: {note}")
    return seen.motion, "visual odometry of the frames"
