"""OpenDRIVE files made ready for netconvert: spirals that are arcs, and roads that keep left."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Final

from hippodrome.core.types import HippodromeError

STRAIGHT_ENOUGH_M: Final = 1e-3  # a spiral that bends away from an arc by less is taken for one, which netconvert can compute
SPIRAL: Final = re.compile(r"""(<geometry\b[^>]*\blength\s*=\s*["']([^"']+)["'][^>]*>\s*)<spiral\b([^>]*?)(?:/>|>\s*</spiral>)""")
CURVATURE: Final = re.compile(r"""\b(curvStart|curvEnd)\s*=\s*["']([^"']+)["']""")


def with_arcs_for_arcs(plain: Path) -> int:
    """Write spirals that are arcs as arcs, in place, and count them: netconvert divides by the change of their curvature.

    A spiral of length L whose curvature changes by c lies within |c| L^2 / 8 of the arc of its mean curvature: the heading
    differs by at most |c| L / 8.
    """
    text = plain.read_text(encoding="utf-8", errors="surrogateescape")
    if "<spiral" not in text:
        return 0
    count = 0

    def arc(match: re.Match[str]) -> str:
        nonlocal count
        try:
            length_m = float(match[2])
            curvature = {name: float(value) for name, value in CURVATURE.findall(match[3])}
            change, mean = curvature["curvEnd"] - curvature["curvStart"], 0.5 * (curvature["curvEnd"] + curvature["curvStart"])
        except (ValueError, KeyError):
            return match[0]  # netconvert says what is wrong with it
        if not abs(change) * length_m**2 / 8.0 < STRAIGHT_ENOUGH_M:
            return match[0]
        count += 1
        return f'{match[1]}<arc curvature="{mean!r}"/>' if abs(mean) * length_m > 1e-9 else f"{match[1]}<line/>"

    changed = SPIRAL.sub(arc, text)
    if count:
        plain.write_text(changed, encoding="utf-8", errors="surrogateescape")
    return count


def with_lanes_swapped(plain: Path) -> None:
    """Write the lanes of roads that keep left under the numbers that netconvert expects of them, in place.

    In OpenDRIVE lanes with positive numbers lie on the left, and where traffic keeps left they run along the road. netconvert
    takes lanes with negative numbers for those that run along, and with ``--lefthand`` lays them on the left: so signs change.

    Raises:
        HippodromeError: The file is not XML, or a lane's number is none.
    """
    try:
        tree = ElementTree.parse(plain)
        for section in tree.iter("laneSection"):
            sides = [side for side in section if side.tag in ("left", "right")]
            for side in sides:
                side.tag = "right" if side.tag == "left" else "left"
                for lane in side.findall("lane"):
                    _negate(lane, "id")
                    for link in lane.findall("link/predecessor") + lane.findall("link/successor"):
                        _negate(link, "id")
                side[:] = sorted(side, key=lambda lane: -int(lane.get("id", "0")))
            section[:] = sorted(section, key=lambda part: {"left": 1, "center": 2, "right": 3}.get(part.tag, 0))
        for link in tree.iter("laneLink"):
            _negate(link, "from", "to")
        for validity in tree.iter("validity"):
            _negate(validity, "fromLane", "toLane")
        tree.write(plain, encoding="utf-8", xml_declaration=True)
    except (ElementTree.ParseError, ValueError) as error:
        raise HippodromeError(f"not a consistent OpenDRIVE file ({' '.join(str(error).split())})") from error


def _negate(element: ElementTree.Element, *names: str) -> None:
    for name in names:
        if (value := element.get(name)) is not None:
            element.set(name, str(-int(value)))
