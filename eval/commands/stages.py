"""``hippodrome map``, ``refine`` and ``localize``: the stages of the chain alone, on files."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import DONE, add_beforehand, add_command, refine_mode, start_pose


def add_stage_commands(commands: Any) -> None:
    """Adds them to the parser's ``commands``."""
    build = add_command(
        commands, "map", _map, "build the semi-metric map of a recording",
        """Build the cognitive map of a recorded drive from its frames and its self-motion.

        The map is semi-metric: right in its connections, in map units whose length in metres is unknown. Writes MAP.pbstream and
        prints its size and the CPU time as a share of the drive's duration. `hippodrome refine` makes it metric.""",
        ["hippodrome map out/grid/recordings/grid-mapping-* --out out/grid/semi.pbstream"],
    )  # fmt: skip
    build.add_argument(
        "recording", type=Path, metavar="RECORDING", help="a recording's folder, made by `hippodrome render` or `import`"
    )
    _add_settings(build, "mapper")
    build.add_argument("--out", type=Path, required=True, metavar="MAP.pbstream", help="file for the semi-metric map")

    refine = add_command(
        commands, "refine", _refine, "lay a semi-metric map on the roads of a network",
        """Refine a semi-metric map with a road network, which makes it topometric: metric, in the network's frame.

        Writes MAP.pbstream and prints the stretches that could not be matched to roads, each with its cause, and what was
        estimated.""",
        ["hippodrome refine out/grid/semi.pbstream --network out/grid/towns/*.net.xml --out out/grid/topo.pbstream",
         "hippodrome refine semi.pbstream --network town.net.xml --mode paper --start 120.5,40,90 --out topo.pbstream"],
    )  # fmt: skip
    refine.add_argument("map", type=Path, metavar="MAP.pbstream", help="the semi-metric map, of `hippodrome map`")
    refine.add_argument(
        "--network", type=Path, required=True, metavar="MAP",
        help="the road network: SUMO (.net.xml), OpenStreetMap (.osm, .pbf) or OpenDRIVE (.xodr), also packed. Others than SUMO "
             "are converted once and kept beside the output",
    )  # fmt: skip
    refine.add_argument(
        "--mode", type=refine_mode, choices=["route", "paper"], default="route",
        help="route: search the route over the whole network, the start may be unknown; paper: the published equations (8)-(12), "
             "from a known start (default: route; 'default', its former name, goes on working)",
    )  # fmt: skip
    refine.add_argument(
        "--start", type=start_pose, metavar="X,Y,HEADING|geo:LAT,LON[,HEADING]",
        help="pose at the start of the drive. X,Y,HEADING: the network's metres, degrees counter-clockwise from east. "
             "geo:LAT,LON[,HEADING]: a GPS fix in WGS84 degrees, heading of a compass, clockwise from north; it may be left out "
             "(default: unknown; --mode paper needs it, with a heading)",
    )  # fmt: skip
    add_beforehand(refine)
    refine.add_argument(
        "--findings", type=Path, metavar="FILE.geojson",
        help="also write where the map seems wrong: roads drawn metres off, missing, or led the wrong way; in latitude and "
             "longitude if the network knows them, else in its metres (default: none; --mode paper finds none)",
    )  # fmt: skip
    _add_settings(refine, "refinement")
    refine.add_argument("--out", type=Path, required=True, metavar="MAP.pbstream", help="file for the topometric map")

    localize = add_command(
        commands, "localize", _localize, "localize a recorded drive in a topometric map",
        """Localize a recorded drive in a topometric map, from an unknown start.

        Writes the poses of the steps at which the localizer declares to know where it is, as a TUM trajectory
        (`t x y z qx qy qz qw`; seconds and metres, in the network's frame), and prints how many they are.""",
        ["hippodrome localize out/grid/topo.pbstream out/grid/recordings/grid-localization-* --out out/grid/drive.tum",
         "hippodrome localize topo.pbstream recordings/monday --network town.net.xml --out monday.tum"],
    )  # fmt: skip
    localize.add_argument("map", type=Path, metavar="MAP.pbstream", help="the topometric map, of `hippodrome refine`")
    localize.add_argument(
        "recording", type=Path, metavar="RECORDING", help="a recording's folder, made by `hippodrome render` or `import`"
    )
    localize.add_argument(
        "--network", type=Path, metavar="MAP",
        help="the road network, as for refine, whose lanes the estimate is drawn to (default: localize by the map alone)",
    )  # fmt: skip
    _add_settings(localize, "localizer")
    localize.add_argument("--out", type=Path, required=True, metavar="TRAJECTORY.tum", help="file for the trajectory")


def _add_settings(parser: argparse.ArgumentParser, part: str) -> None:
    parser.add_argument(
        "--scenario", type=Path, metavar="SCENARIO.yaml",
        help=f"take the {part}'s settings from this scenario (default: those of docs/scenarios.md)",
    )  # fmt: skip


def _map(options: argparse.Namespace) -> int:
    from hippodrome.eval.methods.stages import map_files

    map_files(options.recording, options.scenario, options.out)
    return DONE


def _refine(options: argparse.Namespace) -> int:
    from hippodrome.eval.methods.beforehand import Beforehand
    from hippodrome.eval.methods.stages import refine_files

    known = Beforehand(options.metres_per_unit, options.network_accuracy_m)
    refinement = refine_files(options.map, options.network, options.mode, options.start, options.scenario, options.out, known)
    if options.findings is not None:
        from hippodrome.eval.real.findings_file import tell_findings

        tell_findings(refinement, options.network, options.out.parent, known, options.findings)
    return DONE


def _localize(options: argparse.Namespace) -> int:
    from hippodrome.eval.methods.stages import localize_files

    localize_files(options.map, options.recording, options.network, options.scenario, options.out)
    return DONE
