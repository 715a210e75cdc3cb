"""Which layout a source has: told by what lies in it, and by nothing else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.readers.pictures import VIDEOS, image_files

TABLES: Final = (".csv", ".tum", ".txt")


@dataclass(frozen=True, slots=True)
class Layout:
    """A layout that can be imported."""

    name: str  # the value of --from
    holds: str  # what it must hold, in words
    fits: Callable[[Path], bool]  # whether a source that exists has it


def _has(*names: str) -> Callable[[Path], bool]:
    return lambda source: all((source / name).exists() for name in names)


def _any_camera(source: Path) -> bool:
    return any((source / f"image_0{number}" / "data").is_dir() for number in range(4))


# In the order in which they are tried: those that say more of themselves come first.
LAYOUTS: Final = (
    Layout("tum", "a folder with rgb.txt", _has("rgb.txt")),
    Layout("euroc", "a folder with mav0/cam0/data.csv", lambda source: (source / "mav0").is_dir()),
    Layout("kitti", "a folder sequences/NN with times.txt and image_0 or image_2",
           lambda source: (source / "times.txt").exists() and any((source / f"image_{n}").is_dir() for n in range(4))),
    Layout("kitti-raw", "a folder DATE_drive_NNNN_sync with image_00/data (to image_03), timestamps.txt beside it, and oxts",
           _any_camera),
    Layout("donkeycar", "a tub with manifest.json, its catalog files and images, or with record_N.json files",
           lambda source: source.is_dir() and (((source / "manifest.json").exists() and any(source.glob("*.catalog")))
                                               or any(source.glob("record_*.json")))),
    Layout("mcap", "an .mcap file of Foxglove's messages", lambda source: source.is_file() and source.suffix == ".mcap"),
    Layout("rosbag", "a .bag file, or the folder of a ROS 2 bag with metadata.yaml",
           lambda source: source.suffix == ".bag" or (source / "metadata.yaml").exists()),
    Layout("video", "a video file (.mp4, .mov, .avi, .mkv)",
           lambda source: source.is_file() and source.suffix.lower() in VIDEOS),
    Layout("odometry", "a .csv of t_s,speed,yaw_rate, a .tum of poses, or KITTI's poses .txt, without any frame",
           lambda source: source.is_file() and source.suffix.lower() in TABLES),
    Layout("images", "a folder of .jpg or .png files, with --fps N",
           lambda source: source.is_dir() and bool(image_files(source))),
)  # fmt: skip


def recognised(source: Path) -> str:
    """The name of the layout that ``source`` has. Raises ExchangeError, which lists the layouts, if it is none of them."""
    if not source.exists():
        raise ExchangeError(f"{source}: no such file or folder; check the path")
    found = next((layout.name for layout in LAYOUTS if layout.fits(source)), None)
    if found is None:
        raise ExchangeError(f"{source}: no layout is recognised; there are: {described()}; --from says which one is meant")
    return found


def described() -> str:
    """All layouts and what each must hold, in one line."""
    return "; ".join(f"{layout.name}: {layout.holds}" for layout in LAYOUTS)
