"""``hippodrome gate`` and ``compare``: hold a run against a committed baseline, or two runs against each other."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import DONE, THRESHOLD_FAILED, add_command, add_methods, add_workers

SEEDS = (1, 2, 3)
CANNOT_TELL = 3  # exit status of a gate that has too few pairs for a verdict
STATUS = {"passed": DONE, "failed": THRESHOLD_FAILED, "cannot tell": CANNOT_TELL}


def add_gate_commands(commands: Any) -> None:
    """Adds ``gate`` and ``compare`` to the parser's ``commands``."""
    parser = add_command(
        commands, "gate", _gate, "fail where this code is worse than a baseline",
        """Run scenarios with several seeds and hold the figures against a baseline, a file that is committed beside the code.

        Exits with 1 if a limit of a scenario does not hold, if a row fails, a drive is lost or a figure is missing that was not
        before, or if an error is worse than the baseline's and that is not chance: a paired test over scenarios and seeds
        decides. Exits with 3 if an error may be worse and the pairs are too few to tell; it says how many would. Prints what
        moved, and writes it as a page, DIR/gate.html. With --update the run becomes the baseline instead. docs/authoring.md says
        what the gate catches.""",
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
    parser.add_argument(
        "--study", action="store_true",
        help="run nothing: plant 200 changes of each kind at 3, 6 and 12 pairs, and print how often the gate fails, "
             "cannot tell and passes",
    )  # fmt: skip
    parser.add_argument("--update", action="store_true", help="make this run the baseline instead of comparing with it")
    parser.add_argument(
        "--power", nargs="?", const="topometric", metavar="METHOD",
        help="run nothing: say how large a regression of this method the gate would catch, on the baseline's own figures "
             "(without METHOD: topometric; default: the gate is run)",
    )  # fmt: skip
    add_methods(parser)
    add_workers(parser)
    parser.add_argument(
        "--out", type=Path, default=Path("out/gate"), metavar="DIR",
        help="folder for the runs; recordings in it are not made again (default: out/gate)",
    )  # fmt: skip
    parser.add_argument(
        "--junit",
        type=Path,
        metavar="FILE",
        help="write the verdict as JUnit XML too, for CI systems (default: it is not written)",
    )
    parser.add_argument(
        "--town-limit", type=_percent, metavar="PERCENT",
        help="fail, with exit status 1, where a figure becomes worse by more than PERCENT in any one scenario, on the mean of "
             "its seeds, whatever the others do (default: no such limit)",
    )  # fmt: skip

    pair = add_command(
        commands, "compare", _compare, "show two results side by side",
        """Print which figures of the results in B differ from those in A, and by how much. It is no test and gives no verdict.

        Both are folders that `hippodrome eval` wrote. Results of different scenarios, drives or definitions are refused. With
        --html a page is written that shows the maps of both side by side, and where on them the errors changed.""",
        ["hippodrome compare out/before out/after",
         "hippodrome compare out/before out/after --html"],
    )  # fmt: skip
    pair.add_argument("before", type=Path, metavar="A", help="folder with the first results.json")
    pair.add_argument("after", type=Path, metavar="B", help="folder with the second results.json")
    pair.add_argument(
        "--html", type=Path, nargs="?", const=Path(), metavar="FILE",
        help="also write a page with the maps of both; without FILE it is B/compare.html (default: no page)",
    )  # fmt: skip


def _seeds(text: str) -> tuple[int, ...]:
    try:
        seeds = tuple(int(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not a list of whole numbers like 1,2,3") from None
    if len(set(seeds)) != len(seeds) or not all(0 <= seed < 2**31 for seed in seeds):
        raise argparse.ArgumentTypeError(f"'{text}': seeds differ from one another and lie between 0 and 2147483647")
    return seeds


def _percent(text: str) -> float:
    """A share from a percentage above zero."""
    try:
        share = float(text.removesuffix("%")) / 100.0
    except ValueError:
        share = math.nan
    if not 0.0 < share < math.inf:
        raise argparse.ArgumentTypeError(f"'{text}' is not a percentage above 0, as 20 is")
    return share


def _gate(options: argparse.Namespace) -> int:
    from hippodrome._folders import written_by_one
    from hippodrome.eval.gate.baseline import read_baseline
    from hippodrome.eval.gate.power import print_power
    from hippodrome.eval.gate.run import GateRequest, gate
    from hippodrome.eval.gate.study import study_markdown
    from hippodrome.eval.results.terminal import PlainConsole

    if options.power is not None:
        print_power(read_baseline(options.baseline), options.power, PlainConsole())
        return DONE
    if options.study:
        print(study_markdown())
        return DONE
    names = ("scenarios", "seeds", "baseline", "update", "workers", "out", "junit", "town_limit")
    with written_by_one(options.out):
        request = GateRequest(**{name: getattr(options, name) for name in names}, methods=options.method)
        return STATUS[gate(request)]


def _compare(options: argparse.Namespace) -> int:
    from hippodrome.eval.gate.two_runs import compare_folders
    from hippodrome.eval.report.versus import COMPARE_PAGE
    from hippodrome.eval.results.terminal import PlainConsole

    page = options.after / COMPARE_PAGE if options.html == Path() else options.html
    compare_folders(options.before, options.after, PlainConsole(), page)
    return DONE
