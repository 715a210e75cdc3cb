"""What is odd about a network, as an author needs it: where it is, and what to do about it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.sim.map_import import IMPORT
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.types import Town

SHOWN: Final = 3  # notes of one kind that are shown: an OpenStreetMap extract may have hundreds, and one cure mends them all
CURES: Final = {  # what to do, by words in the notes of ``sim.network.check_network``
    "cannot be left or reached again": "to tour them, import a larger extract, or draw the way back in netedit",
    "zero-length lane": "nothing to do; `netconvert --junctions.join` removes most",
    "coincide at": "if one can drive across, join them: `netconvert --junctions.join`, or netedit",
    "have one lane for both directions": "nothing to do; for traffic there, give each direction a lane of its own in netedit",
    "has no lanes inside junctions": "the lanes are then made, also where the file has connections without them",
    "cross without a junction": "give the upper road its height (x,y,z in netedit), or join them in a junction",
    "climb or fall by more than": "look at the heights of this road, and how many points its shape has, in netedit",
    "wait for a hand": "nothing to do; a program of your own, drawn in netedit, is kept",
}
COMPLETE: Final = (IMPORT, "netconvert: ")  # notes on an import say themselves what to do
# Greatest way between two frames: beyond it a view shows another place than the one before, for vertices are 5 m apart.
VIEW_GAP_M: Final = 4.0


def network_notes(scenario: Scenario, town: Town) -> tuple[str, ...]:
    """One line for each oddity of the network and of the drives in it, with place and cure."""
    placed = [note if note.startswith(COMPLETE) else f"{_with_place(note, town.network)}: {_cure(note)}" for note in town.notes]
    return (*_few_of_a_kind(placed), *_rate_notes(scenario, town.network))


def _cure(note: str) -> str:
    return next((cure for words, cure in CURES.items() if words in note), "see it in netedit")


def _with_place(note: str, network: RoadNetwork) -> str:
    """The note with coordinates put behind the edge or lane that it gives as an instance."""
    named = re.search(r"for instance ([^\s,)]+)", note)
    place_m = _middle_m(named.group(1), network) if named else None
    if named is None or place_m is None:
        return note
    x_m, y_m = place_m
    return f"{note[: named.end()]} at ({x_m:.0f}, {y_m:.0f}) m{note[named.end() :]}"


def _middle_m(name: str, network: RoadNetwork) -> tuple[float, float] | None:
    """The point halfway along a lane, or along an edge's first lane; None if the network has neither of that name."""
    if name in network.lane_ids:
        lane = network.lane_ids.index(name)
    elif name in network.edge_ids:
        lane = int(np.argmax(network.lane_edge == network.edge_ids.index(name)))
    else:
        return None
    points_m = network.lane_points_m(lane)
    x_m, y_m = points_m[len(points_m) // 2]
    return float(x_m), float(y_m)


def _few_of_a_kind(notes: Sequence[str]) -> Iterator[str]:
    """At most ``SHOWN`` notes with the same cure, and how many more there are."""
    kinds: dict[str, list[str]] = {}
    for note in notes:
        kinds.setdefault(note if note.startswith(COMPLETE) else _cure(note), []).append(note)
    for alike in kinds.values():
        yield from alike[:SHOWN]
        if len(alike) > SHOWN:
            yield f"and {len(alike) - SHOWN} more like the last"


def _rate_notes(scenario: Scenario, network: RoadNetwork) -> Iterator[str]:
    """A note if there are too few frames for the speed of the streets: views of one drive then fall between the other's."""
    speed_mps = float(np.median(network.speed_limit_mps[~network.is_internal]))
    gap_m = speed_mps / scenario.camera.rate_hz
    if gap_m > VIEW_GAP_M:
        yield f"at {speed_mps:.0f} m/s the camera sees a view every {gap_m:.1f} m only: raise camera.rate_hz"
