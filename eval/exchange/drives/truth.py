"""The truth of a drive that somebody else recorded: poses, or fixes in latitude and longitude, kept as they came.

A recording's steps have times of their own; fixes once a second fall between them. So the truth is stored with its own times, and
scored at these where it is the sparser one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from hippodrome.core.types import FloatArray, Trajectory
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.exported import truth_of
from hippodrome.eval.exchange.drives.lever import NO_LEVER, Ahead, at_axle, lever_of
from hippodrome.eval.files.fixes import is_fix_file, read_fixes
from hippodrome.eval.files.spatial import Axes, SpatialPoses, flatten, level, lifted, read_poses
from hippodrome.sim.array_file import read_arrays, write_arrays
from hippodrome.sim.georeference import GeoReference, read_georeference
from hippodrome.sim.recording import Recording, RecordingError
from hippodrome.sim.recording_checks import check_truth

TRUTH_FILE: Final = "truth.npz"
STANDING_M: Final = 0.5  # fixes nearer than this to one another say nothing of a direction


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """True poses with times of their own."""

    trajectory: Trajectory
    height_m: FloatArray  # (N,) 0 where it is unknown
    sigma_m: FloatArray  # (N,) standard deviation of a position along one axis; nan where it is unknown
    has_heading: bool  # False: fixes; the heading is the direction to the next one, too rough to be scored
    in_network: bool  # whether it was projected into a road network's frame
    notes: tuple[str, ...] = ()
    ahead_m: float = 0.0  # how far ahead of the rear axle the point lies that was measured; the trajectory is the axle's

    def in_space(self) -> SpatialPoses:
        """The poses with their heights, z up."""
        flat = lifted(self.trajectory)
        return SpatialPoses(flat.t_s, np.column_stack([flat.positions[:, :2], self.height_m]), flat.rotations, "body")

    def moved(self, seconds: float) -> Truth:
        """The same, ``seconds`` later."""
        return replace(self, trajectory=Trajectory(self.trajectory.t_s + seconds, self.trajectory.poses))

    def at_axle(self, said: Ahead, name: str) -> Truth:
        """The truth of the rear axle, from that of a point ahead of it; ``said`` and ``name`` are those of ``lever_of``.

        Fixes, which have no heading, stay where they are.
        """
        lever = lever_of(self.trajectory, said, name) if self.has_heading else NO_LEVER
        notes = (*self.notes, lever.words) if lever.words else self.notes
        return replace(self, trajectory=at_axle(self.trajectory, lever.ahead), notes=notes, ahead_m=lever.ahead)

    def as_measured(self) -> Truth:
        """The truth of the point that was measured."""
        return replace(self, trajectory=at_axle(self.trajectory, -self.ahead_m), ahead_m=0.0)


def read_truth(path: Path, axes: Axes | None, network: Path | None, sigma_m: float | None = None) -> Truth:
    """Read the truth of a drive, in its own clock.

    Args:
        path: TUM poses; or fixes as GPX, CSV with named columns, NMEA, GeoJSON or OXTS.
        axes: What the attitudes of poses turn; None: the vehicle's axes.
        network: The road network into whose frame fixes are projected; None: a plane about their middle.
        sigma_m: The accuracy, where the file does not say it or is not believed.

    Raises:
        HippodromeError: The file is none of these, or the network does not say where on Earth it lies.
    """
    found = _fixes(path, network) if is_fix_file(path) else _poses(path, axes)
    if sigma_m is None:
        return found
    return replace(found, sigma_m=np.full(len(found.sigma_m), sigma_m))


def truth_of_trajectory(trajectory: Trajectory) -> Truth:
    """The truth that a layout came with."""
    count = len(trajectory.t_s)
    return Truth(trajectory, np.zeros(count), np.full(count, np.nan), True, False)


def write_truth(folder: Path, truth: Truth | None, origin_s: float) -> None:
    """Store the truth in the folder of a new recording, whose clock begins at ``origin_s``; nothing where there is none."""
    if truth is None:
        return
    arrays = {
        "t_s": truth.trajectory.t_s - origin_s,
        "poses_m": truth.trajectory.poses,
        "height_m": truth.height_m,
        "sigma_m": truth.sigma_m,
        "has_heading": np.array([truth.has_heading]),
    }
    write_arrays(folder / TRUTH_FILE, arrays)


def require_overlap(path: Path | None, truth: Truth | None, first_s: float, last_s: float) -> None:
    """Raise ExchangeError, naming the file, if a truth that was named has nothing within the drive's time."""
    if path is None or truth is None:
        return
    t_s = truth.trajectory.t_s
    if not ((t_s >= first_s) & (t_s <= last_s)).any():
        raise ExchangeError(
            f"{path}: its times, {t_s[0]:.3f} to {t_s[-1]:.3f} s, lie outside of the drive's, {first_s:.3f} to {last_s:.3f} s: "
            "it says nothing of it; give both the same clock, or --truth-offset SECONDS to add, or --truth-offset auto"
        )


