"""The boundary of the command line: whatever a command raises becomes one sentence and an exit status."""

from __future__ import annotations

import errno
import os
import sys
import tempfile
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final

from hippodrome._folders import folder_of_this_process
from hippodrome._output import harmless_output, one_line
from hippodrome._processes import Terminated, ending_like_an_interrupt
from hippodrome.core.types import HippodromeError
from hippodrome.eval.commands.arguments import BAD_INPUT, DONE, INTERRUPTED, OUR_FAULT

FAULT: Final = "fault-of-hippodrome-"  # not as our temporary folders begin, which the next command sweeps
TRACEBACK: Final = "HIPPODROME_TRACEBACK"  # set it to see the traceback of a fault on the terminal
RESUMES: Final = "what was finished is kept, the same command resumes"


def guarded(command: Callable[[], int]) -> int:
    """Run a command and say in one line how it ended, if not well; the exit status.

    An error of the user's or of the machine (``HippodromeError``, ``OSError``, no memory) has status 2; anything else is a fault
    of ours, whose traceback goes to a file; signals have 128 and their number.
    """
    _print_what_the_terminal_can()
    with harmless_output():
        return _guarded(command)


def _guarded(command: Callable[[], int]) -> int:
    try:
        with ending_like_an_interrupt():
            status = command()
            if sys.stdout is not None:
                sys.stdout.flush()  # what is still to be printed meets a closed pipe here, where it is handled, or not at all
        return status
    except BrokenPipeError:  # the reader of our output, `head` for one, has seen enough
        _let_go_of_output()
        return DONE
    except HippodromeError as error:
        return _say(str(error), BAD_INPUT)
    except Terminated as error:
        return _say(f"ended by {error}; {RESUMES}", 128 + error.number)
    except KeyboardInterrupt:
        return _say(f"interrupted; {RESUMES}", INTERRUPTED)
    except OSError as error:
        return _say(machine_fault(error), BAD_INPUT)
    except UnicodeEncodeError as error:  # what came from a file's name, or from JSON, and cannot be written as text
        return _say(_no_text(error), BAD_INPUT)
    except MemoryError:
        return _say("out of memory; close other programs, use fewer --workers, or a smaller input", BAD_INPUT)
    except Exception as error:
        return _say(_our_fault(error), OUR_FAULT)


def machine_fault(error: OSError) -> str:
    """What the operating system refused, in words: file, reason, and a cure where one is known."""
    names = [str(name) for name in (error.filename, error.filename2) if name is not None]
    place = " -> ".join(names) or "the system"
    return (
        f"{place}: {error.strerror or error}; {CURES.get(error.errno or 0, 'check the file, its folder and their permissions')}"
    )


CURES: Final = {
    errno_of: cure
    for errnos, cure in (
        (("ENOSPC", "EDQUOT"), "free some space or inodes, or write elsewhere; the same command resumes"),
        (("EROFS",), "the disk can only be read; write elsewhere"),
        (("EACCES", "EPERM"), "permission is missing; write elsewhere, or ask its owner"),
        (("ENOENT",), "it is not there, or its folder was removed meanwhile"),
        (("EMFILE", "ENFILE"), "too many open files; raise the limit (ulimit -n) or use fewer --workers"),
        (("ENOMEM", "EAGAIN"), "the system is out of memory or processes; use fewer --workers"),
        (("EIO",), "the disk or the network drive fails; check it"),
        (("ENAMETOOLONG",), "choose a shorter name"),
    )
    for errno_of in (getattr(errno, name, -1) for name in errnos)
}


def make_numba_cache() -> None:
    """Give numba a folder for compiled code where neither the package's own nor the user's cache can be written.

    Without one it refuses to import the inner loops. The folder is private, as the code in it is run, and lasts as long as the
    process; it says so, since compiling takes a minute.
    """
    if "NUMBA_CACHE_DIR" in os.environ or _can_write(Path(__file__).parent / "__pycache__") or _can_write(_user_cache()):
        return
    os.environ["NUMBA_CACHE_DIR"] = str(folder_of_this_process())
    print(
        f"hippodrome: {_user_cache()}: cannot be written, so compiled code is not kept and each command takes a minute longer; "
        "set NUMBA_CACHE_DIR to a folder of your own",
        file=sys.stderr,
    )


def _user_cache() -> Path:
    """Where numba keeps compiled code of packages that cannot be written."""
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")  # noqa: PTH111, PTH118  # as numba does
    return Path(base) / "numba"


def _can_write(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _no_text(error: UnicodeEncodeError) -> str:
    """Which name or text has a character that no file can hold, a half of a pair or a byte that was no UTF-8."""
    around = error.object[max(0, error.start - 40) : error.end + 40]
    return f"'{ascii(around)[1:-1]}': a name or a text that cannot be written in {error.encoding}; rename the file, or the thing"


def _our_fault(error: Exception) -> str:
    """Write the traceback to a file, or to the terminal if it is asked for there; the sentence that says so."""
    text = "".join(traceback.format_exception(error))
    where = ""
    if os.environ.get(TRACEBACK):
        print(text, file=sys.stderr)
    else:
        with suppress(OSError):
            handle, name = tempfile.mkstemp(prefix=FAULT, suffix=".txt")
            with os.fdopen(handle, "w", encoding="utf-8", errors="replace") as stream:
                stream.write(text)
            where = f" with {name}"
    said = f"{type(error).__name__}: {error}"
    return f"this is a fault of hippodrome; please report it{where or f' ({TRACEBACK}=1 shows where)'}: {said[:500]}"


def _say(line: str, status: int) -> int:
    """Print one line to standard error, whatever is in it, and leave standard output in peace; the status."""
    _let_go_of_output_if_it_fails()
    with suppress(OSError, ValueError):  # the terminal is gone: the status tells
        print(f"hippodrome: {one_line(line)}", file=sys.stderr, flush=True)
    return status


def _print_what_the_terminal_can() -> None:
    """Characters that the terminal or the pipe has no code for are printed as escapes; else they would end the command."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, ValueError, OSError):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]


def _let_go_of_output_if_it_fails() -> None:
    """A full disk behind standard output must not be met once more when the interpreter ends."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except (OSError, ValueError):
        _let_go_of_output()


def _let_go_of_output() -> None:
    with suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
