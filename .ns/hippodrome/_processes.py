"""Processes that end with the one that started them, and signals that end a command as an interrupt does. Not public.

A worker that outlives its command holds a gigabyte for ever, and a tool that does may write into a folder that the next command
uses. Linux tells a process when its parent has died; elsewhere nothing does, and a child notices at its next look only.
"""

from __future__ import annotations

import ctypes
import functools
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import connection
from types import FrameType
from typing import Final

PR_SET_PDEATHSIG: Final = 1  # of Linux's <sys/prctl.h>
# What a shell, a CI system or a batch system ends a command with. SIGINT is Python's own affair.
ENDING: Final = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
GRACE_S: Final = 3.0  # time that workers have to clear away what they have begun


IMPORT_S: Final = 0.05  # after which a signal that came while a module was loaded is looked at again


class Terminated(KeyboardInterrupt):
    """A signal other than the keyboard's asks the command to end; all that an interrupt does happens then."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


def _prctl() -> Callable[..., int] | None:
    """The system call that sets what a process gets when its parent dies; None where there is none."""
    if sys.platform != "linux":
        return None
    with suppress(OSError, AttributeError):
        found: Callable[..., int] = ctypes.CDLL(None, use_errno=True).prctl
        return found
    return None


_PRCTL: Final = _prctl()  # looked up once: between fork and exec nothing may be loaded


def die_with_parent(parent: int) -> None:
    """Let the kernel kill this process when its parent ends, however that ends; at once if it has ended already.

    Args:
        parent: Process number of the parent.
    """
    if _PRCTL is not None:
        _PRCTL(PR_SET_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)
    if os.getppid() != parent:
        os._exit(128 + signal.SIGKILL)


def dying_with_me() -> Callable[[], None]:
    """For ``preexec_fn`` of ``subprocess``: the program dies with this process.

    The kernel counts the thread that starts the program as its parent, so that thread has to wait for it.
    """
    return functools.partial(die_with_parent, os.getpid())


@contextmanager
def ending_like_an_interrupt() -> Iterator[None]:
    """Within the block the signals of ``ENDING`` raise ``Terminated``; a second one ends the process as it always did.

    SIGINT raises ``KeyboardInterrupt``, as Python has it. Signals that are ignored, as ``nohup`` asks for, stay so. Only
    the main thread can have it otherwise. The exception may come up in the middle of a library that makes another one of it,
    as ctypes does of what comes up while it looks at arguments: after a signal whatever leaves the block is the signal's.
    While a module is loaded the signal waits: a library that can do without a module takes an exception for a reason to, and
    the command would go on.
    """
    came, kept = list[KeyboardInterrupt](), {}

    def raise_once(number: int, frame: FrameType | None) -> None:
        if _is_importing(frame):
            later = threading.Timer(IMPORT_S, os.kill, (os.getpid(), number))
            later.daemon = True
            later.start()
            return
        signal.signal(number, signal.SIG_DFL)
        came.append(KeyboardInterrupt() if number == signal.SIGINT else Terminated(number))
        raise came[0]

    with suppress(ValueError):  # not the main thread
        for number in (*ENDING, signal.SIGINT):
            if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
                kept[number] = signal.signal(number, raise_once)
    try:
        yield
    except Exception as error:
        if came:
            raise came[0] from error
        raise
    finally:
        for number, handler in kept.items():
            signal.signal(number, handler)


def _is_importing(frame: FrameType | None) -> bool:
    """Whether a module is being loaded where this frame is."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def end_children(grace_s: float = GRACE_S) -> None:
    """End the processes that ``multiprocessing`` started: they are asked first, and killed after ``grace_s``."""
    children = multiprocessing.active_children()
    for child in children:
        child.terminate()
    waiting, end_s = list(children), time.monotonic() + grace_s
    while waiting and (left_s := end_s - time.monotonic()) > 0.0:
        gone = connection.wait([child.sentinel for child in waiting], left_s)  # reaps none: their pool does that
        waiting = [child for child in waiting if child.sentinel not in gone]
    for child in waiting:
        child.kill()
    for child in children:  # its sentinel goes a moment before its locks do
        if child.pid is not None and hasattr(os, "waitid"):
            with suppress(ChildProcessError):
                os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)
