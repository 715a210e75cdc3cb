"""Tables and lists in text files, of bounded size, with the line of an error."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from hippodrome._files import read_bounded, why_unreadable
from hippodrome.core.types import FloatArray
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.files.number_words import first_that_is_none, no_number, with_commas
from hippodrome.sim.yaml_file import MAX_BYTES, ScenarioError, parse_yaml

MAX_TABLE_BYTES: Final = 512 << 20
LONGEST_FOCAL_PX: Final = 1e6  # a telescope's


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
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        words = line.strip().split(separator)
        if len(words) < columns or (exactly and len(words) != columns):
            cure = with_commas(line, columns) if separator is None else ""
            raise ExchangeError(f"{path}: line {number}: {len(words)} columns, expected {columns}{cure}")
        try:
            rows.append([float(word) for word in words[:columns]])
        except ValueError:
            found = no_number(first_that_is_none(words[:columns]), number == 1)
            raise ExchangeError(f"{path}: line {number}: not a number in '{line.strip()[:60]}': {found}") from None
    if not rows:
        raise ExchangeError(f"{path}: no data; give a file with a row for each time")
    table = np.array(rows)
    if not np.isfinite(table).all():
        raise ExchangeError(f"{path}: data row {int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0]) + 1} is not finite")
    return table


def read_lines(path: Path) -> list[str]:
    """Lines of a text file of at most ``MAX_TABLE_BYTES``. Raises ExchangeError."""
    try:
        return read_bounded(path, MAX_TABLE_BYTES).decode("utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ExchangeError(f"{path}: cannot be read as text: {why_unreadable(error)}") from None


def read_values(path: Path, text: str) -> Any:
    """The values of the YAML text of a file, whose size, aliases and merge keys are bounded. Raises ExchangeError."""
    if len(text) > MAX_BYTES:
        raise ExchangeError(f"{path}: {len(text)} characters of YAML, the limit is {MAX_BYTES}; it is no description of a sensor")
    try:
        return parse_yaml(text, str(path), ours=False)[1]
    except ScenarioError as error:
        raise ExchangeError(str(error)) from None


def focal_length(words: Any, path: Path) -> float:
    """A focal length in pixels, as a file has it.

    Raises ValueError, TypeError or OverflowError if it is no number, and ExchangeError if no camera has it: what is measured in
    frames is divided by it.
    """
    focal_px = float(words)
    if not 1.0 < focal_px < LONGEST_FOCAL_PX:
        raise ExchangeError(f"{path}: a focal length of {focal_px:g} pixels, which no camera has; mend it, or take the file away")
    return focal_px


def inside(folder: Path, name: str, listed_in: Path) -> Path:
    """The file ``name`` in ``folder``. Raises ExchangeError if the name, read from the list ``listed_in``, leads out of it."""
    if "\0" in name:
        raise ExchangeError(f"{listed_in}: a file's name has a zero byte in it; the list is damaged")
    if Path(name).is_absolute() or ".." in Path(name).parts:
        raise ExchangeError(f"{listed_in}: '{name}' lies outside of the folder")
    return folder / name
