"""A circle cut out of a large map, with netconvert."""

from __future__ import annotations

import gzip
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from hippodrome._files import replacing
from hippodrome._folders import temporary_folder
from hippodrome.core.types import FloatArray, HippodromeError
from hippodrome.sim.georeference import GeoReferenceError, read_georeference
from hippodrome.sim.sumo_tools import PACKED, run_tool, without_comma

CORNERS: Final = 32  # of the polygon that stands for the circle
PLANE: Final = "xy:"  # begins a middle in the network's own metres
FARTHEST_M: Final = 1e8  # as ``sim.net_file`` has it


@dataclass(frozen=True, slots=True)
class Around:
    """A circle on Earth, or in a network's own metres."""

    first: float  # latitude [deg], or x [m]
    second: float  # longitude [deg], or y [m]
    radius_m: float
    on_earth: bool

    def __str__(self) -> str:
        middle = f"{self.first:g},{self.second:g}"
        return f"{self.radius_m:g} m around {middle if self.on_earth else f'({middle}) m'}"


def parse_around(middle: str, radius_m: float) -> Around:
    """A circle from ``LAT,LON`` or ``xy:X,Y``. Raises HippodromeError where it is none."""
    on_earth = not middle.startswith(PLANE)
    try:
        first, second = (float(word) for word in middle.removeprefix(PLANE).split(","))
    except ValueError:
        raise HippodromeError(f"--around {middle}: not two numbers; give LAT,LON in degrees, or xy:X,Y in metres") from None
    limits = (90.0, 180.0) if on_earth else (FARTHEST_M, FARTHEST_M)
    if not (abs(first) <= limits[0] and abs(second) <= limits[1]):
        raise HippodromeError(f"--around {middle}: no such place; give LAT,LON in degrees, or xy:X,Y in metres")
    if not 0.0 < radius_m < FARTHEST_M:
        raise HippodromeError(f"--radius {radius_m:g}: must be above 0 m and on Earth; 1000 gives a district")
    return Around(first, second, radius_m, on_earth)


def import_options(around: Around) -> tuple[str, ...]:
    """netconvert's options that keep the circle of a map that it imports. Raises HippodromeError for one in metres."""
    if not around.on_earth:
        raise HippodromeError(f"--around {PLANE}X,Y: this map has no metres before it is imported; give LAT,LON")
    from pyproj import Geod

    angle = _angles()
    lon, lat, _ = Geod(ellps="WGS84").fwd(
        np.full(CORNERS, around.second), np.full(CORNERS, around.first), np.degrees(angle), np.full(CORNERS, around.radius_m)
    )
    return (f"--keep-edges.in-geo-boundary={_numbers(np.column_stack([lon, lat]), digits=7)}",)


def cut_network(source: Path, net_file: Path, around: Around) -> None:
    """Write the circle of a SUMO network as ``net_file`` (.net.xml.gz), in the same metres; the same bytes each time.

    Raises:
        HippodromeError: The circle holds no road, the network has no projection for a place on Earth, or netconvert fails.
    """
    angle = _angles()
    middle = _middle_m(source, around)
    corners = middle + around.radius_m * np.stack([np.sin(angle), np.cos(angle)], axis=1)
    with temporary_folder() as folder, without_comma(source) as named:
        made = folder / "made.net.xml"
        size = source.stat().st_size
        try:
            run_tool(
                "netconvert", f"--sumo-net-file={named}", f"--output-file={made}", "--offset.disable-normalization=true",
                f"--keep-edges.in-boundary={_numbers(corners, digits=2)}", "--remove-edges.isolated=true", "--no-warnings=true",
                input_bytes=PACKED * size if source.suffix == ".gz" else size,
            )  # fmt: skip
        except HippodromeError as error:
            if "No edges loaded" not in str(error):
                raise HippodromeError(f"{source}: cannot be cut: {error}") from error
        text = made.read_text(encoding="utf-8") if made.is_file() else ""
        if "<edge " not in text:
            raise HippodromeError(f"{source}: holds no road within {around}; raise --radius, or move --around")
        before, _, rest = text.partition("<!--")  # netconvert's heading, which holds the date
        with replacing(net_file) as temporary:
            temporary.write_bytes(gzip.compress((before + rest.partition("-->")[2].lstrip() if rest else text).encode(), mtime=0))


def _middle_m(source: Path, around: Around) -> FloatArray:
    """The circle's middle (2,) in the network's metres."""
    if not around.on_earth:
        return np.array([around.first, around.second])
    try:
        found: FloatArray = read_georeference(source).to_network(np.array([around.first]), np.array([around.second]))[0]
    except GeoReferenceError as error:
        raise HippodromeError(f"{error}; or say the place in its metres: --around {PLANE}X,Y") from error
    return found


def _angles() -> FloatArray:
    return np.linspace(0.0, 2.0 * math.pi, CORNERS, endpoint=False)


def _numbers(corners: FloatArray, digits: int) -> str:
    return ",".join(f"{value:.{digits}f}" for value in corners.ravel())
