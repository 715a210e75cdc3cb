"""``hippodrome drive``: missions in the loop."""

from __future__ import annotations

import argparse
from typing import Any

from hippodrome.eval.commands.arguments import (
    DONE,
    THRESHOLD_FAILED,
    add_command,
    add_out,
    add_scenarios,
    add_workers,
    positive,
)

ROW_KEYS = ("ours", "truth", "dead-reckoning", "no-reading", "on-sight", "paper", "kalman")


def add_mission_command(commands: Any) -> None:
    """Adds ``drive`` to the parser's ``commands``."""
    parser = add_command(
        commands, "drive", _drive, "let the vehicle drive to goals on its own map, in the loop",
        """Let the vehicle drive to goals on its own map, among the scenario's traffic, and score it.

        For each scenario the mapping drive is simulated and mapped as by `hippodrome eval`. Then missions are drawn by seed: the
        vehicle wakes up at a place that it is not told, and is to stop at a goal of which it is told place and heading. It sees
        camera frames, its own motion and a radar. docs/loop.md tells what is driven and how it is scored.

        Writes DIR/results.json, with the figures below `drive` of each row, and DIR/drive.html, one page with the driven ways.
        Finished missions are kept: the same command goes on where it was.

        Exits with 1 if there was a collision at fault, wrong-way driving or a false arrival, or if a limit of the scenario
        (thresholds.drive) does not hold.""",
        ["hippodrome drive scenarios/missions/grid.yaml --missions 3",
         "hippodrome drive scenarios/missions/grid.yaml scenarios/missions/rural.yaml --rows ours truth --workers 2",
         "hippodrome drive scenarios/missions/rural.yaml --missions 2 --rows truth --policy my_module:MyPolicy",
         "hippodrome drive scenarios/missions/radial.yaml --missions 1 --film"],
    )  # fmt: skip
    add_scenarios(parser, several=True)
    parser.add_argument(
        "--missions",
        type=positive,
        metavar="N",
        help="missions in each town; the first are the same for every N (default: the scenario's missions.count, or 10)",
    )
    parser.add_argument(
        "--rows", nargs="*", choices=ROW_KEYS, metavar="ROW",
        help="who drives. ours: from an unknown start; truth: the same, told its true pose (the upper bound); dead-reckoning: "
             "told the true start, and nothing later (the lower bound); no-reading: without the lane read from the frames; "
              "on-sight: searching by what is seen alone, without the road network; paper, kalman: with these modes of the "
              "localizer (default: the scenario's missions.rows, or ours truth; without a ROW: policies alone)",
    )  # fmt: skip
    parser.add_argument(
        "--policy", type=_policy, action="append", default=[], metavar="[NAME=]POLICY",
        help="somebody else who drives too, also several times: a Python class or function, my_package.my_module:MyPolicy, or a "
             "program that is fed step by step, 'exec:./driver'. It runs in a process of its own and sees nothing but what is "
             "sensed, map, road network and goal; docs/loop.md shows each (default: the scenario's missions.policies)",
    )  # fmt: skip
    parser.add_argument(
        "--film", nargs="?", choices=("webp", "mp4"), const="webp", default="", metavar="webp|mp4",
        help="write a film of each mission too, an animated WebP or an MP4: the camera, the town from above with plan and "
             "belief, what the driver says, the ring of head-direction cells and the sheets of grid cells (without a word: webp; "
             "default: no film)",
    )  # fmt: skip
    add_workers(parser)
    add_out(parser, "out/drive")


def _policy(text: str) -> Any:
    """A policy, as ``--policy`` names it."""
    from hippodrome.eval.drive.foreign import parse_policy  # not before it is needed: --help answers at once

    try:
        return parse_policy(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _drive(options: argparse.Namespace) -> int:
    from hippodrome.eval.drive.run import DriveRequest, drive

    request = DriveRequest(
        scenarios=options.scenarios, network=options.network, seed=options.seed, missions=options.missions, rows=options.rows,
        workers=options.workers, out=options.out, film=options.film, policies=options.policy,
    )  # fmt: skip
    return DONE if drive(request) else THRESHOLD_FAILED
