"""Text for the terminal: names come from files, and files from anybody, so nothing in them may command it. Not public."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO, cast


@contextmanager
def harmless_output() -> Iterator[None]:
    """Within the block nothing that is printed commands the terminal: names come from files, and files from anybody."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (cast("TextIO", HarmlessStream(one)) if one is not None else one for one in before)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


class HarmlessStream:
    """A stream that writes characters as spaces which are not printed but obeyed: control characters, and those of direction.

    Rich, which colours our tables and draws bars of progress, finds the stream itself under ``rich_proxied_file``; its consoles
    take care of names (eval/results/terminal.py).
    """

    def __init__(self, stream: TextIO) -> None:
        self.rich_proxied_file = stream

    def write(self, text: str) -> int:
        """Write text; the number of its characters."""
        return self.rich_proxied_file.write(harmless(text))

    def writelines(self, lines: Iterable[str]) -> None:
        """Write texts one after the other."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.rich_proxied_file, name)


def terminal(stream: TextIO) -> TextIO:
    """The stream behind one that is harmless, for bars of progress, which have to command it."""
    return stream.rich_proxied_file if isinstance(stream, HarmlessStream) else stream


def harmless(text: str) -> str:
    """Text with a space for each character that is neither printable nor the end of a line or a column."""
    return text if text.isprintable() else "".join(one if one.isprintable() or one in "\n\t" else " " for one in text)


def one_line(text: str) -> str:
    """Text that can neither break the line nor command the terminal: names come from files."""
    return " ".join("".join(character if character.isprintable() else " " for character in text).split())
