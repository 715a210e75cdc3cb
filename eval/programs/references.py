"""Python objects found by their names, ``module:Object``, and what was raised in strangers' code as one line."""

from __future__ import annotations

import importlib
import sys
import traceback
from pathlib import Path
from typing import Any

from hippodrome.core.types import HippodromeError


def search_here() -> None:
    """Let modules be looked for in the working directory as well, after all other places."""
    if str(Path.cwd()) not in sys.path:
        sys.path.append(str(Path.cwd()))


def object_of(reference: str) -> Any:
    """The object of ``module:Object``; the working directory is searched as well.

    Importing a module runs it, so that this may do anything and never end: it is for a process that has limits.

    Raises:
        HippodromeError: There is no such module or no such object in it, or importing it failed.
    """
    module_name, _, name = reference.partition(":")
    search_here()
    try:
        found: Any = importlib.import_module(module_name)
        for part in name.split("."):
            found = getattr(found, part)
    except ModuleNotFoundError as error:
        raise HippodromeError(f"there is no module '{error.name}'; install it, or run in the folder that has it") from None
    except AttributeError:
        raise HippodromeError(f"the module {module_name} has no '{name}'") from None
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a script that is no module leaves the process when it is imported
        raise HippodromeError(f"importing {module_name} failed: {said(error)}") from error
    return found


def said(error: BaseException) -> str:
    """What was raised and where, in one line."""
    return crash_of(error)[0].removeprefix("crashed: ")


def crash_of(error: BaseException) -> tuple[str, str]:
    """What was raised and where, in one line that begins with "crashed", and the whole traceback."""
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
