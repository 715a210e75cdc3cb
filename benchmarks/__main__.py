"""``python -m benchmarks [NAME...]``: run all benchmarks, or those named, and print one table.

A benchmark is a module of this package with ``run() -> list[Row]``; add its name to ``NAMES``.
"""

from __future__ import annotations

import argparse
import sys
from importlib import import_module

from benchmarks.table import Row, table
from hippodrome.eval.pool import one_opencv_thread

NAMES = {
    "render": "drawing frames",
    "mapping": "building maps",
    "localization": "localizing in a map",
    "matching": "matching a drive to lanes, beside two well-known map matchers",
    "reading": "reading the road in frames",
    "stream": "feeding a program frame by frame",
    "real": "real drives on real maps, where they lie beside the checkout (benchmarks.real itself prints more)",
    "large": "finding a drive of unknown start in 180 and in 1,000 km of road",
    "scaling": "refinement time and memory against the length of the drive",
}


def main(arguments: list[str]) -> int:
    """Run the benchmarks that are named and print their table; the exit status."""
    names = _parser().parse_args(arguments).names
    unknown = sorted(set(names) - set(NAMES))
    if unknown:
        print(f"no benchmark named {', '.join(unknown)}; there are: {', '.join(NAMES)}", file=sys.stderr)
        return 2
    one_opencv_thread()  # as in the commands
    rows: list[Row] = []
    for name in names or NAMES:
        print(f"running {name} ...", file=sys.stderr, flush=True)
        rows += import_module(f"benchmarks.{name}").run()
    print(table(rows))
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Measure speed and memory and print one table, a figure a line. Run it from the repository's folder.",
        epilog="example: python -m benchmarks render mapping",
    )
    listed = "; ".join(f"{name}: {words}" for name, words in NAMES.items())
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"benchmarks to run (default: all of them). {listed}")
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
