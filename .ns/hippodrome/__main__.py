"""The command ``hippodrome``, also as ``python -m hippodrome``."""

from __future__ import annotations

import signal
import sys


def main() -> int:
    """Run the command of the command line; the exit status.

    While it is loaded, and after its last word, an interrupt from the keyboard ends it as other signals do, without a traceback;
    in between it is answered by ``eval.commands.boundary``.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else it is ignored, as in a shell's background
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from hippodrome.eval.cli import main as run

    return run()


if __name__ == "__main__":
    sys.exit(main())
