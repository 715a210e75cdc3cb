"""What is said of a word in a table that is no number, and of a line that has too few: with the cure, where that can be told."""

from __future__ import annotations

import re
from typing import Final

from hippodrome._output import one_line

DATE: Final = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}.*|\d{1,2}:\d{2}.*")
LONGEST: Final = 40  # characters of a word that an error repeats


def no_number(word: str, heads: bool = False, heading: str = "") -> str:
    """That a word is no number, and why that may be.

    Args:
        word: The word.
        heads: Whether it stands in the first line, which may be a heading.
        heading: What is to be said of a heading; empty: that it begins with #.
    """
    cure = ""
    if "," in word:
        cure = "; numbers have a point, as 1.5"
    elif DATE.fullmatch(word):
        cure = "; times are seconds, not dates or times of day"
    elif heads:
        cure = heading or "; a heading begins with #"
    return f"'{one_line(word)[:LONGEST]}' is no number{cure}"


def first_that_is_none(words: list[str]) -> str:
    """The first word that is no number; empty if all are."""
    for word in words:
        try:
            float(word)
        except ValueError:
            return word
    return ""


def with_commas(line: str, wanted: int) -> str:
    """The cure for a line of too few columns whose numbers have commas between them; empty if there are not so many."""
    return "; write spaces in place of commas" if line.count(",") >= wanted - 1 else ""
