"""``hippodrome gate`` and ``compare``: hold a run against a committed baseline, or two runs against each other."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import DONE, THRESHOLD_FAILED, add_command, add_methods, add_out, add_workers

SEEDS = (1, 2, 3)


def add_gate_commands(commands: Any) -> None:
    """Adds ``gate`` and ``compare`` to the parser's ``commands``."""
    parser = add_command(
        commands, "gate", _gate, "fail where this code is worse than a baseline",
        """Run scenarios with several seeds and hold the figures against a baseline, a file that is committed beside the code.

        Exits with 1 if a limit of a scenario does not hold, if a row fails or a drive is lost that was not before, or if an error
        is worse than the baseline's and that is not chance: a paired test over scenarios and seeds decides. Prints what moved.
        With --update the run becomes the baseline instead. docs/authoring.md says what the gate catches.""",
        ["hippodrome gate my-town.yaml --update",
         "hippodrome gate my-town.yaml --junit gate.xml",
         "hippodrome gate --power --baseline scenarios/baseline.json"],
    )  # fmt: skip
    parser.add_argument(
        "scenarios", type=Path, nargs="*", metavar="SCENARIO.yaml", help="a scenario's file; with --power none is needed"
    )
    parser.add_argument(
        "--baseline", type=Path, default=Path("baseline.json"), metavar="FILE",
        help="the file with the figures of earlier code (default: baseline.json)",
    )  # fmt: skip
    parser.add_argument(
        "--seeds", type=_seeds, default=SEEDS, metavar="1,2,3",
        help="seeds of the runs, with commas; more seeds catch smaller changes (default: 1,2,3)",
    )  # fmt: skip
    parser.add_argument("--update", action="store_true", help="make this run the baseline instead of comparing with it")
    parser.add_argument(
        "--power", nargs="?", const="topometric", metavar="METHOD",
        help="run nothing: say how large a regression of this method the gate would catch, on the baseline's own figures "
             "(without METHOD: topometric; default: the gate is run)",
    )  # fmt: skip
    add_methods(parser)
    add_workers(parser)
    add_out(parser, "out/gate")
    parser.add_argument(
        "--junit",
        type=Path,
        metavar="FILE",
        help="write the verdict as JUnit XML too, for CI systems (default: it is not written)",
    )

    pair = add_command(
        commands, "compare", _compare, "show two results side by side",
        """Print which figures of the results in B differ from those in A, and by how much. It is no test and gives no verdict.

        Both are folders that `hippodrome eval` wrote. Results of different scenarios, drives or definitions are refused.""",
        ["hippodrome compare out/before out/after"],
    )  # fmt: skip
    pair.add_argument("before", type=Path, metavar="A", help="folder with the first results.json")
    pair.add_argument("after", type=Path, metavar="B", help="folder with the second results.json")


def _seeds(text: str) -> tuple[int, ...]:
    try:
        seeds = tuple(int(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not a list of whole numbers like 1,2,3") from None
    if len(set(seeds)) != len(seeds) or not all(0 <= seed < 2**31 for seed in seeds):
        raise argparse.ArgumentTypeError(f"'{text}': seeds differ from one another and lie between 0 and 2147483647")
    return seeds


def _gate(options: argparse.Namespace) -> int:
    from rich.console import Console

    from hippodrome.eval.gate.baseline import read_baseline
    from hippodrome.eval.gate.power import print_power
    from hippodrome.eval.gate.run import GateRequest, gate

    if options.power is not None:
        print_power(read_baseline(options.baseline), options.power, Console())
        return DONE
    names = ("scenarios", "seeds", "baseline", "update", "workers", "out", "junit")
    request = GateRequest(**{name: getattr(options, name) for name in names}, methods=options.method)
    return DONE if gate(request) else THRESHOLD_FAILED


def _compare(options: argparse.Namespace) -> int:
    from rich.console import Console

    from hippodrome.eval.gate.two_runs import compare_folders

    compare_folders(options.before, options.after, Console())
    return DONE
