"""The processes of the system, and those that belong to a program: its group and all that descend from it."""

from __future__ import annotations

import contextlib
import os
import resource
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Running:
    """A process of the system."""

    parent: int
    group: int
    held_bytes: int


def processes() -> dict[int, Running]:
    """All processes, by their numbers."""
    found = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError, ValueError, IndexError):
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
                found[int(entry.name)] = Running(int(fields[1]), int(fields[2]), int(fields[21]) * resource.getpagesize())
    return found


def family(head: int, running: Mapping[int, Running]) -> set[int]:
    """The process ``head``, those of its group, and all that descend from them."""
    found = {pid for pid, one in running.items() if pid == head or one.group == head}
    while more := {pid for pid, one in running.items() if one.parent in found} - found:
        found |= more
    return found


def descendant(head: int, depth: int) -> int | None:
    """The number of the first child's first child and so on of ``head``, ``depth`` steps down; None while it is not there."""
    found, running = head, processes()
    for _ in range(depth):
        children = [pid for pid, one in running.items() if one.parent == found]
        if not children:
            return None
        found = min(children)
    return found


def holds_pipe(head: int, end: int) -> bool:
    """Whether a program, or what it started, has the other side of the pipe ``end`` open.

    ``head`` is the process that leads to the program, by way of a shell; both hold the pipe as long as they live, and are not
    meant. True where nobody can tell, or there is no program yet.
    """
    running, pipe = processes(), f"pipe:[{os.fstat(end).st_ino}]"
    pids = [pid for pid in family(head, running) if head not in (pid, running[pid].parent)]
    return not pids or any(_has_open(pid, pipe) for pid in pids)


def _has_open(pid: int, pipe: str) -> bool:
    try:
        with os.scandir(f"/proc/{pid}/fd") as entries:
            for entry in entries:
                with contextlib.suppress(FileNotFoundError):  # closed just now
                    if str(Path(entry.path).readlink()) == pipe:
                        return True
    except (FileNotFoundError, ProcessLookupError):
        return False
    except OSError:
        return True
    return False


def peak_bytes(pid: int) -> int:
    """The most memory that a process held so far; 0 if that cannot be read, as it has ended."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        return 1024 * int(Path(f"/proc/{pid}/status").read_text().split("VmHWM:")[1].split()[0])
    return 0
