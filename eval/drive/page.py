"""The page of a run, ``drive.html``: for each town the driven ways on its roads, and the missions with their causes."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from hippodrome._files import write_atomically
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray
from hippodrome.eval.drive.flight import TRACE
from hippodrome.eval.drive.table import COLUMNS, cells
from hippodrome.eval.report.drives import DRIVE_PAGE
from hippodrome.eval.report.markup import Html, element
from hippodrome.eval.results.model import Results, Row, ScenarioResult, drive_of
from hippodrome.sim.record import RecordingPlan

if TYPE_CHECKING:
    from hippodrome.eval.drive.task import MissionTask

COLOURS: Final = ("#1769aa", "#b3432b", "#2e7d4f", "#7a4fa3", "#a8741a", "#0f7c80")  # of missions, in turn
EVERY: Final = 5  # a point of the trace in half a second
MARGIN_M: Final = 15.0
LEGEND: Final = (
    "Ways of the first row, a colour for each mission: from the small dot to the large one, dashed until the vehicle "
    "knew where it was. Point at a way to read its number."
)
STYLE: Final = """
.town { width: 100%; height: auto; max-height: 75vh; display: block; border: 1px solid var(--line); border-radius: 10px; }
.town .road { fill: none; stroke: var(--road); stroke-width: 3; stroke-linecap: round; }
.town .way { fill: none; stroke-width: 1.3; } .town .lost { stroke-dasharray: 3 3; }
.words td { white-space: normal; text-align: left; } .words th { text-align: left; }
"""


def write_page(results: Results, tasks: Sequence[MissionTask], out: Path) -> None:
    """Write the page from the results and the missions' traces."""
    style = files("hippodrome.eval.report").joinpath("style.css").read_text(encoding="utf-8") + STYLE
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("title", "Missions"),
        element("style", Html(style)),
    )
    parts = [_town(result, [task for task in tasks if task.scenario.name == result.name]) for result in results.scenarios]
    body = element("body", element("header", element("h1", "Missions")), _figures(results), *parts)
    write_atomically(out / DRIVE_PAGE, f"<!doctype html>\n{element('html', head, body, lang='en')}\n".encode())


def _figures(results: Results) -> Html:
    heads = [element("th", text) for text in ("town", "row", *(heading for heading, *_ in COLUMNS))]
    rows = [
        element(
            "tr", element("td", result.name), element("td", row.method), *(element("td", text) for text in cells(_drive(row)))
        )
        for result in results.scenarios
        for row in result.rows
    ]
    return element("table", element("thead", element("tr", *heads)), element("tbody", *rows))


def _town(result: ScenarioResult, tasks: Sequence[MissionTask]) -> Html:
    network = RecordingPlan(tasks[0].scenario, "mapping", tasks[0].out).town().network
    first = tasks[0].row.key
    ways = [_way(task, number) for number, task in enumerate(task for task in tasks if task.row.key == first)]
    rows = [_mission(row.method, one) for row in result.rows for one in _drive(row)["missions_detail"]]
    heads = ("row", "mission", "start", "goal", "end", "why", "driven m", "time s", "events")
    table = element(
        "table",
        element("thead", element("tr", *(element("th", text) for text in heads))),
        element("tbody", *rows),
        class_="words",
    )
    return element("section", element("h2", result.name), element("p", LEGEND), _map(network, ways), table)


def _mission(method: str, one: dict[str, Any]) -> Html:
    events = ", ".join(f"{count} x {kind}" for kind, count in one["events"].items())
    texts = (method, one["number"], one["start"], one["goal"], one["end"], one["cause"], f"{one['driven_m']:.0f}",
             f"{one['time_s']:.0f}", events)  # fmt: skip
    return element("tr", *(element("td", str(text)) for text in texts))


def _map(network: RoadNetwork, ways: Sequence[Html]) -> Html:
    low, high = network.points_m.min(axis=0) - MARGIN_M, network.points_m.max(axis=0) + MARGIN_M
    roads = [element("path", d=_path(network.lane_points_m(k)), class_="road") for k in range(network.lane_count)]
    box = f"{low[0]:.1f} {-high[1]:.1f} {high[0] - low[0]:.1f} {high[1] - low[1]:.1f}"
    return element("svg", *roads, *ways, viewBox=box, class_="town", role="img")


def _way(task: MissionTask, number: int) -> Html:
    """The driven way of a mission: dashed while the vehicle did not know where it was."""
    file = task.trace_file()
    if not file.exists():
        return element("g")
    with np.load(file, allow_pickle=False) as data:
        trace = data["trace"].astype(np.float64)[::EVERY]
    points, fixed = trace[:, [TRACE.index("x_m"), TRACE.index("y_m")]], trace[:, TRACE.index("localized")] > 0.0
    since = int(np.argmax(fixed)) if fixed.any() else len(fixed)
    colour = COLOURS[number % len(COLOURS)]
    lines = [element("path", d=_path(part), class_=name, stroke=colour)
             for part, name in ((points[: since + 1], "way lost"), (points[since:], "way")) if len(part) > 1]  # fmt: skip
    dots = [element("circle", cx=f"{x:.1f}", cy=f"{-y:.1f}", r=radius, fill=colour)
            for (x, y), radius in ((points[0], "2"), (points[-1], "4"))]  # fmt: skip
    return element("g", element("title", f"mission {task.mission.number}"), *lines, *dots)


def _path(points_m: FloatArray) -> str:
    return "M" + " L".join(f"{x:.1f},{-y:.1f}" for x, y in points_m)


def _drive(row: Row) -> dict[str, Any]:
    return drive_of(row) or {}
