"""What a user knows about a drive and a road network before the drive is laid on it, and what follows for the refinement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

from hippodrome.core.refinement.config import RefineConfig
from hippodrome.core.types import HippodromeError

UNITS: Final = "metres_per_unit"  # name in a recording's manifest and a map's provenance


@dataclass(frozen=True, slots=True)
class Beforehand:
    """What is known; None: it is not."""

    metres_per_unit: float | None = None  # length of the odometry's unit
    network_accuracy_m: float | None = None  # standard deviation in each axis of where the roads are drawn; 0: they are exact


def informed(config: RefineConfig, known: Beforehand, provenance: Mapping[str, str]) -> tuple[RefineConfig, list[str]]:
    """The settings of a refinement that is told what is known, and lines that say what was taken from the map itself.

    Args:
        config: The settings; mode ``paper`` has no place for such knowledge.
        known: What the user says now.
        provenance: Of the semi-metric map: the unit of its odometry, if it was said when the drive was imported.

    Raises:
        HippodromeError: Mode ``paper`` was told something, or the map's record of its unit is no number.
    """
    if config.mode == "paper":
        if known != Beforehand():
            raise HippodromeError("mode 'paper' takes neither --units nor --network-accuracy; leave them out or use --mode route")
        return config, []
    route, lines = config.route, []
    metres = known.metres_per_unit
    if metres is None and (recorded := provenance.get(UNITS)) is not None:
        metres = _number(recorded)
        lines.append(f"unit of the odometry: {metres:g} m, as was said when the drive was imported")
    if metres is not None:
        route = replace(route, search=replace(route.search, metres_per_unit=metres))
    if known.network_accuracy_m is not None:
        route = replace(route, solver=replace(route.solver, survey_sigma_m=known.network_accuracy_m))
    return replace(config, route=route), lines


def _number(recorded: str) -> float:
    try:
        value = float(recorded)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise HippodromeError(f"cognitive map: its unit of odometry is recorded as '{recorded}' m, which is none; give --units")
    return value
