"""GPX 1.1: tracks in latitude and longitude, for web maps, navigation devices and OpenStreetMap editors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from hippodrome.eval.exchange.drives.exported import ExportedDrive
from hippodrome.eval.exchange.drives.on_earth import VOUCHED, Place, placed_drive

CONVENTIONS = (
    "WGS84 degrees, printed to 1e-9 (0.1 mm); positions are the rear axle's; elevation is left out",
    "one track for each trajectory and map; a map's track has a segment for each stretch that roads vouch for, and a track of "
    "its own for those that none vouches for",
    "times only where the drive's clock counts from 1970; what has no metric frame (semi-metric, dead reckoning) is left out",
)
NAMESPACE = "http://www.topografix.com/GPX/1/1"


def write(drives: Sequence[ExportedDrive], folder: Path) -> None:
    """Write one file for each drive. Raises HippodromeError if one of them is nowhere on Earth."""
    for drive in drives:
        _write(placed_drive(drive), folder / f"{drive.name}.gpx")


def write_one(place: Place, folder: Path) -> None:
    """Write one map or trajectory."""
    _write([place], folder / f"{place.name}.gpx")


def _write(places: Sequence[Place], path: Path) -> None:
    root = ElementTree.Element("gpx", {"xmlns": NAMESPACE, "version": "1.1", "creator": "hippodrome"})
    for place in places:
        stretches = place.stretches()
        _track(root, place, place.name, [part for status, part in stretches if status in ("", VOUCHED)])
        _track(root, place, f"{place.name}, not vouched for", [part for status, part in stretches if status not in ("", VOUCHED)])
    ElementTree.indent(root, " ")
    ElementTree.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _track(root: ElementTree.Element, place: Place, name: str, parts: Sequence[slice]) -> None:
    if not parts:
        return
    times = place.times()
    track = ElementTree.SubElement(root, "trk")
    ElementTree.SubElement(track, "name").text = name
    for part in parts:
        segment = ElementTree.SubElement(track, "trkseg")
        for i in range(part.start, part.stop):
            lat, lon = place.lat_lon_deg[i]
            point = ElementTree.SubElement(segment, "trkpt", {"lat": f"{lat:.9f}", "lon": f"{lon:.9f}"})
            if times is not None:
                ElementTree.SubElement(point, "time").text = times[i]
