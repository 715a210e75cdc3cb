"""The root element of an XML file, found without reading on; files that declare entities are refused, unexpanded."""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path
from typing import IO, Any, Final, cast
from xml.parsers import expat

from hippodrome._files import open_regular
from hippodrome.core.types import HippodromeError

PIECE_BYTES: Final = 1 << 14
MAX_HEAD_BYTES: Final = 64 << 20  # of comments before the root element


def root_of(file: Path, named: Path | None = None) -> tuple[str, dict[str, str]]:
    """Name and attributes of a file's root element, however long the comments before it.

    Args:
        file: An XML file, plain or packed with gzip.
        named: The file that errors speak of, where that is another one.

    Returns:
        Name and attributes; an empty name where there is no root element.

    Raises:
        HippodromeError: The file cannot be read, or declares entities, of which a few lines make gigabytes.
    """
    named = named or file
    found: list[tuple[str, dict[str, str]]] = []
    entities: list[str] = []
    parser = expat.ParserCreate()
    parser.StartElementHandler = lambda name, attributes: found.append((name, attributes))
    parser.EntityDeclHandler = lambda name, *_: entities.append(name)
    try:
        with opened(file) as stream:
            for _ in range(MAX_HEAD_BYTES // PIECE_BYTES):
                piece = stream.read(PIECE_BYTES)
                parser.Parse(piece, not piece)
                if found or entities or not piece:
                    break
    except expat.ExpatError:
        pass  # the root may stand before what is broken, and else there is none
    except (OSError, EOFError, zlib.error) as error:
        raise HippodromeError(f"{named}: unreadable ({one_line(error)}); check the file") from error
    if entities:
        raise HippodromeError(
            f"{named}: declares XML entities (<!ENTITY {entities[0]} ...>), which no map needs and which can fill the memory; "
            f"take the DOCTYPE out of the file"
        )
    return found[0] if found else ("", {})


def opened(file: Path) -> IO[Any]:
    """The bytes of a file, unpacked where it is packed with gzip, whatever its name."""
    with open_regular(file) as stream:
        is_packed = stream.read(2) == b"\x1f\x8b"
    return cast(IO[Any], gzip.open(file)) if is_packed else file.open("rb")


def one_line(error: BaseException) -> str:
    """What an error says, in one line."""
    return " ".join(str(error).split())
