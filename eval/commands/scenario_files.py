"""What is wrong with scenario files is said at once, all of it, before a command loads what it drives, draws and maps with."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path


def has_faults(paths: Sequence[Path]) -> bool:
    """Whether a file is no scenario; every error of every file is printed to standard error, a line each, with its place."""
    from hippodrome.eval.authoring.errors import file_errors
    from hippodrome.eval.files.shipped import shipped

    faults = [line for path in paths for line in file_errors(shipped(path))]
    for line in faults:
        print(line, file=sys.stderr)
    return bool(faults)
