"""``hippodrome gate``: run scenarios with several seeds, hold them against their limits and against a committed baseline."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import DONE, THRESHOLD_FAILED, add_out, add_workers

SEEDS = (1, 2, 3)


def add_gate_commands(commands: Any) -> None:
    """Adds ``gate`` and ``compare`` to the parser's ``commands``."""
    parser = commands.add_parser("gate", help="compare with a baseline over several seeds", description=_gate.__doc__)
    parser.add_argument("scenarios", type=Path, nargs="*", metavar="SCENARIO.yaml")
    parser.add_argument("--baseline", type=Path, default=Path("baseline.json"), metavar="FILE", help="default: baseline.json")
    parser.add_argument("--seeds", type=_seeds, default=SEEDS, metavar="1,2,3", help="default: 1,2,3")
    parser.add_argument("--update", action="store_true", help="make this run the baseline instead of comparing with it")
    parser.add_argument("--power", nargs="?", const="topometric", metavar="METHOD",
                        help="run nothing: say what the gate would catch, on the figures of the baseline")  # fmt: skip
    add_workers(parser)
    add_out(parser, "out/gate")
    parser.add_argument("--junit", type=Path, metavar="FILE", help="write the verdict as JUnit XML as well")
    parser.set_defaults(command=_gate)

    pair = commands.add_parser("compare", help="two results side by side", description=_compare.__doc__)
    pair.add_argument("before", type=Path, metavar="A", help="folder with results.json")
    pair.add_argument("after", type=Path, metavar="B", help="folder with results.json")
    pair.set_defaults(command=_compare)


def _seeds(text: str) -> tuple[int, ...]:
    try:
        seeds = tuple(int(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not a list of whole numbers like 1,2,3") from None
    if len(set(seeds)) != len(seeds) or not all(0 <= seed < 2**31 for seed in seeds):
        raise argparse.ArgumentTypeError(f"'{text}': seeds differ from one another and lie between 0 and 2147483647")
    return seeds


def _gate(options: argparse.Namespace) -> int:
    """Fail (exit status 1) if a limit of a scenario does not hold, or a figure is worse than the baseline's and not by chance."""
    from rich.console import Console

    from hippodrome.eval.gate.baseline import read_baseline
    from hippodrome.eval.gate.power import print_power
    from hippodrome.eval.gate.run import Request, gate

    if options.power is not None:
        print_power(read_baseline(options.baseline), options.power, Console())
        return DONE
    names = ("scenarios", "seeds", "baseline", "update", "workers", "out", "junit")
    return DONE if gate(Request(**{name: getattr(options, name) for name in names})) else THRESHOLD_FAILED


def _compare(options: argparse.Namespace) -> int:
    """Print which figures of B differ from A's; results of different scenarios or metric definitions are refused."""
    from rich.console import Console

    from hippodrome.eval.gate.two_runs import compare_folders

    compare_folders(options.before, options.after, Console())
    return DONE
