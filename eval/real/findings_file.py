"""Where a map seems wrong, as GeoJSON: for a map editor, in latitude and longitude wherever the network knows them."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from hippodrome._files import write_atomically
from hippodrome.core.types import FloatArray, Refinement
from hippodrome.eval.methods.beforehand import Beforehand
from hippodrome.eval.methods.stages import network_file, read_roads
from hippodrome.eval.real.findings import Finding, find_wrong_roads, middle_m
from hippodrome.sim.georeference import GeoReference, is_georeferenced, read_georeference

IN_DEGREES = "longitude, latitude in WGS84 degrees; each line is where the road was driven, not where it is drawn"
IN_METRES = (
    "x east, y north in the metres of the road network {name}, which does not say where on Earth it lies: no web map shows them "
    "in place; each line is where the road was driven, not where it is drawn"
)


def reference_of(net_file: Path) -> GeoReference | None:
    """Where on Earth a SUMO network lies; None if it does not say. Raises GeoReferenceError if it cannot be read."""
    return read_georeference(net_file) if is_georeferenced(net_file) else None


def tell_findings(refinement: Refinement, network: Path, folder: Path, known: Beforehand, path: Path) -> tuple[Finding, ...]:
    """Where the map seems wrong, written as GeoJSON; how many places these are is printed.

    Args:
        refinement: What ``refine_files`` returned.
        network: The network that it was given.
        folder: Where a network that was converted for it is kept.
        known: What it was told of the network.
        path: The file of the findings.

    Raises:
        HippodromeError: The network cannot be read, or the file cannot be written.
    """
    with redirect_stdout(io.StringIO()):  # the refinement has said all that there is to say of the network
        net_file = network_file(network, folder)
        roads = read_roads(net_file, folder)
    told_m = known.network_accuracy_m
    found = find_wrong_roads(refinement, roads, roads.survey_sigma_m if told_m is None else told_m)
    write_findings(path, found, net_file)
    print(f"{path}: {len(found)} place(s) where the map seems wrong")
    for one in found:
        print(f"vertices {one.first_vertex}-{one.last_vertex}: {one.words()}")
    return found


def write_findings(path: Path, findings: Sequence[Finding], net_file: Path) -> None:
    """Write the findings, in degrees where the network has a projection, else in its metres.

    Raises:
        HippodromeError: The network cannot be read, or the file cannot be written.
    """
    reference = reference_of(net_file)
    content = {
        "type": "FeatureCollection",
        "coordinates": IN_DEGREES if reference is not None else IN_METRES.format(name=net_file.name),
        "features": [_feature(one, reference) for one in findings],
    }
    write_atomically(path, (json.dumps(content, indent=1, allow_nan=False) + "\n").encode())


def place_words(finding: Finding, reference: GeoReference | None) -> str:
    """The middle of a finding as words that can be typed into a map's search."""
    if reference is None:
        x_m, y_m = middle_m(finding)
        return f"x {x_m:.0f} m, y {y_m:.0f} m"
    lat_deg, lon_deg = reference.to_lat_lon(np.array([middle_m(finding)]))[0]
    return f"{lat_deg:.6f}, {lon_deg:.6f}"


def _feature(finding: Finding, reference: GeoReference | None) -> dict[str, Any]:
    about: dict[str, Any] = {
        "kind": finding.kind,
        "description": finding.words(),
        "length_m": finding.length_m,
        "first_vertex": finding.first_vertex,
        "last_vertex": finding.last_vertex,
    }
    if finding.offset_m is not None:
        east_m, north_m = finding.offset_m
        about |= {"offset_east_m": east_m, "offset_north_m": north_m, "sigma_m": finding.sigma_m, "passes": finding.passes}
    line = {"type": "LineString", "coordinates": _coordinates(np.array(finding.points_m), reference)}
    return {"type": "Feature", "properties": about, "geometry": line}


def _coordinates(points_m: FloatArray, reference: GeoReference | None) -> list[list[float]]:
    if reference is None:
        return [[float(x), float(y)] for x, y in points_m]
    return [[round(float(lon), 8), round(float(lat), 8)] for lat, lon in reference.to_lat_lon(points_m)]