def stored_truth(recording: Recording) -> Truth | None:
    """The truth of a recording in its clock: as it came, where the recording kept it so, else that of its steps. None: none."""
    path = recording.folder / TRUTH_FILE
    if TRUTH_FILE not in recording.manifest.get("sha256", {}):
        steps = truth_of(recording)
        return None if steps is None else replace(truth_of_trajectory(steps), ahead_m=_ahead_m(recording))
    try:
        arrays = read_arrays(path, ["t_s", "poses_m", "height_m", "sigma_m", "has_heading"])
        check_truth(arrays)
    except Exception as error:  # NumPy, zipfile and zlib have many
        said = " ".join(str(error).split())[:200] or type(error).__name__
        raise RecordingError(f"{path}: cannot be read ({said}); import the drive anew") from None
    trajectory = Trajectory(arrays["t_s"], arrays["poses_m"])
    heading, ahead_m = bool(arrays["has_heading"][0]), _ahead_m(recording)
    return Truth(trajectory, arrays["height_m"], arrays["sigma_m"], heading, False, ahead_m=ahead_m)


def _ahead_m(recording: Recording) -> float:
    """How far ahead of the rear axle the point lies whose truth was imported; 0 where nothing is said of it."""
    imported = recording.manifest.get("imported")
    value = imported.get("truth_ahead", 0.0) if isinstance(imported, dict) else 0.0
    return float(value) if isinstance(value, int | float) and np.isfinite(value) else 0.0


def _poses(path: Path, axes: Axes | None) -> Truth:
    poses = read_poses(path, axes)
    height_m = poses.positions @ level(poses)[2]
    return Truth(flatten(poses), height_m, np.full(len(poses.t_s), np.nan), True, False, poses.notes)


def _fixes(path: Path, network: Path | None) -> Truth:
    fixes = read_fixes(path)
    notes = list(fixes.notes)
    if network is None:
        lat, lon = float(np.median(fixes.lat_deg)), float(np.median(fixes.lon_deg))
        reference = GeoReference(f"+proj=tmerc +lat_0={lat!r} +lon_0={lon!r} +ellps=WGS84", (0.0, 0.0), path.name)
        notes.append("fixes are projected on a plane about their middle; --network would lay them into the network's frame")
    else:
        reference = read_georeference(network)
    positions_m = reference.to_network(fixes.lat_deg, fixes.lon_deg)
    count = len(fixes.t_s)
    sigma_m = np.full(count, np.nan) if fixes.sigma_m is None else fixes.sigma_m
    poses = np.column_stack([positions_m, _course_rad(positions_m)])
    named = tuple(f"{path}: {note}" for note in notes)
    return Truth(Trajectory(fixes.t_s, poses), np.zeros(count), sigma_m, False, network is not None, named)


def _course_rad(positions_m: FloatArray) -> FloatArray:
    """Direction (N,) from each position (N, 2) to the next one that is far enough away; at the end that of the one before."""
    course, last = np.zeros(len(positions_m)), 0.0
    anchor = 0
    for i in range(1, len(positions_m)):
        step = positions_m[i] - positions_m[anchor]
        if np.hypot(*step) >= STANDING_M:
            last = float(np.arctan2(step[1], step[0]))
            course[anchor:i] = last
            anchor = i
    course[anchor:] = last
    return course
