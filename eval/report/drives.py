"""Missions in the report: a table of the rows that drove, what each figure means, and the way to the page of the drives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from hippodrome.eval.report.markup import Html, element, joined
from hippodrome.eval.report.tables import plain_table
from hippodrome.eval.results.drives import DRIVE_COLUMNS, drive_cells, per_km
from hippodrome.eval.results.model import Results, ScenarioResult, drive_of

DRIVE_PAGE: Final = "drive.html"  # of ``hippodrome drive``, beside the report
TITLE: Final = "Missions: driven to goals on the own map"


def without_missions(scenario: ScenarioResult) -> ScenarioResult:
    """The scenario with its rows of maps and localization alone."""
    return scenario.model_copy(update={"rows": tuple(row for row in scenario.rows if drive_of(row) is None)})


def missions_of(scenario: ScenarioResult) -> list[tuple[str, dict[str, Any]]]:
    """The rows of missions: their names and figures."""
    return [(row.method, drive) for row in scenario.rows if (drive := drive_of(row)) is not None]


def mission_table(scenario: ScenarioResult) -> Html | None:
    """The scenario's rows that drove, and the missions that failed, with their causes; None if nobody drove."""
    rows = missions_of(scenario)
    if not rows:
        return None
    heads = ["Row", "Missions", *(column.title for column in DRIVE_COLUMNS), "events per km"]
    cells = [[name, str(drive["missions"]), *drive_cells(drive), per_km(drive)] for name, drive in rows]
    failed = [
        element("li", f"{name}, mission {one['number']}: {one['cause']}; ended {one['end']}")
        for name, drive in rows
        for one in drive.get("missions_detail", ())
        if not one["success"]
    ]
    return joined(
        plain_table(heads, cells, f"{scenario.name}: missions"),
        element("ul", failed, class_="failures") if failed else None,
        definitions(rows[0][1]),
    )


def mission_overview(results: Results) -> Html | None:
    """All rows of all towns that drove; None if nobody did."""
    rows = [
        [scenario.name, name, str(drive["missions"]), *drive_cells(drive), per_km(drive)]
        for scenario in results.scenarios
        for name, drive in missions_of(scenario)
    ]
    heads = ["Scenario", "Row", "Missions", *(column.title for column in DRIVE_COLUMNS), "events per km"]
    return plain_table(heads, rows, "missions of all scenarios") if rows else None


def _plain(key: str) -> str:
    """The name of a figure that has no column, with its unit as heads have it."""
    words = key.replace("_", " ")
    return f"{words.removesuffix(' m')} (m)" if words.endswith(" m") else words


def definitions(drive: dict[str, Any]) -> Html:
    """What each figure means, folded."""
    named = {column.key: column.title for column in DRIVE_COLUMNS}
    lines: Sequence[Html] = [
        element("li", element("strong", named.get(key, _plain(key))), f": {text}")
        for key, text in drive.get("definitions", {}).items()
    ]
    return element(
        "details", element("summary", "What each figure of missions means"), element("ul", lines, class_="definitions")
    )
