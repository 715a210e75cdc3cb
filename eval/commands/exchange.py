"""``hippodrome export``, ``import`` and ``score``: to and from other people's tools and drives."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, Literal

from hippodrome.eval.commands.arguments import DONE

EXPORTS = ("tum", "kitti", "euroc", "mcap", "rerun", "evo", "rosbag2")
IMPORTS = ("tum", "kitti", "euroc", "mcap", "rosbag")


def add_exchange_commands(commands: Any) -> None:
    """Adds them to the parser's ``commands``."""
    out = commands.add_parser("export", help="results in the formats of other tools", description=_export.__doc__)
    out.add_argument("source", type=Path, metavar="FOLDER", help="a run, a scenario's results, or a recording")
    out.add_argument("--to", required=True, choices=EXPORTS)
    out.add_argument("--network", type=Path, metavar="NET.net.xml[.gz]", help="roads, where they do not lie beside the results")
    out.add_argument("--out", type=Path, required=True, metavar="DIR", help="a new folder")
    out.set_defaults(command=_export)

    into = commands.add_parser("import", help="a foreign drive as a recording", description=_import.__doc__)
    into.add_argument("source", type=Path, metavar="SOURCE", help="the sequence's folder, an .mcap file, or a ROS bag")
    into.add_argument("--from", required=True, choices=IMPORTS, dest="kind")
    into.add_argument("--odometry", metavar="FILE", help="self-motion: .csv of t_s,speed,yaw_rate; .tum of poses; or 'truth'")
    into.add_argument("--truth", type=Path, metavar="FILE.tum", help="poses to score with, instead of the layout's own")
    into.add_argument("--axes", choices=["body", "camera"], help="what poses point along: body x forward, camera z forward")
    into.add_argument("--truth-frame", choices=["network", "own"], default="own",
                      help="network: the truth is in the road network's metric frame (default: own)")  # fmt: skip
    into.add_argument("--size", type=_size, metavar="WxH", help="scale the frames down (default: as they are)")
    into.add_argument("--out", type=Path, required=True, metavar="RECORDING", help="a new folder")
    into.set_defaults(command=_import)

    score = commands.add_parser("score", help="a map or trajectory against a recording's truth", description=_score.__doc__)
    score.add_argument("estimate", type=Path, metavar="MAP.pbstream|TRAJECTORY.tum")
    score.add_argument("recording", type=Path, metavar="RECORDING")
    score.add_argument("--own-frame", action="store_true", help="a .tum in a frame and scale of its own, to be aligned")
    score.set_defaults(command=_score)


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
    """Write trajectories, frames, maps and roads as a new folder; its about.json says frames, units and precision."""
    from hippodrome.eval.exchange.export import export

    export(options.source, options.to, options.network, options.out)
    return DONE


def _import(options: argparse.Namespace) -> int:
    """Make a recording of a drive that somebody else recorded: frames, self-motion and, where known, truth."""
    from hippodrome.eval.exchange.importing import ImportOptions, import_drive

    axes: Literal["body", "camera"] = options.axes or ("camera" if options.kind == "kitti" else "body")
    import_drive(
        ImportOptions(options.source, options.kind, options.out, options.odometry, options.truth, axes, options.truth_frame,
                      options.size)
    )  # fmt: skip
    return DONE


def _score(options: argparse.Namespace) -> int:
    """Print APE and RPE with their definitions; the truth may be an imported one."""
    from hippodrome.eval.exchange.score import score_files

    score_files(options.estimate, options.recording, not options.own_frame)
    return DONE
