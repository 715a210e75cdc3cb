"""Lines of text files of bounded size, and the numbers in them."""

from __future__ import annotations

from pathlib import Path

from hippodrome._files import read_bounded, why_unreadable
from hippodrome.eval.files.number_words import first_that_is_none, no_number
from hippodrome.eval.files.trajectories import MAX_BYTES
from hippodrome.eval.metrics.association import TrajectoryError


def text_lines(path: Path) -> list[str]:
    """The lines of a text file of at most ``MAX_BYTES``. Raises TrajectoryError."""
    try:
        if (size := path.stat().st_size) > MAX_BYTES:
            raise TrajectoryError(f"{path}: {size} bytes, the limit is {MAX_BYTES}")
        return read_bounded(path, MAX_BYTES).decode("utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise TrajectoryError(f"{path}: cannot be read as text: {why_unreadable(error)}") from None


def row_of_numbers(path: Path, number: int, words: list[str], width: int) -> list[float]:
    """The ``width`` numbers of line ``number``. Raises TrajectoryError, which names the line."""
    if len(words) != width:
        raise TrajectoryError(f"{path}: line {number}: {len(words)} columns, the lines before have {width}")
    try:
        return [float(word) for word in words]
    except ValueError:
        raise TrajectoryError(f"{path}: line {number}: {no_number(first_that_is_none(words), number == 1)}") from None
