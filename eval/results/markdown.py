"""Tables in Markdown: the one place that writes them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

RULES: Final = {"l": "---", "r": "---:"}


def table(head: Sequence[str], rows: Iterable[Sequence[str]], align: str = "left-first", spaced: bool = False) -> list[str]:
    """The lines of a table: the headings, the rule below them, and the rows. Cells are written as they are given.

    Args:
        head: One heading per column; it may be empty.
        rows: One cell per column and row. A cell with text from elsewhere goes through ``escaped`` first.
        align: ``left-first`` puts the first column to the left and all others to the right, ``left`` puts all to the left;
            anything else is one letter per column, ``l`` or ``r``.
        spaced: Whether the rule below the headings has spaces around its dashes, ``| --- |`` instead of ``|---|``.

    Raises:
        ValueError: A row, or ``align``, has another number of columns than ``head``.
    """
    letters = {"left-first": ("l" + "r" * len(head))[: len(head)], "left": "l" * len(head)}.get(align, align)
    rules = [RULES[letter] for letter, _ in zip(letters, head, strict=True)]
    lines = [_line(head).replace("|  |", "| |"), _line(rules) if spaced else f"|{'|'.join(rules)}|"]
    for row in rows:
        if len(row) != len(head):
            raise ValueError(f"{len(row)} cells in a table of {len(head)} columns: {list(row)}")
        lines.append(_line(row))
    return lines


def escaped(text: str, html: bool = False) -> str:
    """Text that can neither end a table's cell nor its line; with ``html``, it cannot begin a tag either."""
    text = text.replace("|", "\\|").replace("\n", " ")
    return text.replace("<", "&lt;") if html else text


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"
