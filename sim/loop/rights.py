"""Who has to yield to whom in the junctions of a network, and which lamp is whose, as the network's file says."""

from __future__ import annotations

from pathlib import Path
from typing import Final
from xml.parsers import expat

from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import HippodromeError
from hippodrome.sim.xml_head import one_line, opened

PIECE_BYTES: Final = 1 << 16


class Rights:
    """The right of way between the lanes inside junctions. All lanes are indices of the network.

    SUMO numbers the links of a junction; each link is one or more lanes in a row inside of it. A ``request`` lists for each
    link those that it has to let pass (``response``) and those that it crosses or meets (``foes``), a bit each, the first on the
    right.
    """

    def __init__(self, net_file: Path, network: RoadNetwork) -> None:
        self._lane = {name: lane for lane, name in enumerate(network.lane_ids)}
        self.junction_of: dict[int, str] = {}  # of the lanes inside junctions
        self.signal_of: dict[int, tuple[str, int]] = {}  # traffic light and number of the lamp, of first lanes inside junctions
        self.ways_from: dict[int, list[int]] = {}  # the first lanes inside of junctions, of all ways on from a lane
        self.phases: dict[str, list[str]] = {}  # states of each traffic light, in all of its programs
        self._link: dict[int, int] = {}
        self._response: dict[str, list[int]] = {}
        self._foes: dict[str, list[int]] = {}
        self._inner: dict[str, list[str]] = {}
        self._vias: dict[int, int] = {}  # the lane that follows inside a junction
        self._junction, self._signal = "", ""
        self._read(net_file)
        for junction, lanes in self._inner.items():
            for link, name in enumerate(lanes[: len(self._response.get(junction, ()))]):
                if name in self._lane:
                    self._link[self._lane[name]], self.junction_of[self._lane[name]] = link, junction
        for _ in range(3):  # lanes in a row inside a junction: netconvert makes up to three
            for lane, after in self._vias.items():
                if after in self._link and lane not in self._link:
                    self._link[lane], self.junction_of[lane] = self._link[after], self.junction_of[after]

    def must_yield(self, lane: int, other: int) -> bool:
        """Whether a vehicle on ``lane`` inside a junction has to let one on ``other`` pass; False unless both are in the same."""
        return self._bit(self._response, lane, other)

    def cross(self, lane: int, other: int) -> bool:
        """Whether two lanes inside a junction cross or meet."""
        return self._bit(self._foes, lane, other)

    def has_foes(self, lane: int) -> bool:
        """Whether any other way through the junction crosses or meets that of ``lane``."""
        junction = self.junction_of.get(lane)
        return junction is not None and self._foes[junction][self._link[lane]] != 0

    def same_link(self, lane: int, other: int) -> bool:
        """Whether two lanes are parts of one way through a junction."""
        junction = self.junction_of.get(lane)
        return junction is not None and junction == self.junction_of.get(other) and self._link[lane] == self._link[other]

    def _bit(self, table: dict[str, list[int]], lane: int, other: int) -> bool:
        junction = self.junction_of.get(lane)
        if junction is None or self.junction_of.get(other) != junction:
            return False
        return bool(table[junction][self._link[lane]] >> self._link[other] & 1)

    def _read(self, net_file: Path) -> None:
        parser = expat.ParserCreate()
        parser.StartElementHandler = self._start
        try:
            with opened(net_file) as stream:
                while piece := stream.read(PIECE_BYTES):
                    parser.Parse(piece, False)
                parser.Parse(b"", True)
        except (expat.ExpatError, OSError, EOFError, KeyError, ValueError) as error:
            raise HippodromeError(f"{net_file}: rights of way cannot be read ({one_line(error)}); write it again") from error

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        if tag == "junction":
            self._junction = attributes["id"]
            self._inner[self._junction] = attributes.get("intLanes", "").split()
        elif tag == "request" and not self._junction.startswith(":"):
            self._response.setdefault(self._junction, []).append(int(attributes["response"], 2))
            self._foes.setdefault(self._junction, []).append(int(attributes["foes"], 2))
        elif tag == "tlLogic":
            self._signal = attributes["id"]
        elif tag == "phase":
            self.phases.setdefault(self._signal, []).append(attributes["state"])
        elif tag == "connection" and attributes.get("via") in self._lane:
            via = self._lane[attributes["via"]]
            if attributes["from"].startswith(":"):
                before = self._lane.get(f"{attributes['from']}_{attributes['fromLane']}")
                if before is not None:
                    self._vias[before] = via
                return
            before = self._lane.get(f"{attributes['from']}_{attributes['fromLane']}")
            if before is not None:
                self.ways_from.setdefault(before, []).append(via)
            if attributes.get("tl"):
                self.signal_of[via] = attributes["tl"], int(attributes["linkIndex"])
