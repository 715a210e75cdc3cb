"""What the commands have in common: the layout of their help, arguments that several of them take, and the exit status of all."""

from __future__ import annotations

import argparse
import inspect
import math
import os
import shutil
import sys
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, TypeAlias

from hippodrome.core.types import StartPose
from hippodrome.sim.geo_start import GeoStart
from hippodrome.sim.renamed import present_value

LEAST_WORDS: Final = 20  # columns that words need beside a name
MAX_SEED: Final = 2**31 - 1
DONE, THRESHOLD_FAILED, BAD_INPUT, OUR_FAULT, INTERRUPTED = 0, 1, 2, 70, 130

Command: TypeAlias = Callable[[argparse.Namespace], int]  # takes the options and answers with the exit status


class HelpLayout(argparse.HelpFormatter):
    """Wraps each paragraph of a description by itself and leaves indented lines, which are commands to copy, as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        wrap = super()._fill_text
        return "\n\n".join(part if "\n  " in part else wrap(part, width, indent) for part in text.strip().split("\n\n"))


def add_command(
    commands: Any,
    name: str,
    run: Command,
    summary: str,
    description: str,
    examples: Sequence[str],
    *,
    later_wins: bool = False,
    light: bool = False,
) -> argparse.ArgumentParser:
    """Add a command to a parser's sub-parsers.

    Args:
        commands: What ``add_subparsers`` returned.
        name: The word that calls the command.
        run: What it does; answers with the exit status.
        summary: A few words for the list of commands.
        description: What it does, what goes in and what comes out, in paragraphs.
        examples: Command lines that work.
        later_wins: Whether an option may be added once more, in place of the one before: options shared with another command.
        light: Whether it never uses OpenCV, which then is not loaded, so that it answers at once.
    """
    parser = _add_parser(commands, name, summary, description, examples, "resolve" if later_wins else "error")
    parser.set_defaults(command=run if light else _with_one_opencv_thread(run))
    return parser


def _with_one_opencv_thread(run: Command) -> Command:
    """The command in a process whose OpenCV uses one thread. What is checked before it need not wait for OpenCV to be loaded."""

    def prepared(options: argparse.Namespace) -> int:
        from hippodrome.eval.pool import one_opencv_thread

        one_opencv_thread()
        return run(options)

    return prepared


def add_group(commands: Any, name: str, summary: str, description: str, examples: Sequence[str]) -> Any:
    """Add a command that has sub-commands, and answer with what these are added to. By itself it prints its help."""
    parser = _add_parser(commands, name, summary, description, examples)
    parser.set_defaults(command=print_help(parser))
    return parser.add_subparsers(metavar="ACTION", title="actions")


def _add_parser(
    commands: Any, name: str, summary: str, description: str, examples: Sequence[str], conflict_handler: str = "error"
) -> argparse.ArgumentParser:
    epilog = "\n  ".join(["examples:" if len(examples) > 1 else "example:", *examples])
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=summary,
        description=inspect.cleandoc(description),
        epilog=epilog,
        formatter_class=HelpLayout,
        conflict_handler=conflict_handler,
    )
    return parser


def print_help(parser: argparse.ArgumentParser) -> Command:
    """The command that a parser with sub-commands runs when none is given: say what there is."""

    def run(_: argparse.Namespace) -> int:
        parser.print_help()
        return BAD_INPUT

    return run


def print_listed(names: str, words: str) -> None:
    """Print a line of a list. In a terminal words that do not fit go on below themselves; elsewhere a line stays one."""
    line = f"{names} {words}".rstrip()
    width = shutil.get_terminal_size().columns
    beside = width - len(names) > LEAST_WORDS
    indent = " " * (len(names) + 1 if beside else 4)
    print(textwrap.fill(line, width, subsequent_indent=indent, break_on_hyphens=False) if sys.stdout.isatty() else line)


def add_scenarios(parser: argparse.ArgumentParser, several: bool) -> None:
    """The scenarios, and what may be replaced in them."""
    parser.add_argument(
        "scenarios", type=Path, nargs="+" if several else 1, metavar="SCENARIO.yaml",
        help="a scenario's file, or the name of one that comes with hippodrome (`hippodrome scenario list`); `hippodrome "
             "scenario new` writes one, docs/scenarios.md lists its keys",
    )  # fmt: skip
    parser.add_argument(
        "--network", type=Path, metavar="NET",
        help="drive in this road network instead of the scenario's town: SUMO (.net.xml, .net.xml.gz), OpenStreetMap or "
             "OpenDRIVE (default: the scenario's town)",
    )  # fmt: skip
    parser.add_argument("--seed", type=seed, metavar="N", help="replace the scenario's seed (default: the scenario's own)")
    refuse_faults(parser)


def add_workers(parser: argparse.ArgumentParser) -> None:
    """How many processes; no result depends on it."""
    parser.add_argument(
        "--workers", type=positive, default=os.cpu_count() or 1, metavar="N",
        help="how many processes work at once; no result depends on it (default: one for each core)",
    )  # fmt: skip


def add_methods(parser: argparse.ArgumentParser) -> None:
    """Methods that take part beside ours."""
    parser.add_argument(
        "--method", type=_method, action="append", default=[], metavar="[NAME=]METHOD",
        help="a method that takes part beside ours, also several times: a Python class, my_package.my_module:MyMapper; a program "
             "that reads files, 'exec:./run.sh {sequence} {out}'; one that is fed frame by frame, 'stream:./client'; or the name "
             "of an installed one; docs/methods.md shows each (default: ours and the scenario's own)",
    )  # fmt: skip


def add_out(parser: argparse.ArgumentParser, default: str) -> None:
    """The folder of the results, in which the parser's command writes alone."""
    write_alone(parser)
    parser.add_argument(
        "--out", type=Path, default=Path(default), metavar="DIR",
        help=f"folder for the results; what is finished in it is not made again (default: {default})",
    )  # fmt: skip


