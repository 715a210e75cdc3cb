"""``hippodrome export``, ``import`` and ``score``: to and from other people's tools and drives."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import DONE, add_command

EXPORTS = ("tum", "kitti", "euroc", "mcap", "rerun", "evo", "rosbag2")
IMPORTS = ("images", "video", "odometry", "kitti", "kitti-raw", "tum", "euroc", "donkeycar", "mcap", "rosbag")
TIME_UNITS = ("s", "ms", "us", "ns")


def add_exchange_commands(commands: Any) -> None:
    """Adds them to the parser's ``commands``."""
    out = add_command(
        commands, "export", _export, "write results in the formats of other tools",
        """Write the drives of a run, with truth, trajectories, frames, self-motion, maps and roads, in another tool's format.

        Writes a new folder; its about.json says which frames of reference, units and precision hold in it. MCAP, Rerun, evo and
        ROS 2 bags need packages: pip install 'hippodrome[exchange]'.""",
        ["hippodrome export out/eval --to mcap --out out/for-foxglove",
         "hippodrome export out/grid/recordings/grid-mapping-* --to tum --out out/grid-tum"],
    )  # fmt: skip
    out.add_argument(
        "source", type=Path, metavar="FOLDER", help="the results of a whole run, the folder of one scenario in it, or a recording"
    )
    out.add_argument(
        "--to", required=True, choices=EXPORTS,
        help="the format. tum, kitti, euroc: the layouts of these datasets; mcap: for Foxglove; rerun: for the Rerun viewer; "
             "evo: results for evo_res; rosbag2: for ros2 bag",
    )  # fmt: skip
    out.add_argument(
        "--network", type=Path, metavar="NET.net.xml[.gz]",
        help="the road network that was driven (default: looked for in the folder `towns` beside the results)",
    )  # fmt: skip
    out.add_argument("--out", type=Path, required=True, metavar="DIR", help="a new folder; one that exists is not touched")

    into = add_command(
        commands, "import", _import, "make a recording of a drive that somebody else recorded",
        """Make a recording of a drive that somebody else recorded: frames, self-motion and, where it is known, truth.

        `hippodrome map`, `refine`, `localize`, `score` and `export` take the recording like one of ours. Frames and self-motion
        need the same clock, or an offset between their clocks; speed may be in any unit of length. MCAP files and ROS bags need
        packages: pip install 'hippodrome[exchange]'. docs/exchange.md says what each layout must hold.""",
        ["hippodrome import dashcam.mp4 --odometry phone.csv --out recordings/home",
         "hippodrome import photos --fps 5 --odometry wheels.csv --time-offset -2.5 --out recordings/photos",
         "hippodrome import kitti/sequences/07 --odometry kitti/poses/07.txt --size 414x125 --out recordings/kitti-07",
         "hippodrome import drive.tum --from odometry --out recordings/no-camera"],
    )  # fmt: skip
    into.add_argument(
        "source", type=Path, metavar="SOURCE",
        help="a video, a folder of images, a sequence's folder, a tub, an .mcap file, a ROS bag, or a file of self-motion",
    )  # fmt: skip
    into.add_argument(
        "--from", choices=IMPORTS, dest="kind",
        help="the layout of the source (default: recognised by what lies in it)",
    )  # fmt: skip
    into.add_argument(
        "--fps", type=_rate, metavar="N",
        help="frames a second, for a folder of images, a video without time stamps, or poses without times (default: the "
             "source's own times)",
    )  # fmt: skip
    into.add_argument(
        "--odometry", metavar="FILE",
        help="the self-motion: a .csv with columns for time, speed and yaw rate (any unit of length a second; radians a second), "
             "a file of poses (TUM's or KITTI's), the word 'truth' to differentiate the true poses, or the word 'visual' to "
             "estimate it from the frames, roughly (default: what the layout has)",
    )  # fmt: skip
    into.add_argument(
        "--time-unit",
        choices=TIME_UNITS,
        help="unit of the times in the file of self-motion (default: its header's, or recognised by size and interval)",
    )
    into.add_argument(
        "--time-offset", type=float, default=0.0, metavar="S", dest="time_offset_s",
        help="seconds to add to the times of the self-motion, to lay its clock on that of the frames (default: 0)",
    )  # fmt: skip
    into.add_argument(
        "--calibration", type=Path, metavar="FILE",
        help="the camera's calibration: KITTI's calib.txt, nine numbers of a matrix, OpenCV's or ROS's YAML; frames are freed of "
             "the distortion that it describes (default: the layout's focal length, if any)",
    )  # fmt: skip
    into.add_argument(
        "--camera-height", type=_rate, default=1.5, metavar="M", dest="camera_height_m",
        help="height of the camera above the road in metres, for --odometry visual (default: 1.5)",
    )  # fmt: skip
    into.add_argument(
        "--truth",
        type=Path,
        metavar="FILE",
        help="true poses to score with, TUM's or KITTI's (default: the layout's own, if any)",
    )
    into.add_argument(
        "--axes", choices=["body", "camera"],
        help="which way poses point: body: x forward, z up; camera: z forward, y down (default: body; for kitti, camera)",
    )  # fmt: skip
    into.add_argument(
        "--truth-frame", choices=["network", "own"], default="own",
        help="network: the truth is in the road network's frame, so that a topometric map is scored as it lies; own: it is "
             "aligned first (default: own)",
    )  # fmt: skip
    into.add_argument("--size", type=_size, metavar="WxH", help="scale frames to this size in pixels (default: as they are)")
    into.add_argument("--out", type=Path, required=True, metavar="RECORDING", help="a new folder; one that exists is not touched")

    score = add_command(
        commands, "score", _score, "score a map or a trajectory against a recording's truth",
        """Print the absolute and relative errors (APE, RPE; metres) of a map or a trajectory, each with its definition.

        The recording may be one of ours or an imported one that came with its truth.""",
        ["hippodrome score out/grid/topo.pbstream out/grid/recordings/grid-mapping-*",
         "hippodrome score visual-odometry.tum recordings/kitti-07 --own-frame"],
    )  # fmt: skip
    score.add_argument(
        "estimate", type=Path, metavar="MAP.pbstream|TRAJECTORY.tum", help="what is scored: a map or a TUM trajectory"
    )
    score.add_argument("recording", type=Path, metavar="RECORDING", help="the recording whose truth it is held against")
    score.add_argument(
        "--own-frame", action="store_true",
        help="the trajectory has a frame and a scale of its own: align it in several ways and print the errors of each",
    )  # fmt: skip


def _rate(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.01 <= value <= 10_000.0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number from 0.01 to 10000")
    return value


def _size(text: str) -> tuple[int, int]:
    width, x, height = text.partition("x")
    try:
        size = int(width), int(height)
    except ValueError:
        size = (0, 0)
    if not x or not all(16 <= side <= 8192 for side in size):
        raise argparse.ArgumentTypeError(f"'{text}' is not WxH in pixels, 16 to 8192 each")
    return size


def _export(options: argparse.Namespace) -> int:
    from hippodrome.eval.exchange.export import export

    export(options.source, options.to, options.network, options.out)
    return DONE


def _import(options: argparse.Namespace) -> int:
    from hippodrome.eval.exchange.importing import ImportOptions, import_drive

    import_drive(
        ImportOptions(options.source, options.kind, options.out, options.odometry, options.truth, options.axes,
                      options.truth_frame, options.size, options.fps, options.time_unit, options.time_offset_s,
                      options.calibration, options.camera_height_m)
    )  # fmt: skip
    return DONE


def _score(options: argparse.Namespace) -> int:
    from hippodrome.eval.exchange.score import score_files

    score_files(options.estimate, options.recording, not options.own_frame)
    return DONE
