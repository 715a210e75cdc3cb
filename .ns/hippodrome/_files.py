"""Files that are whole or absent, and hashes of files and of code. For all parts of the package; not public.

This module lies beneath ``core``, ``sim``, ``proto`` and ``eval``, as ``_folders`` and ``_processes`` do, so that each of them
may use it. They import the standard library, one another and ``HippodromeError``, nothing else.
"""

from __future__ import annotations

import errno
import hashlib
import os
import stat
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from io import BufferedReader
from pathlib import Path
from typing import Final

from hippodrome._folders import PART, lock_or_none, sweep_files
from hippodrome.core.types import HippodromeError

PACKAGE: Final = Path(__file__).parent  # the folder in which ``core``, ``sim``, ``proto`` and ``eval`` lie


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary file beside ``path``, which takes that name only when the block ends without an error.

    By then its bytes are on disk; until then, and after an error, whatever was at ``path`` stays as it was. The folder is made
    if need be. The finished file may be read by whom the umask lets. What a killed process left of the same file is swept.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    sweep_files(path.parent, path.name)
    handle, temporary = _held_file(path)
    try:
        yield temporary
        with temporary.open("rb+") as written:
            os.fsync(written.fileno())
        temporary.chmod(allowed(0o666))  # a temporary file is private by default
        temporary.replace(path)
        _sync_folder(path.parent)
    except OSError as error:
        if error.errno is not None and error.filename is None:
            error.filename = str(path)  # a full disk is met while writing, and does not know of which file
        raise
    finally:
        temporary.unlink(missing_ok=True)
        os.close(handle)


def _held_file(path: Path) -> tuple[int, Path]:
    """A new file beside ``path``, and the handle whose lock says that somebody is writing it."""
    while True:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=PART, dir=path.parent)
        if lock_or_none(handle) is not False and Path(name).exists():  # else a sweeper took it before it was locked
            return handle, Path(name)
        os.close(handle)


def allowed(mode: int) -> int:
    """The permissions that the process's umask leaves of ``mode``."""
    try:  # Linux tells the umask without its being set, which another thread would notice
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
        umask = int(next(line.split()[1] for line in lines if line.startswith("Umask:")), 8)
    except (OSError, ValueError, StopIteration):
        umask = os.umask(0o077)
        os.umask(umask)
    return mode & ~umask


def write_atomically(path: Path, data: bytes) -> None:
    """Replace the file ``path`` by ``data``, as ``replacing`` does. Raises HippodromeError if it cannot be written."""
    try:
        with replacing(path) as temporary:
            temporary.write_bytes(data)
    except OSError as error:
        raise HippodromeError(f"{path}: cannot be written: {error.strerror or error}") from error


def read_bounded(path: Path, most_bytes: int) -> bytes:
    """The bytes of a file that somebody names. No more than ``most_bytes`` are read, whatever the file says of its size.

    Raises:
        OSError: It cannot be read, is larger, or is no regular file: a device never ends, and a named pipe waits for a writer.
        HippodromeError: It has a name that no file can have.
    """
    with open_regular(path) as stream:
        data = stream.read(most_bytes + 1)
    if len(data) > most_bytes:
        raise OSError(f"more than {most_bytes} bytes, the limit")
    return data


def open_regular(path: Path) -> BufferedReader:
    """A file that somebody names, open to be read. A device or a named pipe, of which nobody knows when it ends, is none.

    Raises:
        OSError: It cannot be opened, or is no regular file.
        HippodromeError: It has a name that no file can have.
    """
    try:
        stream = open(path, "rb", opener=_open_without_waiting)  # noqa: SIM115  # who asked for it closes it
    except ValueError as error:  # a null byte in the name
        raise HippodromeError(f"{str(path)!r}: not the name of a file: {error}") from error
    if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
        stream.close()
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    return stream


# What files begin with that are taken for text and are none, or text of another coding.
MARKS: Final = {
    b"\xff\xfe": "UTF-16 text; save it as UTF-8",
    b"\xfe\xff": "UTF-16 text; save it as UTF-8",
    b"\x1f\x8b": "packed by gzip; unpack it",
    b"PK": "packed by zip, as workbooks are; unpack it, or save it as text",
}


def why_unreadable(error: Exception) -> str:
    """Why a file cannot be read, in words: the system's own for an ``OSError``, without its number and the name of the file.

    The caller's sentence has the name already, and "[Errno 2] No such file or directory: 'a/b'" would say it twice.
    """
    if isinstance(error, UnicodeDecodeError):
        marked = (words for mark, words in MARKS.items() if bytes(error.object[:4]).startswith(mark))
        return next(marked, f"not UTF-8 text (byte {error.start}); save it as UTF-8")
    return (isinstance(error, OSError) and error.strerror) or " ".join(str(error).split()) or type(error).__name__


def _open_without_waiting(name: str, flags: int) -> int:
    """Open a file; a named pipe would block until somebody writes to it."""
    return os.open(name, flags | os.O_NONBLOCK)


def sha256_of(path: Path) -> str:
    """SHA-256 of a file as 64 hexadecimal digits. The file is read in pieces, so it may be larger than memory."""
    with open_regular(path) as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def code_sha256(root: Path, patterns: Iterable[str]) -> str:
    """One hash, 16 hexadecimal digits, of the names and contents of all files below ``root`` that match a pattern.

    Results that are kept on disk carry it, so that those of other code are not taken for finished. It is computed once in a
    process: code that changes while a command runs is not the code that runs.

    Args:
        root: Folder that the patterns start from; names are hashed relative to it.
        patterns: Patterns of ``Path.glob``, for instance ``core/**/*.py``.
    """
    return _code_sha256(root, tuple(patterns))


@lru_cache(maxsize=8)
def _code_sha256(root: Path, patterns: tuple[str, ...]) -> str:
    digest = hashlib.sha256()
    for path in sorted({path for pattern in patterns for path in root.glob(pattern)}):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _sync_folder(folder: Path) -> None:
    """Put a new name on disk: renaming a file changes its folder, which has a cache of its own."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
