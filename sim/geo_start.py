"""A start that is known as a place on Earth."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class GeoStart:
    """Where a drive began, in WGS84 degrees."""

    lat_deg: float
    lon_deg: float
    compass_deg: float | None = None  # clockwise from north; None: unknown
