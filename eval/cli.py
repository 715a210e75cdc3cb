"""The command line. Exit status: 0 done, 1 a limit missed, 2 bad input, 3 the gate cannot tell, 70 our fault, 130 interrupted."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from hippodrome._output import one_line
from hippodrome.eval.commands.arguments import Command, HelpLayout, print_help
from hippodrome.eval.commands.authoring import add_scenario_command
from hippodrome.eval.commands.board import add_board_command
from hippodrome.eval.commands.boundary import guarded, make_numba_cache
from hippodrome.eval.commands.drive import add_mission_command
from hippodrome.eval.commands.exchange import add_exchange_commands
from hippodrome.eval.commands.gate import add_gate_commands
from hippodrome.eval.commands.methods import add_method_commands
from hippodrome.eval.commands.run import add_drive_command
from hippodrome.eval.commands.runs import add_run_commands
from hippodrome.eval.commands.serve import add_serve_command
from hippodrome.eval.commands.stages import add_stage_commands
from hippodrome.eval.commands.sweep import add_sweep_command
from hippodrome.eval.commands.trials import add_trial_commands

DESCRIPTION = """\
Build, refine, localize in and score topometric cognitive maps of simulated drives, or of drives that others recorded.

A car drives through a town. A mapper that sees only its camera and its odometry builds a semi-metric map; a road network makes
the map topometric; a second drive is localized in it. `hippodrome eval` does all that for a scenario, a YAML file that
`hippodrome scenario new` writes. `hippodrome COMMAND --help` says what a command takes and writes."""

EPILOG = """\
examples:
  hippodrome scenario new my-town --from my_town.net.xml
  hippodrome eval scenarios/towns/rural.yaml --out out/rural
  hippodrome eval scenarios/paper.yaml --network my_town.net.xml --seed 7
  hippodrome render scenarios/towns/grid.yaml --out out/grid
  hippodrome map out/grid/recordings/grid-mapping-* --out out/grid/semi.pbstream
  hippodrome refine out/grid/semi.pbstream --network out/grid/towns/*.net.xml --out out/grid/topo.pbstream
  hippodrome localize out/grid/topo.pbstream out/grid/recordings/grid-localization-* --out out/grid/drive.tum

exit status: 0 done, 1 a threshold or a cell failed, 2 bad input (nothing is overwritten), 3 the gate cannot tell,
             70 a fault of hippodrome (please report it), 130, 143, 129 interrupted, terminated, hung up (rerun to resume)
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of the command ``hippodrome``; the exit status."""
    options = make_parser().parse_args(arguments)
    return guarded(lambda: _run(options))


def _run(options: argparse.Namespace) -> int:
    """Run the command that was asked for, in a process that is set up for it; what it raises is told by ``guarded``."""
    from hippodrome._folders import sweep_temporary

    sweep_temporary()
    make_numba_cache()  # before anything is imported that compiles
    command: Command = options.command
    return command(options)


def make_parser() -> argparse.ArgumentParser:
    """The parser of all commands. ``command`` of the parsed options is the function that runs what was asked for."""
    parser = _Parser(prog="hippodrome", description=DESCRIPTION, epilog=EPILOG, formatter_class=HelpLayout)
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    parser.set_defaults(command=print_help(parser))
    commands = parser.add_subparsers(metavar="COMMAND", title="commands")
    add_run_commands(commands)
    add_scenario_command(commands)
    add_method_commands(commands)
    add_board_command(commands)
    add_gate_commands(commands)
    add_drive_command(commands)
    add_mission_command(commands)
    add_serve_command(commands)
    add_stage_commands(commands)
    add_trial_commands(commands)
    add_sweep_command(commands)
    add_exchange_commands(commands)
    return parser


class _Parser(argparse.ArgumentParser):
    """A parser whose errors take a line, whatever the argument held; those of the commands are made of it, too."""

    def error(self, message: str) -> NoReturn:
        super().error(one_line(message))


class _Version(argparse.Action):
    """Prints the version of the installed package, which is looked up only then."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        print(f"hippodrome {version('hippodrome')}")
        parser.exit()


if __name__ == "__main__":
    sys.exit(main())
