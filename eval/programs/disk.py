"""How much a program keeps on disk: what lies in its folders, and the files that it has open for writing anywhere.

The system limits the length of a file and not what all of them take, so that is watched while the program runs.
"""

from __future__ import annotations

import os
import stat
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

BLOCK_BYTES: Final = 512  # what ``st_blocks`` counts in
ENTRY_BYTES: Final = 4096  # the least that a file or folder counts: a million empty files fill a disk, too
LEAST_PAUSE_S: Final = 1.0  # between two looks
PAUSE_FACTOR: Final = 20.0  # a look at many files takes long: at most one part of so many of the time is spent looking


class Disk:
    """What one program keeps.

    Args:
        limit_bytes: How much that may be, beside what lay in its folders before.
    """

    def __init__(self, limit_bytes: int) -> None:
        self.limit_bytes = limit_bytes
        self._folders: dict[Path, int] = {}
        self._next_s = 0.0

    def watch(self, folder: Path) -> None:
        """Count what comes into a folder from now on."""
        if folder not in self._folders:
            self._folders[folder] = sum(_sizes(folder).values())

    def is_due(self) -> bool:
        """Whether it is time for another look."""
        return time.monotonic() >= self._next_s

    def kept_bytes(self, pids: Iterable[int] = ()) -> int:
        """How much is kept now. ``pids``: the program's processes, whose open files are counted wherever they lie."""
        began_s = time.monotonic()
        inside: dict[tuple[int, int], int] = {}
        for folder in self._folders:
            inside |= _sizes(folder)
        outside = {key: size for pid in pids for key, size in _written_by(pid) if key not in inside}
        now_s = time.monotonic()
        self._next_s = now_s + max(PAUSE_FACTOR * (now_s - began_s), LEAST_PAUSE_S)
        return sum(inside.values()) - sum(self._folders.values()) + sum(outside.values())


def _sizes(folder: Path) -> dict[tuple[int, int], int]:
    """Bytes that each file and folder below a folder takes, by device and inode: a file of two names counts once."""
    found, waiting = {}, [str(folder)]
    while waiting:
        with suppress(OSError), os.scandir(waiting.pop()) as entries:  # it may be taken away meanwhile
            for entry in entries:
                with suppress(OSError):
                    status = entry.stat(follow_symlinks=False)
                    found[status.st_dev, status.st_ino] = max(status.st_blocks * BLOCK_BYTES, ENTRY_BYTES)
                    if stat.S_ISDIR(status.st_mode):
                        waiting.append(entry.path)
    return found


def _written_by(pid: int) -> Iterator[tuple[tuple[int, int], int]]:
    """Device, inode and bytes of the files that a process has open for writing, those without a name included."""
    with suppress(OSError), os.scandir(f"/proc/{pid}/fd") as entries:
        for entry in entries:
            with suppress(OSError):
                may_write = entry.stat(follow_symlinks=False).st_mode & stat.S_IWUSR  # of the link: how the file was opened
                status = entry.stat()
                if may_write and stat.S_ISREG(status.st_mode):
                    yield (status.st_dev, status.st_ino), status.st_blocks * BLOCK_BYTES
