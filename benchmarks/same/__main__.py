"""``python -m benchmarks.same BEFORE AFTER``: are the results the same, bit for bit?

BEFORE and AFTER are folders that ``hippodrome eval``, ``stress`` or ``robustness`` wrote, or folders with several of them;
with ``--commits`` they are commits, each of which is cloned, set up and run. Exit status: 0 the same, 1 different, 2 bad input.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

from benchmarks.same.commits import results_of_commits
from benchmarks.same.contents import LEFT_OUT
from benchmarks.same.folders import Tally, compare_folders
from hippodrome.core.types import HippodromeError

SAME, DIFFERENT, BAD_INPUT = 0, 1, 2


def main(arguments: list[str]) -> int:
    """Compare, print the table, and return the exit status."""
    options = _parser().parse_args(arguments)
    try:
        if options.commits:
            with results_of_commits(options.before, options.after, options.keep, options.workers) as (before, after):
                tallies = compare_folders(before, after)
        else:
            tallies = compare_folders(Path(options.before), Path(options.after))
    except HippodromeError as error:
        print(f"same: {error}", file=sys.stderr)
        return BAD_INPUT
    print(table(tallies))
    return DIFFERENT if any(tally.differing for tally in tallies.values()) else SAME


def table(tallies: Mapping[str, Tally]) -> str:
    """What was compared, how much of it, what differs; then the differences one by one, then the verdict."""
    rows = [("compared", "files", "values", "differ", "new")]
    rows += [
        (kind, f"{tally.files:,}", f"{tally.values:,}", f"{tally.differing:,}", f"{tally.new:,}")
        for kind, tally in tallies.items()
    ]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = ["  ".join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])]) for row in rows]
    lines += ["", f"left out of JSON files: {', '.join(sorted(LEFT_OUT))}; pictures, pages and scenario.json are not compared"]
    lines += [difference for tally in tallies.values() for difference in tally.differences]
    differing = sum(tally.differing for tally in tallies.values())
    return "\n".join([*lines, f"{differing:,} values differ" if differing else "all the same"])


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.same", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("before", metavar="BEFORE", help="a folder of results; with --commits a commit")
    parser.add_argument("after", metavar="AFTER", help="the same, of the code to be judged")
    parser.add_argument(
        "--commits", action="store_true", help="clone, set up and run two commits of this repository (half an hour)"
    )
    parser.add_argument(
        "--keep", type=Path, metavar="DIR", help="with --commits: clone and run here, and keep it; a later call resumes"
    )
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="with --commits: processes (default: 2)")
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
