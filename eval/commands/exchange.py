"""``hippodrome export`` and ``import``: to and from other people's tools and drives; ``score.py`` adds ``score`` to them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import DONE, add_command, add_units
from hippodrome.eval.commands.foreign import add_truth, ahead, offset, rate, size
from hippodrome.eval.commands.score import add_score_command

EXPORTS = ("tum", "kitti", "euroc", "mcap", "rerun", "evo", "rosbag2", "gpx", "geojson")
IMPORTS = ("images", "video", "odometry", "kitti", "kitti-raw", "tum", "euroc", "donkeycar", "mcap", "rosbag")
TIME_UNITS = ("s", "ms", "us", "ns")


def add_exchange_commands(commands: Any) -> None:
    """Adds them to the parser's ``commands``."""
    out = add_command(
        commands, "export", _export, "write results in the formats of other tools",
        """Write the drives of a run, with truth, trajectories, frames, self-motion, maps and roads, in another tool's format.

        Writes a new folder; its about.json says which frames of reference, units and precision hold in it. MCAP, Rerun, evo and
        ROS 2 bags need packages: pip install 'hippodrome[exchange]'. GPX and GeoJSON need a network that says where on Earth it
        lies, as those made of OpenStreetMap do.""",
        ["hippodrome export out/eval --to mcap --out out/for-foxglove",
         "hippodrome export out/grid/recordings/grid-mapping-* --to tum --out out/grid-tum",
         "hippodrome export topo.pbstream --to geojson --network town.net.xml --out web"],
    )  # fmt: skip
    out.add_argument(
        "source",
        type=Path,
        metavar="FOLDER",
        help="the results of a whole run, the folder of one scenario in it, or a recording; for gpx and geojson also one map "
        "(.pbstream) or trajectory (.tum)",
    )
    out.add_argument(
        "--to", required=True, choices=EXPORTS,
        help="the format. tum, kitti, euroc: the layouts of these datasets; mcap: for Foxglove; rerun: for the Rerun viewer; "
             "evo: results for evo_res; rosbag2: for ros2 bag; gpx, geojson: latitude and longitude, for any web map",
    )  # fmt: skip
    out.add_argument(
        "--network", type=Path, metavar="NET.net.xml[.gz]",
        help="the road network that was driven (default: looked for in the folder `towns` beside the results)",
    )  # fmt: skip
    out.add_argument("--out", type=Path, required=True, metavar="DIR", help="a new folder; one that exists is not touched")

    into = add_command(
        commands, "import", import_command, "make a recording of a drive that somebody else recorded",
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
    add_drive_options(into)
    add_units(into, "unknown; `hippodrome refine` may be told later")
    into.add_argument("--out", type=Path, required=True, metavar="RECORDING", help="a new folder; one that exists is not touched")
    add_score_command(commands)


def add_drive_options(into: argparse.ArgumentParser) -> None:
    """How a drive that was recorded elsewhere is taken in: of `import`, and of what imports by itself."""
    into.add_argument(
        "--from", choices=IMPORTS, dest="kind",
        help="the layout of the source (default: recognised by what lies in it)",
    )  # fmt: skip
    into.add_argument(
        "--fps", type=rate, metavar="N",
        help="frames a second, for a folder of images, a video without time stamps, or poses without times (default: the "
             "source's own times)",
    )  # fmt: skip
    into.add_argument(
        "--odometry", metavar="FILE",
        help="the self-motion: a .csv with columns for time, speed and yaw rate (any unit of length a second; radians a second), "
             "a file of poses (TUM's or KITTI's), the word 'truth' to differentiate the true poses, or the word 'visual' to "
             "estimate it from the frames of a camera that looks ahead (default: what the layout has)",
    )  # fmt: skip
    into.add_argument(
        "--time-unit",
        choices=TIME_UNITS,
        help="unit of the times in the file of self-motion (default: its header's, or recognised by size and interval)",
    )
    into.add_argument(
        "--time-offset", type=offset, default=0.0, metavar="S", dest="time_offset_s",
        help="seconds to add to the times of the self-motion, to lay its clock on that of the frames; auto: told by the turns "
             "that the truth, if it has headings, or else the frames show; refused where that is not sure (default: 0)",
    )  # fmt: skip
    into.add_argument(
        "--topic", action="append", default=[], metavar="NAME", dest="topics",
        help="a topic of an MCAP file or a bag that is used: of the camera, of the odometry, of the true poses (a second "
             "odometry is the truth, too); may be given several times (default: the first of each, the truth by its name; what "
             "is used is printed)",
    )  # fmt: skip
    into.add_argument(
        "--calibration", type=Path, metavar="FILE",
        help="the camera's calibration: KITTI's calib.txt, nine numbers of a matrix, OpenCV's or ROS's YAML; frames are freed of "
             "the distortion that it describes (default: the layout's focal length, if any)",
    )  # fmt: skip
    into.add_argument(
        "--camera-height", type=rate, default=1.5, metavar="M", dest="camera_height_m",
        help="metres of the camera above the road, for --odometry visual: its speeds are as wrong as this (default: 1.5)",
    )  # fmt: skip
    into.add_argument(
        "--camera-ahead", type=ahead, default="auto", metavar="N",
        help="how far ahead of the rear axle the camera sits whose poses are differentiated or are the truth, in the unit of the "
             "poses; they are moved to the axle. auto estimates it from how they slip sideways in turns, and takes 0 where that "
             "does not tell (default: auto)",
    )  # fmt: skip
    into.add_argument(
        "--truth-ahead", type=ahead, metavar="N",
        help="the same for the poses of the truth, where it is another point's (default: as --camera-ahead)",
    )  # fmt: skip
    add_truth(into, "the layout's own, if any")
    into.add_argument(
        "--truth-offset", type=offset, default=0.0, metavar="S", dest="truth_offset_s",
        help="seconds to add to the times of the truth, to lay its clock on the drive's (a video begins at 0, a GPX file has the "
             "date); auto: told by the turns of both; refused where that is not sure (default: 0)",
    )  # fmt: skip
    into.add_argument(
        "--axes", choices=["body", "camera"],
        help="which way poses point: body: x forward, z up; camera: z forward, y down (default: body; for kitti, camera)",
    )  # fmt: skip
    into.add_argument(
        "--truth-frame", choices=["network", "own"], default="own",
        help="network: the truth is in the road network's frame, so that a topometric map is scored as it lies; own: it is "
             "aligned first (default: own)",
    )  # fmt: skip
    into.add_argument("--size", type=size, metavar="WxH", help="scale frames to this size in pixels (default: as they are)")


def _export(options: argparse.Namespace) -> int:
    from hippodrome.eval.exchange.export import export

    export(options.source, options.to, options.network, options.out)
    return DONE


def import_command(options: argparse.Namespace) -> int:
    """``hippodrome import``, with the options of ``add_drive_options``, ``source`` and ``out``."""
    from hippodrome.eval.exchange.importing import ImportOptions, import_drive

    import_drive(
        ImportOptions(
            source=options.source, kind=options.kind, out=options.out, odometry=options.odometry, truth=options.truth,
            network=options.network, truth_sigma_m=options.truth_sigma, axes=options.axes, truth_frame=options.truth_frame,
            size_px=options.size, fps=options.fps, time_unit=options.time_unit, time_offset_s=options.time_offset_s,
            calibration=options.calibration, camera_height_m=options.camera_height_m, camera_ahead=options.camera_ahead,
            truth_ahead=options.truth_ahead, topics=tuple(options.topics), truth_offset_s=options.truth_offset_s,
            metres_per_unit=options.metres_per_unit,
        )
    )  # fmt: skip
    return DONE
