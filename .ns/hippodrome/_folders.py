"""Folders that one command at a time writes in, and temporary ones that the next command sweeps if their own was killed.

Both are held by the kernel's lock on the open folder (``flock``), which goes with the process, however that ends. No file is left
for it, and a number of a process that was given anew cannot mislead anybody. Not public.
"""

from __future__ import annotations

import atexit
import errno
import fcntl
import os
import re
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from hippodrome.core.types import HippodromeError

TEMPORARY: Final = "hippodrome-"  # how the names of our temporary folders begin
PART: Final = ".part"  # how the names of unfinished files and folders end; they begin with a dot
OURS: Final = re.compile(rf".*/\..+\.[a-z0-9_]{{8}}{re.escape(PART)}$")  # the eight are ``tempfile``'s; browsers have none
HELD: Final = (errno.EWOULDBLOCK, errno.EACCES)  # what the kernel answers when somebody else holds a lock


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A folder that is gone after the block. If the process is killed within it, the next ``sweep_temporary`` takes it away."""
    handle, folder = _held_folder(TEMPORARY, "", None)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(handle)


def folder_of_this_process() -> Path:
    """A temporary folder that lasts as long as the process. If that is killed, the next ``sweep_temporary`` takes it away."""
    _, folder = _held_folder(TEMPORARY, "", None)  # the handle stays open: it holds the lock
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def sweep_temporary() -> None:
    """Take away the temporary folders of our commands that are no longer running."""
    with suppress(OSError):
        _sweep(Path(tempfile.gettempdir()), TEMPORARY, "")


@contextmanager
def unfinished_folder(out: Path) -> Iterator[Path]:
    """A folder beside ``out``, which the block fills and renames. Those of killed commands for the same name are swept first."""
    _sweep(out.parent, f".{out.name}.", PART)
    handle, folder = _held_folder(f".{out.name}.", PART, out.parent)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(handle)


@contextmanager
def written_by_one(out: Path) -> Iterator[None]:
    """Within the block no other command writes in the folder ``out``, which is made if it is not there.

    What killed commands have left unfinished below it is taken away before, and what this one's processes have left after an
    error. A folder that was made here and stays empty is, too.

    Raises:
        HippodromeError: Another command writes there, or the folder cannot be made.
    """
    new = not out.exists()
    try:
        out.mkdir(parents=True, exist_ok=True)
        handle = os.open(out, os.O_RDONLY | os.O_DIRECTORY)
    except (OSError, ValueError) as error:
        raise HippodromeError(
            f"{out}: no folder can be made there: {getattr(error, 'strerror', None) or error}; give another --out"
        ) from error
    locked = False
    try:
        locked = _lock(handle, out)
        _sweep_below(out, locked)
        yield
    except BaseException:
        _sweep_below(out, locked)
        raise
    finally:
        os.close(handle)
        if new:
            with suppress(OSError):
                out.rmdir()


def lock_or_none(handle: int) -> bool | None:
    """Whether the lock on an open file or folder is ours now; False if somebody holds it, None where there are no locks."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return False if error.errno in HELD else None
    return True


def sweep_files(folder: Path, name: str) -> None:
    """Take away the unfinished files for ``name`` in ``folder`` that nobody is writing any more."""
    _sweep(folder, f".{name}.", PART)


def _sweep_below(out: Path, locked: bool) -> None:
    """Remove what is unfinished in a folder and those in it, if that is ``locked``: nobody else writes there."""
    for abandoned in filter(OURS.match, map(str, out.rglob(f".*{PART}") if locked else ())):
        with suppress(OSError):
            _remove_unheld(Path(abandoned))


def _lock(handle: int, out: Path) -> bool:
    """Lock ``out`` or raise HippodromeError; False, with a warning, where the file system has no locks."""
    locked = lock_or_none(handle)
    if locked is False:
        raise HippodromeError(f"{out}: another hippodrome command is writing there; wait for its end, or give another --out")
    if locked is None:
        print(f"hippodrome: {out}: no locks on this file system; run no two commands in it at once", file=sys.stderr)
    return bool(locked)


def _held_folder(prefix: str, suffix: str, parent: Path | None) -> tuple[int, Path]:
    """A new folder, and the handle that holds it. One that a sweeper took between its making and its locking is made anew."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=prefix, suffix=suffix, dir=parent))
        with suppress(FileNotFoundError):
            handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
            if lock_or_none(handle) is not False and folder.exists():
                return handle, folder
            os.close(handle)


def _sweep(parent: Path, prefix: str, suffix: str) -> None:
    """Remove what has such a name, is ours, and is held by nobody."""
    try:
        names = [path.name for path in parent.iterdir() if path.name.startswith(prefix) and path.name.endswith(suffix)]
    except OSError:
        return
    for name in names:
        with suppress(OSError):
            _remove_unheld(parent / name)


def _remove_unheld(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        if os.fstat(handle).st_uid == os.geteuid() and lock_or_none(handle):
            _remove(path)
    finally:
        os.close(handle)


def _remove(path: Path) -> None:
    """Remove a file, a link, or a folder with all that is in it; what cannot be removed stays."""
    with suppress(OSError):
        if stat.S_ISDIR(path.lstat().st_mode):
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink()
