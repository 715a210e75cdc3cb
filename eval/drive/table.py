"""The table of a run, within 80 columns."""

from __future__ import annotations

from typing import Any, Final

from hippodrome._output import harmless
from hippodrome.eval.results.model import Results, drive_of

COLUMNS: Final = (  # heading, key, format, factor
    ("goal %", "success_rate", ".0f", 100.0),
    ("SPL", "spl", ".2f", 1.0),
    ("score", "driving_score", ".0f", 1.0),
    ("crash", "collisions_at_fault", "d", 1),
    ("wrong", "wrong_way", "d", 1),
    ("false", "false_arrivals", "d", 1),
    ("red", "red_lights", "d", 1),
    ("out %", "outside_lane_share", ".1f", 100.0),
    ("time x", "time_ratio", ".2f", 1.0),
    ("fix m", "metres_until_localized", ".0f", 1.0),
)
NAME: Final = 18  # columns of the first one; the longest row's key has 14 letters


def cells(drive: dict[str, Any]) -> list[str]:
    """The figures of a row as text; a dash where there is none."""
    return ["-" if drive.get(key) is None else format(factor * drive[key], how) for _, key, how, factor in COLUMNS]


def table_lines(results: Results) -> list[str]:
    """The table, line by line: the scenarios, and below each its rows."""
    lines = [f"{'':{NAME}}" + "".join(f"{heading:>6.6}" for heading, *_ in COLUMNS)]
    for result in results.scenarios:
        lines.append(harmless(f"{result.name} (seed {result.seed}, noise {result.noise})")[:80])
        for row in result.rows:
            drive = drive_of(row) or {}
            name = harmless(str(drive.get("row", row.method)))[: NAME - 3]
            lines.append(f"  {name:{NAME - 2}}" + "".join(f"{cell:>6}" for cell in cells(drive)))
    return lines


def print_table(results: Results) -> None:
    """Print the table, and below it each mission that failed, with its cause."""
    print("\n".join(table_lines(results)))
    for result in results.scenarios:
        for row in result.rows:
            for one in (drive_of(row) or {}).get("missions_detail", ()):
                if not one["success"]:
                    print(
                        harmless(
                            f"failed: {result.name}, {row.method}, mission {one['number']}: {one['cause']}; ended {one['end']}"
                        )
                    )
