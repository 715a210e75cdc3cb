"""``hippodrome run``: from a drive and a map to a page in one command."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import DONE, add_beforehand, add_command, start_pose, write_alone
from hippodrome.eval.commands.exchange import add_drive_options, add_exchange_commands, import_command


def add_drive_command(commands: Any) -> None:
    """Adds it to the parser's ``commands``."""
    parser = add_command(
        commands, "run", _run, "from a drive that somebody recorded and a map to a page",
        """Import a drive, map it, lay the map on the roads, score it if there is a truth, and make a page of it all.

        DIR/drive.html shows the map over the network's own roads, frames, the figures with their definitions, and each stretch
        that no road vouches for, with its cause and what to do next. Beside it lie the recording, both maps and the converted
        network. A stage that is done is not done again: the same command resumes. A map that nothing vouches for is said in the
        last lines; the exit status is 0 then too.""",
        ["hippodrome run kitti/sequences/09 --network karlsruhe.osm --odometry truth --out out/kitti-09",
         "hippodrome run recordings/monday --network town.net.xml --out out/monday"],
        later_wins=True,
    )  # fmt: skip
    parser.add_argument(
        "drive", type=Path, metavar="DRIVE", help="what was recorded: as for `hippodrome import`, or a recording's folder"
    )
    add_drive_options(parser)  # of these, --network means more here
    parser.add_argument(
        "--network", type=Path, required=True, metavar="MAP",
        help="the road network: SUMO (.net.xml), OpenStreetMap (.osm, .pbf) or OpenDRIVE (.xodr), also packed",
    )  # fmt: skip
    parser.add_argument(
        "--start", type=start_pose, metavar="X,Y,HEADING|geo:LAT,LON[,HEADING]",
        help="pose at the start of the drive, in the network's frame: metres, metres, degrees counter-clockwise from east; or "
             "a GPS fix and the heading of a compass (default: unknown, it is searched for)",
    )  # fmt: skip
    add_beforehand(parser)
    parser.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="folder for the results; what is finished in it is not made again"
    )
    write_alone(parser)


def _run(options: argparse.Namespace) -> int:
    from hippodrome.eval.methods.beforehand import Beforehand
    from hippodrome.eval.real.run import RunOptions, run_drive
    from hippodrome.sim.recording import MANIFEST

    is_recording = (options.drive / MANIFEST).is_file()
    if is_recording:
        _refuse_import_options(options)

    def import_to(recording: Path, net_file: Path) -> None:
        wanted = {"source": options.drive, "out": recording, "network": net_file}
        import_command(argparse.Namespace(**{**vars(options), **wanted}))

    run_drive(
        RunOptions(
            drive=options.drive,
            network=options.network,
            out=options.out,
            start=options.start,
            known=Beforehand(options.metres_per_unit, options.network_accuracy_m),
            import_to=None if is_recording else import_to,
            score=_score,
            asked=_said(options, [*_import_actions(), *_matching_actions()]),
        )
    )
    return DONE


def _import_actions() -> list[argparse.Action]:
    """The options that only the import of a drive heeds."""
    parser = argparse.ArgumentParser(add_help=False)
    add_drive_options(parser)
    return [action for action in parser._actions if action.dest != "network"]


def _matching_actions() -> list[argparse.Action]:
    """The options that only the refinement heeds."""
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--start")
    add_beforehand(parser)
    return parser._actions


def _said(options: argparse.Namespace, actions: list[argparse.Action]) -> dict[str, str]:
    """What the user said by these options, by the option's name: those that have their default are left out."""
    given = ((action, getattr(options, action.dest)) for action in actions)
    return {action.option_strings[0]: str(value) for action, value in given if value != action.default}


def _refuse_import_options(options: argparse.Namespace) -> None:
    """Raise HippodromeError if options of the import were given for a drive that is a recording already."""
    if said := _said(options, _import_actions()):
        from hippodrome.core.types import HippodromeError

        cure = "hold the map against it with `hippodrome score`" if "--truth" in said else "leave that out"
        raise HippodromeError(
            f"{options.drive}: is a recording already, and {', '.join(sorted(said))} would say how to make one; {cure}, or give "
            "as DRIVE what it was made of"
        )


def _score(topometric: Path, recording: Path) -> None:
    """``hippodrome score`` as it is without options."""
    parser = argparse.ArgumentParser()
    add_exchange_commands(parser.add_subparsers())
    options = parser.parse_args(["score", str(topometric), str(recording)])
    options.command(options)
