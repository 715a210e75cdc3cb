"""``hippodrome board``: methods x scenarios of any number of result folders."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import DONE, add_command


def add_board_command(commands: Any) -> None:
    """Adds it to the parser's ``commands``."""
    board = add_command(
        commands, "board", _board, "methods x scenarios of many results on one page",
        """Write one page with a table for each figure: a line for each method, a column for each scenario, over all folders.

        A cell has the mean over seeds and runs, their spread, the definition, the hash of the results that it was made from, and
        the command that makes it again. Results of different definitions, or of different drives of one name, are told apart. The
        page needs no server and no network; a click on a heading sorts.""",
        ["hippodrome board out/eval out/mine --out out/board.html"],
    )  # fmt: skip
    board.add_argument(
        "folders", type=Path, nargs="+", metavar="DIR", help="a folder with results.json, of `hippodrome eval`, `sweep` or others"
    )
    board.add_argument(
        "--out", type=Path, default=Path("out/board.html"), metavar="FILE", help="the page (default: out/board.html)"
    )


def _board(options: argparse.Namespace) -> int:
    from hippodrome.eval.board.page import write_board

    print(write_board(options.folders, options.out))
    return DONE
