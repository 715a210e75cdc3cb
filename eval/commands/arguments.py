"""Arguments that several commands share, and the exit status of all."""

from __future__ import annotations

import argparse
import math
import os
from pathlib import Path

from hippodrome.core.types import StartPose
from hippodrome.sim.renamed import present_value

DONE, THRESHOLD_FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def add_scenarios(parser: argparse.ArgumentParser, several: bool) -> None:
    """The scenarios, and what may be replaced in them."""
    parser.add_argument("scenarios", type=Path, nargs="+" if several else 1, metavar="SCENARIO.yaml", help="see scenarios/")
    parser.add_argument("--network", type=Path, metavar="NET", help="drive in this SUMO network (.net.xml, .net.xml.gz) instead")
    parser.add_argument("--seed", type=seed, metavar="N", help="replace the scenario's seed")


def add_workers(parser: argparse.ArgumentParser) -> None:
    """How many processes; no result depends on it."""
    parser.add_argument(
        "--workers", type=positive, default=os.cpu_count() or 1, metavar="N", help="processes (default: all cores)"
    )


def add_out(parser: argparse.ArgumentParser, default: str) -> None:
    """The folder of the results."""
    parser.add_argument("--out", type=Path, default=Path(default), metavar="DIR", help=f"results go here (default: {default})")


def positive(text: str) -> int:
    """A whole number of at least 1."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value} is less than 1")
    return value


def seed(text: str) -> int:
    """A seed: SUMO takes 31 bits."""
    value = int(text)
    if not 0 <= value < 2**31:
        raise argparse.ArgumentTypeError(f"{value} is not between 0 and 2147483647")
    return value


def start_pose(text: str) -> StartPose:
    """``X,Y,HEADING`` in metres and degrees."""
    try:
        x_m, y_m, heading_deg = (float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not X,Y,HEADING (metres, metres, degrees)") from None
    return StartPose(x_m, y_m, math.radians(heading_deg))


def refine_mode(text: str) -> str:
    """A mode of the refinement, also by an old name."""
    return str(present_value("refine.mode", text))


def localizer_mode(text: str) -> str:
    """A mode of the localizer, also by an old name."""
    return str(present_value("localizer.mode", text))
