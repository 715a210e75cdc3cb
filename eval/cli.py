"""The command line. Exit status: 0 done, 1 a threshold failed, 2 bad input, 130 interrupted."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence

from hippodrome.core.types import HippodromeError
from hippodrome.eval.commands.arguments import BAD_INPUT, INTERRUPTED
from hippodrome.eval.commands.authoring import add_scenario_command
from hippodrome.eval.commands.exchange import add_exchange_commands
from hippodrome.eval.commands.gate import add_gate_commands
from hippodrome.eval.commands.runs import add_run_commands
from hippodrome.eval.commands.stages import add_stage_commands
from hippodrome.eval.commands.sweep import add_sweep_command
from hippodrome.eval.commands.trials import add_trial_commands
from hippodrome.eval.pool import one_opencv_thread

EPILOG = """\
examples:
  hippodrome scenario new my-town --from my_town.net.xml
  hippodrome eval scenarios/towns/rural.yaml --out out/rural
  hippodrome eval scenarios/paper.yaml --network my_town.net.xml --seed 7
  hippodrome render scenarios/towns/grid.yaml --out out/grid
  hippodrome map out/grid/recordings/grid-mapping-* --out out/grid/semi.pbstream
  hippodrome refine out/grid/semi.pbstream --network out/grid/towns/*.net.xml --out out/grid/topo.pbstream
  hippodrome localize out/grid/topo.pbstream out/grid/recordings/grid-localization-* --out out/grid/drive.tum

exit status: 0 done, 1 a threshold or a cell failed, 2 bad input (nothing is overwritten), 130 interrupted (rerun to resume)
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of the command ``hippodrome``."""
    options = _parser().parse_args(arguments)
    command: Callable[[argparse.Namespace], int] = options.command
    one_opencv_thread()
    try:
        return command(options)
    except HippodromeError as error:
        print(f"hippodrome: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("hippodrome: interrupted; what was finished is kept, the same command resumes", file=sys.stderr)
        return INTERRUPTED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="hippodrome",
        description="Builds, refines, localizes in and scores topometric cognitive maps of simulated drives.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    add_run_commands(commands)
    add_scenario_command(commands)
    add_gate_commands(commands)
    add_stage_commands(commands)
    add_trial_commands(commands)
    add_sweep_command(commands)
    add_exchange_commands(commands)
    return parser


if __name__ == "__main__":
    sys.exit(main())
