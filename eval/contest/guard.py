"""Calls of a method's functions: what goes wrong inside them becomes the cause in its row."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeVar

from hippodrome._files import write_atomically
from hippodrome.core.types import HippodromeError
from hippodrome.eval.methods.protocol import MethodError

if TYPE_CHECKING:
    from hippodrome.eval.methods.materials import Materials

ResultT = TypeVar("ResultT")
INTERRUPTED: Final = 130  # exit status of a worker that is interrupted, which is no fault of the method


class Crashed(Exception):
    """A method that raised something in a process of its own."""

    def __init__(self, cause: str, trace: str) -> None:
        super().__init__(cause)
        self.cause, self.trace = cause, trace


def guarded(label: str, function: Callable[[], ResultT], materials: Materials) -> ResultT:
    """What a method's function returns. What it raises becomes a MethodError, and the traceback a file beside the results."""
    try:
        return function()
    except (HippodromeError, KeyboardInterrupt):
        raise
    except SystemExit as error:
        if error.code == INTERRUPTED:
            raise
        raise MethodError(left_by(error)) from error
    except BaseException as error:
        cause, trace = (error.cause, error.trace) if isinstance(error, Crashed) else crash_of(error)
        log = materials.folder / f"{label.replace(' ', '-')}-crash.txt"
        write_atomically(log, trace.encode(errors="replace"))
        raise MethodError(f"{cause}; its traceback is in {log.name}") from error


def left_by(error: SystemExit) -> str:
    """How a method left its process."""
    return printable(f"it left the process with status {0 if error.code is None else error.code}"[:200])


def crash_of(error: BaseException) -> tuple[str, str]:
    """What was raised and where, in one line, and the whole traceback."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    try:
        text = " ".join(str(error).split())[:200]
    except Exception:  # its own words may be what is broken
        text = "it cannot say why"
    trace = "".join(traceback.format_exception(error))
    return printable(f"crashed: {type(error).__name__}: {text} ({Path(last.filename).name}, line {last.lineno})"), trace


def printable(text: str) -> str:
    """A text of others, without what moves a terminal's cursor or cannot be written as UTF-8."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)
