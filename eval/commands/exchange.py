"""``hippodrome export``, ``import`` and ``score``: to and from other people's tools and drives."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, Literal

from hippodrome.eval.commands.arguments import DONE, add_command

EXPORTS = ("tum", "kitti", "euroc", "mcap", "rerun", "evo", "rosbag2")
IMPORTS = ("tum", "kitti", "euroc", "mcap", "rosbag")


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
        commands, "import", import_command, "make a recording of a drive that somebody else recorded",
        """Make a recording of a drive that somebody else recorded: frames, self-motion and, where it is known, truth.

        `hippodrome map`, `refine`, `localize`, `score` and `export` take the recording like one of ours. Frames and self-motion
        need the same clock; speed may be in any unit of length. MCAP files and ROS bags need packages: pip install
        'hippodrome[exchange]'. docs/exchange.md says what each layout must hold.""",
        ["hippodrome import rgbd_dataset --from tum --odometry odometry.csv --out recordings/office",
         "hippodrome import kitti/sequences/07 --from kitti --odometry truth --size 160x48 --out recordings/kitti-07"],
    )  # fmt: skip
    into.add_argument("source", type=Path, metavar="SOURCE", help="the sequence's folder, an .mcap file, or a ROS 1 or ROS 2 bag")
    add_drive_options(into)
    into.add_argument("--out", type=Path, required=True, metavar="RECORDING", help="a new folder; one that exists is not touched")
    _add_score(commands)


def add_drive_options(into: argparse.ArgumentParser) -> None:
    """How a drive that was recorded elsewhere is taken in: of `import`, and of what imports by itself."""
    into.add_argument("--from", required=True, choices=IMPORTS, dest="kind", help="the layout of the source")
    into.add_argument(
        "--odometry", metavar="FILE",
        help="the self-motion: a .csv of t_s,speed,yaw_rate (seconds, any unit of length a second, radians a second), a .tum of "
             "poses, or the word 'truth' to differentiate the true poses (default: what the layout has)",
    )  # fmt: skip
    into.add_argument(
        "--truth", type=Path, metavar="FILE.tum", help="true poses to score with (default: the layout's own, if any)"
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


def _add_score(commands: Any) -> None:
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

    axes: Literal["body", "camera"] = options.axes or ("camera" if options.kind == "kitti" else "body")
    import_drive(
        ImportOptions(options.source, options.kind, options.out, options.odometry, options.truth, axes, options.truth_frame,
                      options.size)
    )  # fmt: skip
    return DONE


def _score(options: argparse.Namespace) -> int:
    from hippodrome.eval.exchange.score import score_files

    score_files(options.estimate, options.recording, not options.own_frame)
    return DONE
