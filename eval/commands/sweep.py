"""``hippodrome sweep``: scenarios x seeds x parameters."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import DONE, THRESHOLD_FAILED, add_out, add_workers, seed


def add_sweep_command(commands: Any) -> None:
    """Adds ``sweep`` to the parser's ``commands``."""
    parser = commands.add_parser("sweep", help="a grid of scenarios, seeds and parameters", description=_sweep.__doc__)
    parser.add_argument("scenarios", type=Path, nargs="+", metavar="SCENARIO.yaml", help="see scenarios/")
    parser.add_argument("--seeds", type=seed, nargs="+", metavar="N", help="default: each scenario's own")
    parser.add_argument("--set", action="append", default=[], dest="parameters", metavar="KEY=V1,V2",
                        help="values of a scenario's key, see docs/scenarios.md (repeatable: all combinations)")  # fmt: skip
    add_workers(parser)
    parser.add_argument("--scheduler", metavar="ADDRESS", help="run on this Dask cluster instead (extra: dask)")
    add_out(parser, "out/sweep")
    parser.set_defaults(command=_sweep)


def _sweep(options: argparse.Namespace) -> int:
    """Evaluate every cell of a grid; finished cells are kept, failed ones listed (exit status 1) and run by the same command."""
    from hippodrome.eval.sweep.executors import SweepError
    from hippodrome.eval.sweep.grid import parse_parameter
    from hippodrome.eval.sweep.run import sweep

    try:
        parameters = [parse_parameter(text) for text in options.parameters]
    except ValueError as error:
        raise SweepError(f"--set: {error}") from None
    complete = sweep(options.scenarios, options.seeds, parameters, options.workers, options.scheduler, options.out)
    return DONE if complete else THRESHOLD_FAILED
