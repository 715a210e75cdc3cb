"""Where on Earth a road network lies: between its metres, and latitude and longitude (WGS84)."""

from __future__ import annotations

import gzip
import math
import zlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from hippodrome._files import open_regular, why_unreadable
from hippodrome.core.types import FloatArray, HippodromeError, StartPose
from hippodrome.sim.geo_start import GeoStart

if TYPE_CHECKING:
    from pyproj import Transformer

NO_PROJECTION = ("", "!", "-", ".", "0")  # what SUMO writes where there is none, or one that it keeps to itself
MAX_HEAD_BYTES = 4 << 20  # <location> is the first element of a network; comments may stand before it
GPS_SIGMA_M = 8.0  # a fix of a phone between houses, and the error of a map beside it
UNKNOWN_SIGMA_RAD = 10.0  # all headings are as likely: the opposite one costs 0.05 nats
REAL_MAP_SIGMA_M = 2.5  # standard deviation in each axis of a map of real roads: OpenStreetMap is off by 2-6 m (Haklay 2010)
STEP_M = 1.0  # how far one goes into a compass direction to see where it points in the network


class GeoReferenceError(HippodromeError):
    """A network that does not say where it lies, or a place that its projection does not know."""


@dataclass(frozen=True, slots=True)
class GeoReference:
    """The projection of a network: its x and y are the projection's, plus an offset."""

    projection: str  # in the words of PROJ
    offset_m: tuple[float, float]  # SUMO's netOffset
    network: str  # how errors name the network

    def to_network(self, lat_deg: FloatArray, lon_deg: FloatArray) -> FloatArray:
        """Positions (N, 2) in the network's metres, of latitudes (N,) and longitudes (N,).

        Raises GeoReferenceError if a place lies where the projection is not defined.
        """
        x_m, y_m = _transformer(self.projection, self.network).transform(np.asarray(lon_deg, float), np.asarray(lat_deg, float))
        found = np.column_stack([np.atleast_1d(x_m), np.atleast_1d(y_m)]) + self.offset_m
        self._require_finite(found, "latitude and longitude")
        return found

    def to_lat_lon(self, positions_m: FloatArray) -> FloatArray:
        """Latitude and longitude (N, 2) in degrees, of positions (N, 2) in the network's metres.

        Raises GeoReferenceError if a position lies where the projection is not defined.
        """
        there = np.asarray(positions_m, float)[:, :2] - self.offset_m
        lon, lat = _transformer(self.projection, self.network).transform(there[:, 0], there[:, 1], direction="INVERSE")
        found = np.column_stack([np.atleast_1d(lat), np.atleast_1d(lon)])
        self._require_finite(found, "position")
        return found

    def heading_rad(self, lat_deg: float, lon_deg: float, compass_deg: float) -> float:
        """Heading in the network, radians counter-clockwise from its x axis, of a compass direction (degrees).

        A compass counts clockwise from north. North on Earth and "up" in the network differ by the projection's convergence,
        which is taken into account.
        """
        from pyproj import Geod

        lon, lat, _ = Geod(ellps="WGS84").fwd(lon_deg, lat_deg, compass_deg, STEP_M)
        here, there = self.to_network(np.array([lat_deg, lat]), np.array([lon_deg, lon]))
        return math.atan2(there[1] - here[1], there[0] - here[0])

    def _require_finite(self, found: FloatArray, what: str) -> None:
        if not np.isfinite(found).all():
            bad = int(np.flatnonzero(~np.isfinite(found).all(axis=1))[0])
            raise GeoReferenceError(f"{self.network}: {what} {bad} lies outside of the projection '{self.projection}'")


