"""Files of SUMO networks: found to be one, of bounded size, read with ``sumolib``, and refused where they make no sense."""

from __future__ import annotations

import gc
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, Final, TypeAlias
from xml.sax import SAXException, parse

import sumolib

from hippodrome.core.types import HippodromeError
from hippodrome.sim.xml_head import one_line, opened, root_of

SumoNet: TypeAlias = Any  # sumolib.net.Net: sumolib has no types
SumoLane: TypeAlias = Any

MISSING: Final[dict[type[Exception], str]] = {  # what sumolib stumbles over, in words
    KeyError: "{} is named and not described",
    IndexError: "a lane is named that its edge does not have",
}
SUMO_TRUE: Final = {"true", "1", "yes", "on", "x", "t"}  # what SUMO reads as true, in any case of letters
MAX_NET_BYTES: Final = 1 << 30  # unpacked; a network of 1,000 km has some 200 MB
FARTHEST_M: Final = 1e8  # from the origin: more than any place on Earth is in any projection
FASTEST_MPS: Final = 1000.0  # a speed limit beyond it is a slip of the pen
WIDEST_M: Final = 1000.0
OLDEST_VERSION: Final = "0.13"  # of networks that do not say theirs


@contextmanager
def many_objects() -> Iterator[None]:
    """Within the block Python looks for no cycles of objects: ``sumolib`` makes millions that all stay, and each look at them
    takes as long as making them did."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


@many_objects()
def load_net(net_file: Path) -> SumoNet:
    """``sumolib``'s network, internal lanes included; every way of being unreadable is one ``HippodromeError``."""
    _reject_foreign(net_file)
    try:
        with opened(net_file) as stream:
            reader = _NetReader(withInternal=True, withFoes=False, withPrograms=True, withMacroConnectors=True)
            parse(_Bounded(stream, net_file), reader)
        net = reader.getNet()
        net.initRoutingCache(1000)  # as sumolib.net.readNet does
        net.lost_places_to_wait = sorted(reader.lanes_after_waiting - reader.places_to_wait)
    except (SAXException, OSError, EOFError, zlib.error) as error:
        raise HippodromeError(f"{net_file}: broken network ({one_line(error)}); write it again with netconvert") from error
    except (KeyError, AttributeError, ValueError, TypeError, IndexError, OverflowError) as error:
        reason = MISSING.get(type(error), "{}").format(one_line(error))
        raise HippodromeError(f"{net_file}: not a consistent SUMO network ({reason}); write it again with netconvert") from error
    for fault in _faults(net):
        raise HippodromeError(f"{net_file}: not a consistent SUMO network ({fault}); mend it in netedit, or write it again")
    return net


def check_places_to_wait(net: SumoNet, net_file: Path) -> None:
    """Raises HippodromeError where a junction inside of a junction lacks: SUMO reads such a network, and crashes when a car
    comes there. To lay a drive on the roads it does no harm."""
    for name in net.lost_places_to_wait:
        raise HippodromeError(
            f"{net_file}: junction {name!r}, where cars wait inside a crossing, is not described; write the network again: "
            f"netconvert -s {net_file.name} -o NEW.net.xml"
        )


def is_left_hand(net_file: Path) -> bool:
    """Driving side, from the ``<net lefthand=...>`` attribute, which sumolib does not keep; read as SUMO reads booleans."""
    _, attributes = root_of(net_file)
    return attributes.get("lefthand", "").lower() in SUMO_TRUE


