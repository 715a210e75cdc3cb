"""Calls of a method's functions: what goes wrong inside them becomes the cause in its row."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from hippodrome._files import write_atomically
from hippodrome.core.types import HippodromeError
from hippodrome.eval.methods.protocol import MethodError
from hippodrome.eval.programs.references import crash_of, printable

if TYPE_CHECKING:
    from hippodrome.eval.methods.materials import Materials

ResultT = TypeVar("ResultT")


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
        raise MethodError(left_by(error)) from error
    except BaseException as error:
        cause, trace = (error.cause, error.trace) if isinstance(error, Crashed) else crash_of(error)
        log = materials.folder / f"{label.replace(' ', '-')}-crash.txt"
        write_atomically(log, trace.encode(errors="replace"))
        raise MethodError(f"{cause}; its traceback is in {log.name}") from error


def left_by(error: SystemExit) -> str:
    """How a method left its process."""
    return printable(f"it left the process with status {0 if error.code is None else error.code}"[:200])
