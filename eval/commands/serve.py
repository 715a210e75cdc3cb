"""``hippodrome serve``: look at a run while it goes on."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import DONE, add_command, whole_number

PORT = 8765


def add_serve_command(commands: Any) -> None:
    """Adds ``serve`` to the parser's ``commands``."""
    parser = add_command(
        commands, "serve", _serve, "look at a run in a browser while it goes on",
        """Show, in a browser on this machine, how far the run in a folder is: its stages, frames as they are drawn, figures as
        they are finished, and its pages once it is over.

        Start it before, during or after the run, in a terminal of its own; Ctrl-C ends it. It only reads, and nobody else on the
        network can ask it.""",
        ["hippodrome serve out/eval",
         "hippodrome serve out/eval --port 0 --open"],
    )  # fmt: skip
    parser.add_argument(
        "folder", type=Path, metavar="DIR", help="the folder of the run, as given by its --out; it may not exist yet"
    )
    parser.add_argument(
        "--port", type=_port, default=PORT, metavar="N", help=f"port to listen at; 0: any that is free (default: {PORT})"
    )
    parser.add_argument("--open", action="store_true", help="show the page in the browser, too (default: say where it is)")


def _port(text: str) -> int:
    return whole_number(text, 0, 65535, "not a whole number from 0 to 65535")


def _serve(options: argparse.Namespace) -> int:
    from hippodrome.eval.commands.runs import show
    from hippodrome.eval.report.serve import ADDRESS, make_server, missing_note

    with make_server(options.folder, options.port) as server:
        if (missing := missing_note(options.folder)) is not None:
            print(missing)
        address = f"http://{ADDRESS}:{server.server_address[1]}/"
        print(f"{address}  (Ctrl-C ends it)", flush=True)
        if options.open:
            show(address)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            print()
    return DONE
