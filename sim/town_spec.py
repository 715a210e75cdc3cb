"""Which town to build, in numbers. ``sim/town.py`` builds it, and loads what that takes."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from hippodrome.sim.driving_side import Choice
from hippodrome.sim.spec import Spec


class TownSpec(Spec):
    """Which town to build. The defaults are CARLA Town07 as SUMO sees it: 4.39 km of directed roads in 287 m by 370 m."""

    kind: Literal["rural", "grid", "radial", "random"] = "rural"
    width_m: float = Field(287.0, ge=100.0, le=20_000.0)
    height_m: float = Field(370.0, ge=100.0, le=20_000.0)
    road_km: float = Field(4.39, ge=0.8, le=500.0)  # directed: a two-way street counts twice
    lanes: int = Field(1, ge=1, le=2)  # per direction
    speed_limit_mps: float = Field(8.33, ge=3.0, le=40.0)
    driving_side: Choice = "auto"  # auto: as the network or map says, and right where none does
    network: Path | None = None  # a .net.xml, .net.xml.gz, .osm or .xodr (also .gz); overrides kind, sizes, lanes and limit
