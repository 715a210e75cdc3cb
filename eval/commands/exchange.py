"""``hippodrome export``, ``import`` and ``score``: to and from other people's tools and drives."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import DONE, THRESHOLD_FAILED, add_command, add_units

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
    _add_score(commands)


def add_drive_options(into: argparse.ArgumentParser) -> None:
    """How a drive that was recorded elsewhere is taken in: of `import`, and of what imports by itself."""
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
             "estimate it from the frames of a camera that looks ahead (default: what the layout has)",
    )  # fmt: skip
    into.add_argument(
        "--time-unit",
        choices=TIME_UNITS,
        help="unit of the times in the file of self-motion (default: its header's, or recognised by size and interval)",
    )
    into.add_argument(
        "--time-offset", type=_offset, default=0.0, metavar="S", dest="time_offset_s",
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
        "--camera-height", type=_rate, default=1.5, metavar="M", dest="camera_height_m",
        help="metres of the camera above the road, for --odometry visual: its speeds are as wrong as this (default: 1.5)",
    )  # fmt: skip
    into.add_argument(
        "--camera-ahead", type=_ahead, default="auto", metavar="N",
        help="how far ahead of the rear axle the camera sits whose poses are differentiated or are the truth, in the unit of the "
             "poses; they are moved to the axle. auto estimates it from how they slip sideways in turns, and takes 0 where that "
             "does not tell (default: auto)",
    )  # fmt: skip
    into.add_argument(
        "--truth-ahead", type=_ahead, metavar="N",
        help="the same for the poses of the truth, where it is another point's (default: as --camera-ahead)",
    )  # fmt: skip
    _add_truth(into, "the layout's own, if any")
    into.add_argument(
        "--truth-offset", type=_offset, default=0.0, metavar="S", dest="truth_offset_s",
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
    into.add_argument("--size", type=_size, metavar="WxH", help="scale frames to this size in pixels (default: as they are)")


def _add_score(commands: Any) -> None:
    score = add_command(
        commands, "score", _score, "score a map or a trajectory against a recording's truth",
        """Print the absolute and relative errors (APE, RPE; metres) of a map or a trajectory, each with its definition.

        The recording may be one of ours or an imported one that came with its truth; or the truth is a file of its own, poses or
        fixes in latitude and longitude. Truth that comes more seldom than four times a second is scored at its own times. Poses
        in space are turned level before height, roll and pitch are dropped. Exit status 1: a limit was missed.""",
        ["hippodrome score out/grid/topo.pbstream out/grid/recordings/grid-mapping-*",
         "hippodrome score visual-odometry.tum recordings/kitti-07 --own-frame",
         "hippodrome score localized.tum out/grid/recordings/grid-localization-* --localization",
         "hippodrome score topo.pbstream recordings/monday --truth phone.gpx --network town.net.xml --max-ape 5"],
    )  # fmt: skip
    score.add_argument(
        "estimate", type=Path, metavar="MAP.pbstream|TRAJECTORY.tum",
        help="what is scored: a map, a TUM trajectory, or KITTI's 12 columns with --times",
    )  # fmt: skip
    score.add_argument("recording", type=Path, metavar="RECORDING", help="the recording whose truth it is held against")
    score.add_argument(
        "--own-frame", action="store_true",
        help="the trajectory has a frame and a scale of its own: align it in several ways and print the errors of each",
    )  # fmt: skip
    score.add_argument(
        "--localization", action="store_true",
        help="the trajectory is a localizer's of a second drive, in the road network's frame: print whether and when it was "
             "localized, its error from then on, and its false fixes; a ninth column, 1 or 0, says which poses it stands by "
             "(default: a mapper's trajectory; without the column: it stands by all)",
    )  # fmt: skip
    score.add_argument(
        "--axes", choices=["body", "camera"],
        help="which way poses point: body: x forward, z up; camera: z forward, y down (default: body; for 12 columns, camera)",
    )  # fmt: skip
    score.add_argument(
        "--times", type=Path, metavar="FILE", help="seconds, a line for each of KITTI's poses (default: none; KITTI's need it)"
    )
    score.add_argument(
        "--clock", choices=["auto", "source", "recording"], default="auto",
        help="the clock of the trajectory: source: that of the drive as it was imported; recording: 0 at the recording's start; "
             "auto: recording for files that hippodrome wrote, source for others (default: auto)",
    )  # fmt: skip
    score.add_argument(
        "--camera-ahead", type=_metres_ahead, metavar="M",
        help="how far ahead of the rear axle the camera sits whose trajectory this is; it is then held against the axle's truth "
             "(default: it is that of the point whose truth was measured)",
    )  # fmt: skip
    score.add_argument(
        "--truth-ahead", type=_ahead, default="auto", metavar="M",
        help="how far ahead of the rear axle the point lies whose poses --truth has; auto estimates it from how they slip "
             "sideways in turns (default: auto)",
    )  # fmt: skip
    _add_truth(score, "the recording's own")
    score.add_argument(
        "--time-offset", type=float, default=0.0, metavar="S", help="seconds to add to the times of --truth (default: 0)"
    )
    score.add_argument(
        "--max-gap", type=_above_zero, metavar="S",
        help="do not interpolate between samples farther apart than this, in seconds (default: 0.25; at sparse truth 1, or "
             "twice the estimate's usual interval)",
    )  # fmt: skip
    score.add_argument("--json", type=Path, metavar="FILE", help="also write the figures into this file (default: none)")
    score.add_argument(
        "--max-ape",
        type=_above_zero,
        metavar="M",
        help="exit status 1 if the mean of the first APE is larger (default: no limit)",
    )
    score.add_argument(
        "--max-rpe", type=_above_zero, metavar="M", help="exit status 1 if the mean RPE over 20 m is larger (default: no limit)"
    )


def _add_truth(parser: argparse.ArgumentParser, default: str) -> None:
    """The truth as a file, its projection and its accuracy."""
    parser.add_argument(
        "--truth", type=Path, metavar="FILE",
        help="true poses (.tum), or fixes: GPX, CSV with the columns t_s, lat, lon, NMEA, GeoJSON, the folder of OXTS data "
             f"(default: {default})",
    )  # fmt: skip
    parser.add_argument(
        "--network", type=Path, metavar="NET.net.xml[.gz]",
        help="the road network into whose frame fixes are projected, so that a topometric map is scored as it lies (default: a "
             "plane of their own)",
    )  # fmt: skip
    parser.add_argument(
        "--truth-sigma", type=_above_zero, metavar="M",
        help="accuracy of the truth: standard deviation along one axis, metres (default: as the file says)",
    )  # fmt: skip


def _above_zero(text: str) -> float:
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not a number above 0")
    return value


def _offset(text: str) -> float | str:
    if text == "auto":
        return text
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) <= 1e11:
        raise argparse.ArgumentTypeError(f"'{text}' is neither auto nor a number of seconds")
    return value


def _ahead(text: str) -> float | str:
    return text if text == "auto" else _metres_ahead(text, "auto or ")


def _metres_ahead(text: str, or_else: str = "") -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) <= 1e4:
        raise argparse.ArgumentTypeError(f"'{text}' is not {or_else}a number from -10000 to 10000")
    return value


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


def _score(options: argparse.Namespace) -> int:
    from hippodrome.eval.exchange.score import ScoreOptions, score_files

    held = score_files(
        ScoreOptions(
            options.estimate, options.recording, not options.own_frame, options.axes, options.times, options.clock, options.truth,
            options.network, options.truth_sigma, options.time_offset, options.max_gap, options.json, options.max_ape,
            options.max_rpe, options.camera_ahead, options.truth_ahead, options.localization,
        )
    )  # fmt: skip
    return DONE if held else THRESHOLD_FAILED
