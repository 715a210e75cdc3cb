"""The terminal that tables are printed on: text is printed as it is, and cannot command the terminal."""

from __future__ import annotations

import re
import textwrap
from typing import Any, Final

from rich.console import Console
from rich.text import Text

from hippodrome._output import harmless

NBSP: Final = "\N{NO-BREAK SPACE}"
TITLE_WIDTH: Final = 79  # of the lines above a table, in letters


class PlainConsole(Console):
    """A console for names that come from files: ``[red]`` is text in it, and control characters are spaces."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"markup": False, "emoji": False, "highlight": False, **options})

    def render_str(self, text: str, **options: Any) -> Text:
        return super().render_str(harmless(text), **{**options, "markup": False, "emoji": False})


def wrapped_title(title: str) -> str:
    """A title in lines that fit a table, in which no figure is parted from its unit."""
    bound = re.sub(r"(?<=\d) (?=\w)", NBSP, title)
    return "\n".join(textwrap.wrap(bound, TITLE_WIDTH, break_on_hyphens=False)).replace(NBSP, " ")
