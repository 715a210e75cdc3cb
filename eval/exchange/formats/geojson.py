"""GeoJSON (RFC 7946): trajectories as lines, maps as lines by what vouches for them and as points, for any web map and GIS."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hippodrome.eval.exchange.drives.exported import ExportedDrive
from hippodrome.eval.exchange.drives.on_earth import Place, placed_drive

CONVENTIONS = (
    "longitude, latitude in WGS84 degrees, rounded to 1e-9 (0.1 mm); positions are the rear axle's",
    "a trajectory is a LineString; t_s has the seconds of its places from the drive's start, coordTimes the dates where known",
    "a map is a LineString for each stretch of one status and a Point for each vertex: status (matched, or why no road vouches "
    "for it), lane, sigma_m",
    "what has no metric frame (semi-metric maps, dead reckoning) is left out",
)


def write(drives: Sequence[ExportedDrive], folder: Path) -> None:
    """Write one file for each drive. Raises HippodromeError if one of them is nowhere on Earth."""
    for drive in drives:
        _write(placed_drive(drive), folder / f"{drive.name}.geojson")


def write_one(place: Place, folder: Path) -> None:
    """Write one map or trajectory."""
    _write([place], folder / f"{place.name}.geojson")


def _write(places: Sequence[Place], path: Path) -> None:
    features = [feature for place in places for feature in (*_lines(place), *_points(place))]
    content = {"type": "FeatureCollection", "features": features}
    path.write_text(json.dumps(content, separators=(",", ":"), allow_nan=False) + "\n", encoding="utf-8")


def _lines(place: Place) -> list[dict[str, Any]]:
    times, at = place.times(), _coordinates(place)
    found = []
    for status, part in place.stretches():
        if part.stop - part.start < 2:
            continue  # a line has two ends; the vertex is among the points
        about: dict[str, Any] = {"name": place.name, "t_s": [float(t) for t in place.t_s[part]]}
        if status:
            about["status"] = status
        if times is not None:
            about["coordTimes"] = times[part]
        found.append(_feature("LineString", at[part], about))
    return found


def _points(place: Place) -> list[dict[str, Any]]:
    if place.status is None:
        return []
    at = _coordinates(place)
    found = []
    for i, status in enumerate(place.status):
        about: dict[str, Any] = {"name": place.name, "vertex": i, "t_s": float(place.t_s[i]), "status": status}
        if place.lane is not None and place.lane[i]:
            about["lane"] = place.lane[i]
        if place.sigma_m is not None and np.isfinite(place.sigma_m[i]):
            about["sigma_m"] = round(float(place.sigma_m[i]), 3)
        found.append(_feature("Point", at[i], about))
    return found


def _coordinates(place: Place) -> list[list[float]]:
    return [[round(float(lon), 9), round(float(lat), 9)] for lat, lon in place.lat_lon_deg]


def _feature(kind: str, at: Any, about: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "properties": about, "geometry": {"type": kind, "coordinates": at}}
