"""The terminal that tables are printed on: text is printed as it is, and cannot command the terminal."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.text import Text

from hippodrome._output import harmless


class PlainConsole(Console):
    """A console for names that come from files: ``[red]`` is text in it, and control characters are spaces."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"markup": False, "emoji": False, "highlight": False, **options})

    def render_str(self, text: str, **options: Any) -> Text:
        return super().render_str(harmless(text), **{**options, "markup": False, "emoji": False})
