"""On which side of the road a map's traffic keeps: found in the map itself, since neither netconvert nor most maps say it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Final, Literal, TypeAlias
from xml.parsers import expat

from hippodrome.sim.keep_left_places import keeps_left_at

Side: TypeAlias = Literal["left", "right"]
Choice: TypeAlias = Literal["auto", "left", "right"]

PIECE_BYTES: Final = 1 << 20
ROUND_RAD: Final = math.radians(60.0)  # a piece of a roundabout that turns by less may be a bend in an approach
ROUNDABOUTS: Final = {"roundabout", "circular"}
MAIN: Final = {"motorway", "trunk", "primary", "secondary", "tertiary"}
DRIVEN: Final = MAIN | {"unclassified", "residential", "living_street", "service"}  # values of highway where cars drive


@dataclass(frozen=True, slots=True)
class DrivingSide:
    """A side and the words that say how it is known; no words where it is taken for right because nothing says otherwise."""

    side: Side
    reason: str = ""


@dataclass(slots=True)
class _OsmFindings:
    """What an OpenStreetMap file says of the side, counted while it is read."""

    roundabouts: list[tuple[list[str], bool]] = field(default_factory=list)  # nodes of ways; driven backwards
    mini: list[str] = field(default_factory=list)  # directions of mini roundabouts
    roads: int = 0
    road_sides: list[str] = field(default_factory=list)
    area_sides: list[str] = field(default_factory=list)  # of countries and other relations
    first_place: tuple[float, float] | None = None  # latitude and longitude


def osm_side(plain: Path) -> DrivingSide:
    """The side of a plain OpenStreetMap file, unpacked.

    Most roads' own tags come first, then the turn of its roundabouts, the tags of a country's boundary, and its place.
    """
    found = _osm_findings(plain)
    if found.road_sides and 2 * len(found.road_sides) >= found.roads and (side := _majority(found.road_sides)):
        return DrivingSide(side, f"{len(found.road_sides)} of its {found.roads} roads are tagged driving_side={side}")
    turns = _turns(plain, found)
    if side := _majority(turns):
        sense = "clockwise" if side == "left" else "anticlockwise"
        doubtful = side == "left" or "left" in turns or (found.first_place and keeps_left_at(*found.first_place))
        return DrivingSide(side, f"{turns.count(side)} of its {len(turns)} roundabouts are driven {sense}" if doubtful else "")
    if side := _majority(found.area_sides):
        return DrivingSide(side, f"a boundary in it is tagged driving_side={side}")
    if found.first_place and keeps_left_at(*found.first_place):
        lat, lon = found.first_place
        return DrivingSide("left", f"it lies at latitude {lat:.2f}, longitude {lon:.2f}, where traffic keeps left")
    if side := _majority(found.road_sides):
        return DrivingSide(side, f"{len(found.road_sides)} of its {found.roads} roads are tagged driving_side={side}")
    return DrivingSide("right")


def opendrive_side(plain: Path) -> DrivingSide:
    """The side of a plain OpenDRIVE file: the rule of most of its roads."""
    rules: list[str] = []

    def start(name: str, attributes: Mapping[str, str]) -> None:
        if name == "road":
            rules.append("left" if attributes.get("rule", "").strip().upper() == "LHT" else "right")

    _parse(plain, start)
    if (count := rules.count("left")) * 2 <= len(rules):
        return DrivingSide("right", f"{len(rules) - count} of its {len(rules)} roads have no rule LHT" if count else "")
    return DrivingSide("left", f"{count} of its {len(rules)} roads have rule=LHT")


def _osm_findings(plain: Path) -> _OsmFindings:
    found = _OsmFindings()
    tags: dict[str, str] = {}
    nodes: list[str] = []

    def start(name: str, attributes: Mapping[str, str]) -> None:
        if name == "tag":
            tags[attributes.get("k", "")] = attributes.get("v", "")
        elif name == "nd":
            nodes.append(attributes.get("ref", ""))
        elif name in ("node", "way", "relation"):
            tags.clear()
            nodes.clear()
            if name == "node" and found.first_place is None:
                found.first_place = _place(attributes)

    def end(name: str) -> None:
        if name == "node" and tags.get("highway") == "mini_roundabout":
            found.mini.append(tags.get("direction", ""))
        elif name == "way" and tags.get("highway", "").removesuffix("_link") in DRIVEN:
            found.roads += 1
            if tags.get("junction") in ROUNDABOUTS:
                found.roundabouts.append((nodes.copy(), tags.get("oneway") == "-1"))
            if tags.get("driving_side") in ("left", "right"):
                found.road_sides.append(tags["driving_side"])
        elif name == "relation" and tags.get("driving_side") in ("left", "right"):
            found.area_sides.append(tags["driving_side"])

    _parse(plain, start, end)
    return found


def _place(attributes: Mapping[str, str]) -> tuple[float, float] | None:
    try:
        return float(attributes["lat"]), float(attributes["lon"])
    except (KeyError, ValueError):
        return None


def _turns(plain: Path, found: _OsmFindings) -> list[str]:
    """The side that each roundabout speaks for, by the sense in which it is driven."""
    wanted = {node for nodes, _ in found.roundabouts for node in nodes}
    places: dict[str, tuple[float, float]] = {}

    def start(name: str, attributes: Mapping[str, str]) -> None:
        if name == "node" and attributes.get("id") in wanted and (place := _place(attributes)):
            places[attributes["id"]] = place

    if wanted:
        _parse(plain, start)
    sides = [{"clockwise": "left", "anticlockwise": "right"}.get(direction, "") for direction in found.mini]
    for nodes, backwards in found.roundabouts:
        turned_rad = _turned_rad([places[node] for node in nodes if node in places]) * (-1.0 if backwards else 1.0)
        if abs(turned_rad) > ROUND_RAD:
            sides.append("right" if turned_rad > 0.0 else "left")
    return [side for side in sides if side]


def _turned_rad(places: Sequence[tuple[float, float]]) -> float:
    """How far a way turns to the left in all, of latitudes and longitudes; right is negative."""
    flat = [(lon * math.cos(math.radians(lat)), lat) for lat, lon in places]
    steps = [(bx - ax, by - ay) for (ax, ay), (bx, by) in pairwise(flat) if (ax, ay) != (bx, by)]
    return sum(math.atan2(ax * by - ay * bx, ax * bx + ay * by) for (ax, ay), (bx, by) in pairwise(steps))


def _majority(sides: Sequence[str]) -> Side | None:
    left, right = sides.count("left"), sides.count("right")
    if left == right:
        return None
    return "left" if left > right else "right"


def _parse(plain: Path, start: Callable[[str, dict[str, str]], None], end: Callable[[str], None] | None = None) -> None:
    """Calls back for each element of a file. A broken file is read as far as it goes, and netconvert says what is wrong."""
    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    try:
        with plain.open("rb") as stream:
            while piece := stream.read(PIECE_BYTES):
                parser.Parse(piece, False)
            parser.Parse(b"", True)
    except expat.ExpatError:
        return
