"""TUM RGB-D layout: ``rgb.txt`` and ``rgb/``, ``groundtruth.txt``; one TUM trajectory for each method."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hippodrome.eval.exchange.drives.camera import pictures
from hippodrome.eval.exchange.drives.exported import ExportedDrive
from hippodrome.eval.exchange.drives.tables import ODOMETRY, write_odometry, write_rows
from hippodrome.eval.files.trajectories import write_tum

CONVENTIONS = (
    "poses are the rear axle's (x forward, y left, z up); t x y z qx qy qz qw, printed to read back exactly",
    "groundtruth.txt and topometric*: metres, road network's frame; other estimates: map units, from their own start",
    "rgb.txt: time and file of each frame; odometry.csv: self-motion as sensed, map units",
)


def write(drives: Sequence[ExportedDrive], folder: Path) -> None:
    """Write one sequence for each drive."""
    for drive in drives:
        here = folder / drive.name
        (here / "rgb").mkdir(parents=True)
        rows = []
        for picture in pictures(drive.recording):
            name = f"rgb/{picture.t_s:.6f}.png"
            (here / name).write_bytes(picture.left)
            rows.append((picture.t_s, name))
        write_rows(here / "rgb.txt", rows, "# t_s filename")
        write_odometry(here / ODOMETRY, drive.recording)
        if drive.truth is not None:
            write_tum(here / "groundtruth.txt", drive.truth)
        for method, estimate in drive.estimates.items():
            write_tum(here / "estimates" / f"{method}.tum", estimate.trajectory)
