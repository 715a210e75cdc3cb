"""Tables and lists in text files, of bounded size, with the line of an error."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.eval.exchange.drives.errors import ExchangeError

MAX_TABLE_BYTES: Final = 512 << 20


def read_table(path: Path, columns: int, separator: str | None = None, exactly: bool = False) -> FloatArray:
    """The numbers (N, columns) of a text file; lines that begin with # are comments.

    Args:
        path: The file.
        columns: How many columns are wanted; further ones are left out.
        separator: What stands between two columns; None: white space.
        exactly: Whether further columns are an error.

    Raises:
        ExchangeError: The file cannot be read, or a line is not such numbers; the message names the line.
    """
    rows = []
    for number, line in enumerate(read_lines(path), start=1):
        if not line.strip() or line.startswith("#"):
            continue
        words = line.strip().split(separator)
        if len(words) < columns or (exactly and len(words) != columns):
            raise ExchangeError(f"{path}: line {number}: {len(words)} columns, expected {columns}")
        try:
            rows.append([float(word) for word in words[:columns]])
        except ValueError:
            raise ExchangeError(f"{path}: line {number}: not a number in '{line.strip()[:60]}'") from None
    if not rows:
        raise ExchangeError(f"{path}: no data")
    table = np.array(rows)
    if not np.isfinite(table).all():
        raise ExchangeError(f"{path}: data row {int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0]) + 1} is not finite")
    return table


def read_lines(path: Path) -> list[str]:
    """Lines of a text file of at most ``MAX_TABLE_BYTES``. Raises ExchangeError."""
    try:
        if (size := path.stat().st_size) > MAX_TABLE_BYTES:
            raise ExchangeError(f"{path}: {size} bytes, the limit is {MAX_TABLE_BYTES}")
        return path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ExchangeError(f"{path}: cannot be read as text: {error}") from None


def inside(folder: Path, name: str, listed_in: Path) -> Path:
    """The file ``name`` in ``folder``. Raises ExchangeError if the name, read from the list ``listed_in``, leads out of it."""
    if Path(name).is_absolute() or ".." in Path(name).parts:
        raise ExchangeError(f"{listed_in}: '{name}' lies outside of the folder")
    return folder / name
