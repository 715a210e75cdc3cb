"""Calls of a method's functions: what goes wrong inside them becomes the cause in its row."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Final, TypeVar

from hippodrome._files import write_atomically
from hippodrome.core.types import HippodromeError
from hippodrome.eval.methods.materials import Materials
from hippodrome.eval.methods.protocol import MethodError

ResultT = TypeVar("ResultT")
INTERRUPTED: Final = 130  # exit status of a worker that is interrupted, which is no fault of the method


def guarded(label: str, function: Callable[[], ResultT], materials: Materials) -> ResultT:
    """What a method's function returns. What it raises becomes a MethodError, and the traceback a file beside the results."""
    try:
        return function()
    except (HippodromeError, KeyboardInterrupt):
        raise
    except SystemExit as error:
        if error.code == INTERRUPTED:
            raise
        raise MethodError(f"it left the process with status {error.code}") from error
    except BaseException as error:
        log = materials.folder / f"{label.replace(' ', '-')}-crash.txt"
        write_atomically(log, traceback.format_exc().encode())
        last = traceback.extract_tb(error.__traceback__)[-1]
        text = " ".join(str(error).split())[:200]
        place = f"{Path(last.filename).name}, line {last.lineno}"
        raise MethodError(f"crashed: {type(error).__name__}: {text} ({place}); its traceback is in {log.name}") from error
