"""Files on disk are whole or absent: written beside their place, synced, then renamed."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from hippodrome.core.types import HippodromeError


def write_atomically(path: Path, data: bytes) -> None:
    """Replace ``path`` by ``data``, making its folder if need be. Whatever was there stays until the new file is complete."""
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}.", suffix=".part", delete=False) as file:
            temporary = Path(file.name)
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.chmod(0o644)  # a temporary file is private by default; a result is for reading
        temporary.replace(path)
        _sync_folder(path.parent)
    except OSError as error:
        raise HippodromeError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _sync_folder(folder: Path) -> None:
    """Make the rename itself durable."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
