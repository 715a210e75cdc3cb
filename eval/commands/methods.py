"""``hippodrome method``: what methods there are, and whether one keeps to the protocol."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import DONE, THRESHOLD_FAILED, add_command, add_group, add_out, print_listed


def add_method_commands(commands: Any) -> None:
    """Adds ``method`` with its sub-commands to the parser's ``commands``."""
    actions = add_group(
        commands, "method", "list methods, and check one of your own",
        """List the methods that can take part in an evaluation, or check one of your own.

        A method is anything that has a row in the tables: a Python class, a program that reads files, a program that is fed frame
        by frame. docs/methods.md shows how to write each.""",
        ["hippodrome method list", "hippodrome method check my_package.my_module:MyMapper"],
    )  # fmt: skip
    add_command(
        actions, "list", _list, "list the methods that there are",
        """Print a line for each method: its key, its name in the tables, what it is given. Ours come first, then those that
        installed packages make known by an entry point of the group hippodrome.methods.""",
        ["hippodrome method list"],
    )  # fmt: skip
    check = add_command(
        actions, "check", _check, "run a method on a short drive and say whether it keeps to the protocol",
        """Run a method twice on a drive of half a minute and say, line by line, whether it keeps to the protocol.

        It says what the method is given, whether its poses are finite, in order and in the frame that it declares, whether two
        runs give the same bytes, how it localizes, and what it costs. Exits with 1 if something is wrong, with the cause.""",
        ["hippodrome method check my_package.my_module:MyMapper",
         "hippodrome method check 'exec:./run.sh {sequence} {out}'",
         "hippodrome method check topometric"],
    )  # fmt: skip
    check.add_argument(
        "method", metavar="METHOD", help="one of ours by its key or name, or a method as `hippodrome eval --method` takes it"
    )
    add_out(check, "out/method-check")


def _list(_: argparse.Namespace) -> int:
    from hippodrome.eval.contest.check import list_lines

    for names, words in list_lines():
        print_listed(names, words)
    return DONE


def _check(options: argparse.Namespace) -> int:
    from hippodrome.eval.contest.check import check
    from hippodrome.eval.contest.entry import BUILT_IN, parse_method
    from hippodrome.eval.methods.protocol import MethodError

    ours = {name for cls in BUILT_IN for name in (cls.card.key, cls.card.label)}
    try:
        wanted = options.method if options.method in ours else parse_method(options.method)
    except ValueError as error:
        raise MethodError(f"{error}; `hippodrome method list` says which there are") from None
    good = True
    for finding in check(wanted, Path(options.out)):
        print(finding, flush=True)
        good &= finding.good
    print("verdict: it can take part" if good else "verdict: it cannot take part yet; docs/methods.md has what is expected")
    return DONE if good else THRESHOLD_FAILED