class _NetReader(sumolib.net.NetReader):  # type: ignore[misc]  # sumolib has no types
    """sumolib's reader, made as patient as SUMO's: ``offset="begin"`` of traffic lights, whose offsets we do not use, and a
    root without a version. It also keeps where cars wait inside junctions, which sumolib leaves out."""

    def __init__(self, **options: bool) -> None:
        super().__init__(**options)
        self.places_to_wait: set[str] = set()  # junctions inside of junctions
        self.lanes_after_waiting: set[str] = set()  # each begins at such a junction of its own name

    def startElement(self, name: str, attrs: Any) -> None:
        if name == "junction" and attrs.get("type") == "internal":
            self.places_to_wait.add(attrs["id"])
        elif name == "connection" and attrs["from"].startswith(":") and attrs.get("via"):
            self.lanes_after_waiting.add(attrs["via"])
        if name == "tlLogic" and attrs.get("offset", "begin") == "begin":
            attrs = {**dict(attrs.items()), "offset": "0"}
        if name == "net" and attrs.get("version") is None:
            attrs = {**dict(attrs.items()), "version": OLDEST_VERSION}
        super().startElement(name, attrs)


class _Bounded:
    """A stream that ends in an error before it fills the memory."""

    def __init__(self, stream: IO[Any], net_file: Path) -> None:
        self._stream, self._net_file, self._count = stream, net_file, 0

    def read(self, size: int = -1) -> Any:
        """The next bytes, at most ``size``. Raises HippodromeError where they are too many in all."""
        piece = self._stream.read(size)
        self._count += len(piece)
        if self._count > MAX_NET_BYTES:
            raise HippodromeError(
                f"{self._net_file}: more than {MAX_NET_BYTES >> 20} MiB unpacked; cut out a smaller area "
                f"(netconvert --keep-edges.in-boundary)"
            )
        return piece

    def close(self) -> None:
        """Closes the stream."""
        self._stream.close()


def _faults(net: SumoNet) -> Iterator[str]:
    """What nobody can drive on, as phrases: places that are not described, and numbers that cannot be."""
    for node in net.getNodes():
        place = node.getCoord3D()
        if place is None:
            yield f"edges meet at junction {node.getID()!r}, which the file does not describe"
        elif not all(abs(value) < FARTHEST_M for value in place[:2]):
            yield f"junction {node.getID()!r} lies at {_numbers(place[:2])} m"
        elif not all(abs(value) < FARTHEST_M for point in node.getShape() or () for value in point):
            yield f"the outline of junction {node.getID()!r} goes farther than {FARTHEST_M:.0e} m"
    for edge in net.getEdges():
        if edge.getFunction() in ("", "connector") and (edge.getFromNode() is None or edge.getToNode() is None):
            yield f"edge {edge.getID()!r} does not say between which junctions it lies"
        for lane in edge.getLanes():
            yield from _lane_faults(lane)


def _lane_faults(lane: SumoLane) -> Iterator[str]:
    name, shape = lane.getID(), lane.getShape()
    if lane.allows("passenger") and not 0.0 < lane.getSpeed() <= FASTEST_MPS:
        yield f"lane {name!r} has a speed limit of {lane.getSpeed():g} m/s"
    if not 0.0 < lane.getWidth() <= WIDEST_M:
        yield f"lane {name!r} has a width of {lane.getWidth():g} m"
    if not 0.0 <= lane.getLength() < FARTHEST_M:
        yield f"lane {name!r} has a length of {lane.getLength():g} m"
    if not all(-FARTHEST_M < value < FARTHEST_M for point in shape for value in point):  # what is no number is not, either
        yield f"lane {name!r} has a shape that goes farther than {FARTHEST_M:.0e} m or nowhere"


def _numbers(values: Any) -> str:
    return "(" + ", ".join(f"{value:g}" for value in values) + ")"


def _reject_foreign(net_file: Path) -> None:
    if not net_file.is_file():
        raise HippodromeError(f"{net_file}: no such network file; give a SUMO .net.xml or .net.xml.gz")
    tag, _ = root_of(net_file)
    if tag == "net":
        return
    if tag in ("osm", "OpenDRIVE"):
        kind = ".osm" if tag == "osm" else ".xodr"
        raise HippodromeError(f"{net_file}: not a SUMO network but a map to convert; name it {kind} and netconvert is run")
    raise HippodromeError(f"{net_file}: not a SUMO network (no <net> element); give a .net.xml or .net.xml.gz")
