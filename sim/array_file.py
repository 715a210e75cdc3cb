"""Arrays in files: of recordings, towns and truths. What is read is bounded, and nothing in it is run."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from hippodrome._files import read_bounded, replacing

MAX_ARRAY_BYTES: Final = 1 << 30  # of one file of arrays; a day at 10 Hz takes 80 MB


def write_arrays(path: Path, arrays: dict[str, Any]) -> None:
    """An npz archive (NumPy writes it with fixed dates: same arrays, same bytes)."""
    with replacing(path) as temporary, temporary.open("wb") as stream:
        np.savez(stream, **arrays)


def read_arrays(path: Path, names: list[str], optional: Sequence[str] = ()) -> dict[str, np.ndarray[Any, np.dtype[Any]]]:
    """Arrays of an npz file that are stored as they are: a packed one could claim any size and is refused.

    Those of ``optional`` are left out where the file has none.
    """
    blob = read_bounded(path, MAX_ARRAY_BYTES)
    with zipfile.ZipFile(io.BytesIO(blob)) as archive:
        if any(item.compress_type != zipfile.ZIP_STORED or item.file_size > len(blob) for item in archive.infolist()):
            raise ValueError("packed arrays")
    with np.load(io.BytesIO(blob), allow_pickle=False) as data:
        return {name: data[name] for name in [*names, *(name for name in optional if name in data)]}