def write_alone(parser: argparse.ArgumentParser) -> None:
    """Let no two commands write in one folder ``--out``: the later one is refused with a sentence."""
    run: Command = parser.get_default("command")

    def alone(options: argparse.Namespace) -> int:
        from hippodrome._folders import written_by_one

        with written_by_one(options.out):
            return run(options)

    parser.set_defaults(command=alone)


def refuse_faults(parser: argparse.ArgumentParser) -> None:
    """Let a command that takes ``scenarios`` begin by saying all that is wrong with their files, as `scenario validate`."""
    run: Command = parser.get_default("command")

    def checked(options: argparse.Namespace) -> int:
        from hippodrome.eval.commands.scenario_files import has_faults

        return BAD_INPUT if has_faults(options.scenarios) else run(options)

    parser.set_defaults(command=checked)


def _method(text: str) -> Any:
    """A method, as ``--method`` names it."""
    from hippodrome.eval.contest.entry import parse_method  # not before it is needed: --help answers at once

    try:
        return parse_method(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def positive(text: str) -> int:
    """A whole number of at least 1."""
    return whole_number(text, 1, None, "not a whole number of at least 1")


def positive_number(text: str) -> float:
    """A finite number above 0."""
    return number_within(text, math.ulp(0.0), sys.float_info.max, "not a number above 0")


def number_within(text: str, least: float, most: float, what: str) -> float:
    """A number from ``least`` to ``most``. Raises ArgumentTypeError, which says that the text is ``what``."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not least <= value <= most:
        raise argparse.ArgumentTypeError(f"'{text}' is {what}")
    return value


def whole_number(text: str, least: int, most: int | None, what: str) -> int:
    """A whole number from ``least`` to ``most`` or on. Raises ArgumentTypeError, which says that the text is ``what``."""
    try:
        value = int(text)
    except ValueError:
        value = least - 1
    if value < least or (most is not None and value > most):
        raise argparse.ArgumentTypeError(f"'{text}' is {what}")
    return value


def seed(text: str) -> int:
    """A seed: SUMO takes 31 bits."""
    return whole_number(text, 0, MAX_SEED, f"not a whole number from 0 to {MAX_SEED}")


def start_pose(text: str) -> StartPose | GeoStart:
    """``X,Y,HEADING`` in metres and degrees, or ``geo:LAT,LON[,HEADING]`` in degrees, the heading as a compass shows it."""
    if text.startswith("geo:"):
        return _geo_start(text)
    try:
        x_m, y_m, heading_deg = (float(part) for part in text.split(","))
    except ValueError:
        x_m = y_m = heading_deg = math.nan
    if not (math.isfinite(x_m) and math.isfinite(y_m) and math.isfinite(heading_deg)):
        raise argparse.ArgumentTypeError(f"'{text}' is not X,Y,HEADING (metres, metres, degrees)")
    return StartPose(x_m, y_m, math.radians(heading_deg))


def _geo_start(text: str) -> GeoStart:
    try:
        lat_deg, lon_deg, *heading = (float(part) for part in text.removeprefix("geo:").split(","))
    except ValueError:
        heading = [math.nan]
        lat_deg = lon_deg = math.nan
    if len(heading) > 1 or not (abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0 and all(map(math.isfinite, heading))):
        raise argparse.ArgumentTypeError(
            f"'{text}' is not geo:LAT,LON or geo:LAT,LON,HEADING (WGS84 degrees; heading in degrees clockwise from north)"
        )
    return GeoStart(lat_deg, lon_deg, heading[0] if heading else None)


def refine_mode(text: str) -> str:
    """A mode of the refinement, also by an old name."""
    return str(present_value("refine.mode", text))


def localizer_mode(text: str) -> str:
    """A mode of the localizer, also by an old name."""
    return str(present_value("localizer.mode", text))


def add_beforehand(parser: argparse.ArgumentParser) -> None:
    """What may be known about the odometry and about the roads before a drive is laid on them."""
    add_units(parser, "unknown, it is searched for")
    parser.add_argument(
        "--network-accuracy", type=accuracy_m, metavar="METRES", dest="network_accuracy_m",
        help="how far the roads are drawn from where they are: standard deviation in each axis, metres; 0: they are exact "
             "(default: 2.5 for a network that says where on Earth it lies, as those of OpenStreetMap do, else 0)",
    )  # fmt: skip


def add_units(parser: argparse.ArgumentParser, default: str) -> None:
    """The unit of length of the odometry."""
    parser.add_argument(
        "--units", type=units, metavar="metres|METRES_PER_UNIT", dest="metres_per_unit",
        help="the unit of length of the self-motion, right within 10 %%: metres (wheels, stereo, GPS) or its length in metres "
             "(for speeds in km/h: 0.2778). The search is then several times faster, and shorter drives can be vouched for "
             f"(default: {default})",
    )  # fmt: skip


def units(text: str) -> float:
    """``metres``, or how many of them a unit of the odometry has."""
    if text == "metres":
        return 1.0
    return number_within(text, 1e-6, 1e6, "neither metres nor a number of metres from 1e-6 to 1e6")


def accuracy_m(text: str) -> float:
    """Metres from 0 on, below the width of a town."""
    return number_within(text, 0.0, 100.0, "not a number of metres from 0 to 100")
