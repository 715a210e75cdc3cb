"""Rows of missions in tables: their columns, and what stands in each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final


@dataclass(frozen=True, slots=True)
class DriveColumn:
    """A column: its heading, the figure of ``drive`` that it shows, and how."""

    title: str
    key: str
    how: str  # a format of Python
    factor: float = 1.0

    def cell(self, drive: Mapping[str, Any]) -> str:
        """The figure as text; a dash where there is none."""
        value = drive.get(self.key)
        return "-" if value is None else format(value if self.how == "d" else self.factor * value, self.how)


DRIVE_COLUMNS: Final = (
    DriveColumn("goal (%)", "success_rate", ".0f", 100.0),
    DriveColumn("on mapped streets (%)", "success_rate_mapped", ".0f", 100.0),
    DriveColumn("on unmapped (%)", "success_rate_unmapped", ".0f", 100.0),
    DriveColumn("SPL", "spl", ".2f"),
    DriveColumn("driving score", "driving_score", ".0f"),
    DriveColumn("collisions at fault", "collisions_at_fault", "d"),
    DriveColumn("wrong way", "wrong_way", "d"),
    DriveColumn("false arrivals", "false_arrivals", "d"),
    DriveColumn("red lights", "red_lights", "d"),
    DriveColumn("rights of way", "rights_of_way", "d"),
    DriveColumn("outside the lane (%)", "outside_lane_share", ".1f", 100.0),
    DriveColumn("lane rms (m)", "lane_rms_m", ".2f"),
    DriveColumn("time ratio", "time_ratio", ".2f"),
    DriveColumn("until localized (m)", "metres_until_localized", ".0f"),
    DriveColumn("driven (km)", "driven_km", ".2f"),
)


def drive_cells(drive: Mapping[str, Any]) -> list[str]:
    """The cells below ``DRIVE_COLUMNS``."""
    return [column.cell(drive) for column in DRIVE_COLUMNS]


def per_km(drive: Mapping[str, Any]) -> str:
    """The events per driven kilometre, in words: "wrong way 0.8, kerb 1.7"."""
    events: Mapping[str, float] = drive.get("per_km") or {}
    return ", ".join(f"{kind} {count:.2g}" for kind, count in events.items()) or "none"
