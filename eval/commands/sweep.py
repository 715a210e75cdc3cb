"""``hippodrome sweep``: scenarios x seeds x values of parameters."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import (
    DONE,
    THRESHOLD_FAILED,
    add_command,
    add_methods,
    add_out,
    add_workers,
    refuse_faults,
    seed,
)


def add_sweep_command(commands: Any) -> None:
    """Adds ``sweep`` to the parser's ``commands``."""
    parser = add_command(
        commands, "sweep", _sweep, "evaluate a grid of scenarios, seeds and parameters",
        """Evaluate every combination of scenario, seed and values of parameters, here or on a Dask cluster.

        Each combination is a cell and is scored as by `hippodrome eval`. Finished cells are kept: the same command runs what was
        interrupted, and what failed. Writes DIR/results.json, and DIR/table.md with one row for each setting and method, over the
        samples of all its runs together; DIR/sweep.html shows the same as a page. docs/sweeps.md tells the rest.

        Exits with 1 if a cell has no result; the others go on, and the list at the end names it with its cause.""",
        ["hippodrome sweep scenarios/towns/grid.yaml --seeds 1 2 3 --set noise=paper,harsh",
         "hippodrome sweep scenarios/towns/grid.yaml --set localizer.mode=coupled,kalman --set camera.rate_hz=5,10"],
    )  # fmt: skip
    parser.add_argument("scenarios", type=Path, nargs="+", metavar="SCENARIO.yaml", help="a scenario's file")
    refuse_faults(parser)
    parser.add_argument(
        "--seeds",
        type=seed,
        nargs="+",
        metavar="N",
        help="seeds that replace the scenarios' own, one run each (default: their own)",
    )
    parser.add_argument(
        "--set", action="append", default=[], dest="parameters", metavar="KEY=V1,V2",
        help="values, as YAML, that a scenario's key takes in turn; docs/scenarios.md lists the keys. Given several times, all "
             "combinations are run (default: the scenario as it is written)",
    )  # fmt: skip
    add_methods(parser)
    add_workers(parser)
    parser.add_argument(
        "--scheduler", metavar="ADDRESS",
        help="run on the Dask cluster with this scheduler, for instance tcp://127.0.0.1:8786 (docs/sweeps.md: TLS for several "
             "machines); needs pip install 'hippodrome[dask]' "
             "(default: run on this machine)",
    )  # fmt: skip
    add_out(parser, "out/sweep")


def _sweep(options: argparse.Namespace) -> int:
    from hippodrome.eval.sweep.executors import SweepError
    from hippodrome.eval.sweep.grid import parse_parameter
    from hippodrome.eval.sweep.run import sweep

    try:
        parameters = [parse_parameter(text) for text in options.parameters]
    except ValueError as error:
        raise SweepError(f"--set: {error}") from None
    complete = sweep(
        options.scenarios, options.seeds, parameters, options.workers, options.scheduler, options.out, options.method
    )
    return DONE if complete else THRESHOLD_FAILED
