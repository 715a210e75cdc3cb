"""Processes as the campaigns look for them, in /proc, and end them."""

from __future__ import annotations

import contextlib
import os
import signal
from pathlib import Path


def session(leader: int) -> list[int]:
    """The processes of a session that are neither dead nor only waiting to be noticed."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, number = path.read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(number) == leader and state not in "ZX":
            found.append(int(path.parent.name))
    return found


def started_with(variable: str) -> list[int]:
    """Living processes that have this among the variables with which they were started, also those of other sessions."""
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            if variable.encode() in (path / "environ").read_bytes().split(b"\0") and int(path.name) != os.getpid():
                found.append(int(path.name))
        except OSError:
            continue
    return found


def command_line(pid: int) -> bytes:
    """Its words; empty where it has ended."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def kill(pid: int, number: str) -> None:
    """Send a signal of this name to a process that may have ended."""
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, getattr(signal, number))


def with_default_signals() -> None:
    """Between fork and exec: the signals do what they do at a terminal. In the background a shell has some of them ignored."""
    for number in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)
