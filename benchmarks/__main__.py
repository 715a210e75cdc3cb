"""``python -m benchmarks [NAME...]``: run all benchmarks, or those named, and print one table.

A benchmark is a module of this package with ``run() -> list[Row]``; add its name to ``NAMES``.
"""

from __future__ import annotations

import sys
from importlib import import_module

from benchmarks.table import Row, table
from hippodrome.eval.pool import one_opencv_thread

NAMES = ("render", "mapping", "localization", "matching", "scaling")


def main(names: list[str]) -> int:
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


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
