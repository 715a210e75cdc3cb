"""``hippodrome map``, ``refine`` and ``localize``: the stages alone, on files."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import DONE, refine_mode, start_pose


def add_stage_commands(commands: Any) -> None:
    """Adds them to the parser's ``commands``."""
    build = commands.add_parser("map", help="build the semi-metric map of a recording", description=_map.__doc__)
    build.add_argument("recording", type=Path, metavar="RECORDING", help="folder of a recording")
    _settings(build, "mapper")
    build.add_argument("--out", type=Path, required=True, metavar="MAP.pbstream")
    build.set_defaults(command=_map)

    refine = commands.add_parser("refine", help="turn a semi-metric map topometric", description=_refine.__doc__)
    refine.add_argument("map", type=Path, metavar="MAP.pbstream")
    refine.add_argument("--network", type=Path, required=True, metavar="NET.net.xml[.gz]")
    refine.add_argument(
        "--mode", type=refine_mode, choices=["route", "paper"], default="route", help="route: unknown start; paper: Eqs. (8)-(12)"
    )
    refine.add_argument(
        "--start", type=start_pose, metavar="X,Y,HEADING", help="known start: metres, degrees (mode paper needs it)"
    )
    _settings(refine, "refinement")
    refine.add_argument("--out", type=Path, required=True, metavar="MAP.pbstream")
    refine.set_defaults(command=_refine)

    localize = commands.add_parser(
        "localize", help="localize a recorded drive in a topometric map", description=_localize.__doc__
    )
    localize.add_argument("map", type=Path, metavar="MAP.pbstream")
    localize.add_argument("recording", type=Path, metavar="RECORDING", help="folder of a recording")
    localize.add_argument("--network", type=Path, metavar="NET.net.xml[.gz]", help="lanes to pull the estimate to")
    _settings(localize, "localizer")
    localize.add_argument("--out", type=Path, required=True, metavar="TRAJECTORY.tum")
    localize.set_defaults(command=_localize)


def _settings(parser: argparse.ArgumentParser, part: str) -> None:
    parser.add_argument("--scenario", type=Path, metavar="SCENARIO.yaml", help=f"take the {part}'s settings from this scenario")


def _map(options: argparse.Namespace) -> int:
    """Build the semi-metric cognitive map of a recording from its frames and self-motion."""
    from hippodrome.eval.methods.stages import map_files

    map_files(options.recording, options.scenario, options.out)
    return DONE


def _refine(options: argparse.Namespace) -> int:
    """Constrain a semi-metric map with a road network (RC-HMM)."""
    from hippodrome.eval.methods.stages import refine_files

    refine_files(options.map, options.network, options.mode, options.start, options.scenario, options.out)
    return DONE


def _localize(options: argparse.Namespace) -> int:
    """Localize a recorded drive in a topometric map from an unknown start; writes a TUM trajectory of the localized stretches."""
    from hippodrome.eval.methods.stages import localize_files

    localize_files(options.map, options.recording, options.network, options.scenario, options.out)
    return DONE