def read_georeference(net_file: Path) -> GeoReference:
    """The geo-reference of a SUMO network (.net.xml, .net.xml.gz).

    Raises:
        GeoReferenceError: The file cannot be read, or does not say where the network lies.
    """
    attributes = _location(net_file)
    projection = attributes.get("projParameter", "").strip()
    if projection in NO_PROJECTION:
        raise GeoReferenceError(
            f"{net_file}: the network has no projection (projParameter='{projection}'), so nobody knows where on Earth it lies; "
            "give a network that was converted from OpenStreetMap, or places in its own metres"
        )
    try:
        x_m, y_m = (float(word) for word in attributes.get("netOffset", "0,0").split(","))
    except ValueError:
        raise GeoReferenceError(f"{net_file}: <location>: netOffset '{attributes['netOffset']}' is not two numbers") from None
    reference = GeoReference(projection, (x_m, y_m), net_file.name)
    _transformer(projection, net_file.name)
    return reference


def is_georeferenced(net_file: Path) -> bool:
    """Whether a SUMO network says where on Earth it lies, as maps of real roads do."""
    try:
        return _location(net_file).get("projParameter", "").strip() not in NO_PROJECTION
    except GeoReferenceError:
        return False


def placed_start(start: StartPose | GeoStart | None, network: Path, mode: str = "route") -> StartPose | None:
    """The start in the network's frame, whichever way it was given; None stays None.

    Args:
        start: The start as the user gave it.
        network: The SUMO network that says where on Earth it lies; it is opened only for a start that is a place on Earth.
        mode: Mode of the refinement; "paper" needs a heading.

    Raises:
        GeoReferenceError: The network has no projection, or a heading is missing that is needed.
    """
    if not isinstance(start, GeoStart):
        return start
    if start.compass_deg is None and mode == "paper":
        raise GeoReferenceError("mode 'paper' begins with a known heading: give --start geo:LAT,LON,HEADING, or use --mode route")
    reference = read_georeference(network)
    x_m, y_m = reference.to_network(np.array([start.lat_deg]), np.array([start.lon_deg]))[0]
    if start.compass_deg is None:
        return StartPose(float(x_m), float(y_m), 0.0, sigma_m=GPS_SIGMA_M, sigma_rad=UNKNOWN_SIGMA_RAD)
    heading_rad = reference.heading_rad(start.lat_deg, start.lon_deg, start.compass_deg)
    return StartPose(float(x_m), float(y_m), heading_rad, sigma_m=GPS_SIGMA_M)


def _location(net_file: Path) -> dict[str, str]:
    parser: Any = ElementTree.XMLPullParser(["start"])
    try:
        with open_regular(net_file) as raw:
            packed = raw.read(2) == b"\x1f\x8b"
        with gzip.open(net_file) if packed else net_file.open("rb") as stream:
            for _ in range(MAX_HEAD_BYTES >> 16):
                if not (piece := stream.read(1 << 16)):
                    break
                if b"<!ENTITY" in piece:
                    raise GeoReferenceError(f"{net_file}: declares entities, which no network needs; remove them")
                parser.feed(piece)
                for event in parser.read_events():
                    element = event[1]
                    if element.tag == "location":
                        return {str(name): str(value) for name, value in element.attrib.items()}
    except (OSError, EOFError, zlib.error) as error:
        raise GeoReferenceError(f"{net_file}: cannot be read: {why_unreadable(error)}") from None
    except ElementTree.ParseError as error:
        raise GeoReferenceError(f"{net_file}: not a SUMO network: {error}") from None
    raise GeoReferenceError(f"{net_file}: not a SUMO network (no <location> in it)")


@lru_cache(maxsize=8)
def _transformer(projection: str, network: str) -> Transformer:
    from pyproj import CRS, Transformer
    from pyproj.exceptions import CRSError, ProjError

    try:
        made: Any = Transformer.from_crs(CRS.from_epsg(4326), CRS.from_user_input(projection), always_xy=True)
    except (CRSError, ProjError) as error:
        raise GeoReferenceError(f"{network}: projection '{projection}' is unknown: {str(error)[:80]}") from None
    found: Transformer = made
    return found
