"""What netconvert warns of, as notes: one for each kind of warning, with its place, what it means, and what to do."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Final

MAX_NOTES: Final = 5  # kinds of warnings that are shown; the rest is counted
SPIRALS: Final = "Could not compute spiral geometry"

# Words of a warning, and what it means for a drive, with the cure where one is needed. The gravest kinds stand first.
MEANINGS: Final[tuple[tuple[str, str], ...]] = (
    (SPIRALS, "a curve was drawn as a straight; write it as arcs, or with a curvature that changes, and import the map again"),
    ("is not known", "a road lacks points there and was cut; export the map with all nodes of its ways"),
    ("nvalid", "this part of the map was left out or read otherwise; correct it in the map"),
    ("not numeric", "the usual value for such a road was taken; correct the tag in the map if it matters"),
    ("sing default", "the usual value was taken; correct the tag in the map if it matters"),
    ("nable to parse", "the usual value was taken; correct it in the map if it matters"),
    ("nknown", "it was left out; correct it in the map if it matters"),
    ("urn restriction", "a ban on turning was not understood and cars may turn; correct the relation in the map"),
    ("oneway", "the tag was not understood; look at the directions of this road in netedit"),
    ("smooth shape", "a bend is drawn with a corner; look there in netedit if cars drive over it"),
    ("o avoid dead-end", "lanes may be changed there, since nobody could leave them otherwise; nothing to do"),
    ("Could not", "this part of the map was left out; look there in netedit"),
    ("ould not be", "this part of the map was left out; look there in netedit"),
    ("is not connected", "no car can come to or leave this lane; draw a connection in netedit if there is one"),
    ("ntersecting left turns", "turning cars wait for one another there; nothing to do"),
    ("sharp turn", "cars slow down there; smooth the road in netedit if it is no such turn"),
    ("Found angle", "cars slow down there; smooth the road in netedit if it is no such bend"),
    ("Speed of", "cars turn slowly there; nothing to do"),
    ("has to be split", "a road that ends where it begins became two; nothing to do"),
    ("does not control any links", "the signal was left out; nothing to do"),
    ("inor green", "turning cars give way there; nothing to do"),
    ("Ambigu", "one of two ways to turn round was taken; nothing to do"),
    ("joining junctions", "a crossing stays in several parts; join them in netedit if cars wait inside of it"),
    ("unction cluster", "a crossing stays in several parts; join them in netedit if cars wait inside of it"),
    ("distance", "a crossing is drawn aside of its place; look there in netedit"),
    ("Discarding", "such roads are not for cars and were left out; nothing to do"),
)
UNKNOWN: Final = "look there in netedit"
TOTAL: Final = re.compile(r"(\d+) total messages of type:? (.+)")


def netconvert_notes(log: Sequence[str], made: Path) -> tuple[str, ...]:
    """The warnings of a run of netconvert.

    Args:
        log: The lines that it wrote.
        made: The network that it made, by which named junctions and edges are given a place; it need not be there.

    Returns:
        One note for each kind of warning, the gravest first; after ``MAX_NOTES`` of them a count of the others.
    """
    first: dict[str, str] = {}  # of each kind, the first warning
    count: Counter[str] = Counter()
    for line in log:
        if line.startswith("Warning: "):
            text = line.removeprefix("Warning: ").strip()
            if total := TOTAL.match(text):  # said at the end of those of a kind of which not all were shown
                count[_kind(total[2].replace("%", "0"))] = int(total[1])
            else:
                count[_kind(text)] += 1
                first.setdefault(_kind(text), text)
    kinds = sorted(first, key=lambda kind: _meaning(first[kind])[0])
    network = made.read_text(encoding="utf-8", errors="replace") if kinds and made.is_file() else ""
    notes = [_note(first[kind], count[kind], network) for kind in kinds[:MAX_NOTES]]
    hidden = sum(count[kind] for kind in kinds[MAX_NOTES:])
    more = f"netconvert: {hidden} warnings of {len(kinds) - MAX_NOTES} more kinds; run netconvert on the map to see them"
    return (*notes, *([more] if hidden else []))


def _kind(text: str) -> str:
    """A warning without its names and numbers."""
    return re.sub(r"'[^']*'|[-\d.]+", "#", text)


def _note(warning: str, count: int, network: str) -> str:
    """The note on warnings of one kind, of which this is the first."""
    text = warning.rstrip(".")
    alike = f" ({count} of this kind)" if count > 1 else ""
    return f"netconvert: {text}{_place(text, network)}{alike}: {_meaning(text)[1]}"


def _meaning(text: str) -> tuple[int, str]:
    """How grave a warning is, 0 being the gravest, and what it means."""
    found = ((rank, meaning) for rank, (words, meaning) in enumerate(MEANINGS) if words in text)
    return next(found, (len(MEANINGS), UNKNOWN))


def _place(text: str, network: str) -> str:
    """Where the first junction or edge lies that a warning names, if the network has one of that name."""
    for name in re.findall(r"'([^']+)'", text):
        edge = re.escape(name.partition("->")[0])
        junction = re.search(rf'<junction id="{re.escape(name)}"[^>]* x="([-\d.]+)" y="([-\d.]+)"', network)
        lane = re.search(rf'<lane id="{edge}(?:_\d+)?"[^>]* shape="([-\d.]+),([-\d.]+)', network)
        if found := junction or lane:
            return f" at ({float(found[1]):.0f}, {float(found[2]):.0f}) m"
    return ""
