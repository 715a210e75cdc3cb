"""Files of SUMO networks: found to be one, of bounded size, and read with ``sumolib``."""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path
from typing import Any, Final, TypeAlias
from xml.parsers import expat
from xml.sax import SAXException, parse

import sumolib

from hippodrome.core.types import HippodromeError

SumoNet: TypeAlias = Any  # sumolib.net.Net: sumolib has no types
SumoLane: TypeAlias = Any

SUMO_TRUE: Final = {"true", "1", "yes", "on", "x", "t"}  # what SUMO reads as true, in any case of letters
PIECE_BYTES: Final = 1 << 14
MAX_HEAD_BYTES: Final = 64 << 20  # of comments before the root element


def load_net(net_file: Path) -> SumoNet:
    """``sumolib``'s network, internal lanes included; every way of being unreadable is one ``HippodromeError``."""
    _reject_foreign(net_file)
    try:
        with gzip.open(net_file) if _is_packed(net_file) else net_file.open("rb") as stream:
            reader = _NetReader(withInternal=True, withFoes=False, withPrograms=True, withMacroConnectors=True)
            parse(stream, reader)
        net = reader.getNet()
        net.initRoutingCache(1000)  # as sumolib.net.readNet does
        return net
    except (SAXException, OSError, EOFError, zlib.error) as error:
        raise HippodromeError(f"{net_file}: broken network ({_one_line(error)}); write it again with netconvert") from error
    except (KeyError, AttributeError, ValueError, TypeError, IndexError) as error:
        reason = f"{type(error).__name__} {_one_line(error)}"
        raise HippodromeError(f"{net_file}: not a consistent SUMO network ({reason}); write it again with netconvert") from error


class _NetReader(sumolib.net.NetReader):  # type: ignore[misc]  # sumolib has no types
    """sumolib's reader, which takes the offset of a traffic light for a number; SUMO also knows ``begin``. We use none."""

    def startElement(self, name: str, attrs: Any) -> None:
        if name == "tlLogic" and attrs.get("offset") == "begin":
            attrs = {**dict(attrs.items()), "offset": "0"}
        super().startElement(name, attrs)


def is_left_hand(net_file: Path) -> bool:
    """Driving side, from the ``<net lefthand=...>`` attribute, which sumolib does not keep; read as SUMO reads booleans."""
    _, attributes = _root(net_file)
    return attributes.get("lefthand", "").lower() in SUMO_TRUE


def _reject_foreign(net_file: Path) -> None:
    if not net_file.is_file():
        raise HippodromeError(f"{net_file}: no such network file; give a SUMO .net.xml or .net.xml.gz")
    tag, _ = _root(net_file)
    if tag == "net":
        return
    if tag in ("osm", "OpenDRIVE"):
        kind = ".osm" if tag == "osm" else ".xodr"
        raise HippodromeError(f"{net_file}: not a SUMO network but a map to convert; name it {kind} and netconvert is run")
    raise HippodromeError(f"{net_file}: not a SUMO network (no <net> element); give a .net.xml or .net.xml.gz")


def _root(net_file: Path) -> tuple[str, dict[str, str]]:
    """Name and attributes of the root element, however long the comments before it; an empty name where there is none."""
    found: list[tuple[str, dict[str, str]]] = []
    parser = expat.ParserCreate()
    parser.StartElementHandler = lambda name, attributes: found.append((name, attributes))
    try:
        with gzip.open(net_file) if _is_packed(net_file) else net_file.open("rb") as stream:
            for _ in range(MAX_HEAD_BYTES // PIECE_BYTES):
                piece = stream.read(PIECE_BYTES)
                parser.Parse(piece, not piece)
                if found or not piece:
                    break
    except expat.ExpatError:
        pass  # the root may stand before what is broken, and else there is none
    except (OSError, EOFError, zlib.error) as error:
        raise HippodromeError(f"{net_file}: unreadable ({_one_line(error)}); check the file") from error
    return found[0] if found else ("", {})


def _is_packed(net_file: Path) -> bool:
    with net_file.open("rb") as stream:
        return stream.read(2) == b"\x1f\x8b"


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())
