"""What ``scenario new --from`` names: a kind of town, or a map's file. Whatever else is written there is told with what to do."""

from __future__ import annotations

import difflib
import re
from contextlib import suppress
from pathlib import Path
from typing import Final

from hippodrome.core.types import HippodromeError
from hippodrome.eval.files.scenarios import PACKAGE
from hippodrome.sim.map_import import KNOWN, is_foreign
from hippodrome.sim.xml_head import root_of

KINDS: Final = ("rural", "grid", "radial", "random")
NUMBERS: Final = re.compile(r"(geo:)?[-+\d.,;:\s]+")  # a place in degrees, or a box of them
MOST_NAMES: Final = 1000  # files of a folder that are looked at for one of a name that is alike
DOWNLOAD: Final = "download the area (openstreetmap.org, Export), and name the file"
ROOTS: Final = {"net": ".net.xml", "osm": ".osm", "OpenDRIVE": ".xodr"}  # first elements of maps, and what their files end with


def require_source(source: str) -> None:
    """Raise HippodromeError, with what to do, unless this is a kind of town, or the file of a map, by its name at least."""
    if source in KINDS or source.startswith(PACKAGE):
        return
    if "://" in source:
        raise HippodromeError(f"--from {source}: an address, and nothing is downloaded; fetch the file, and name that")
    path = Path(source)
    if is_foreign(source) or path.is_file():
        return
    if path.is_dir():
        maps = [name for name in _names(path) if name.lower().endswith(KNOWN)]
        cure = f"name a map in it: {', '.join(maps[:5])}" if maps else f"it holds no map ({', '.join(KNOWN)})"
        raise HippodromeError(f"--from {source}: a folder; {cure}")
    raise HippodromeError(f"--from {source}: neither a kind of town ({', '.join(KINDS)}) nor a file; {_cure(source)}")


def _cure(source: str) -> str:
    """What may be meant by something that is no file."""
    if NUMBERS.fullmatch(source):
        return f"degrees alone are no map: {DOWNLOAD}; --around takes a circle out of it"
    if near := difflib.get_close_matches(source, KINDS, n=1):
        return f"did you mean {near[0]}?"
    path = Path(source)
    if near := difflib.get_close_matches(path.name, _names(path.parent), n=1, cutoff=0.8):
        return f"did you mean {path.with_name(near[0])}?"
    return f"for a place's map, {DOWNLOAD}"


def _names(folder: Path) -> list[str]:
    """The names in a folder, in order; of one that is very full, or cannot be looked into, none."""
    with suppress(OSError):
        names = sorted(one.name for one in folder.iterdir())
        return names if len(names) <= MOST_NAMES else []
    return []


def unknown_kind(source: str, file: Path) -> HippodromeError:
    """What is to be said of a map whose name ends in none of the known ways; of which kind it is, if it says so."""
    root = ""
    with suppress(HippodromeError):
        root = root_of(file)[0]
    cure = f"; it begins as a {ROOTS[root]} does: name it so" if root in ROOTS else ""
    return HippodromeError(f"--from {source}: unknown kind of map; there are {', '.join(KNOWN)}{cure}")
