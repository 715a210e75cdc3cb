"""The page of a run, ``drive.html``: for each town the driven ways on its roads, to be played, and the missions with causes."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from hippodrome._files import write_atomically
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray
from hippodrome.eval.drive.flight import TRACE
from hippodrome.eval.drive.task import MissionTask
from hippodrome.eval.report.drives import DRIVE_PAGE, definitions, mission_overview
from hippodrome.eval.report.markup import Child, Html, element
from hippodrome.eval.report.pages import TABLE_SCRIPTS, page
from hippodrome.eval.report.tables import plain_table
from hippodrome.eval.results.model import Results, ScenarioResult, drive_of
from hippodrome.sim.loop.world import STEP_S
from hippodrome.sim.record import RecordingPlan

COLOURS: Final = ("#1769aa", "#b3432b", "#2e7d4f", "#7a4fa3", "#a8741a", "#0f7c80")  # of missions, in turn
EVERY: Final = 5  # a point of the trace in half a second
MARGIN_M: Final = 15.0
CAR_SHARE: Final = 0.03  # length of the car that plays, as a share of the town's width: one in scale could not be seen
ABOUT: Final = (
    "In each mission a vehicle drives by itself, among traffic, from a hidden start to a goal on the map that it made. Each row "
    "is another driver: ours, ours with its true pose or less to go by, or one of somebody else."
)
LEGEND: Final = (
    "These are the ways that one row drove, with a colour for each mission. A way leads from the small dot to the large one, and "
    "is dashed until the vehicle knew where it was. The arrow is the vehicle; the circle is where it believed to be."
)
STYLE: Final = """
.roads-map { width: 100%; height: auto; max-height: 75vh; display: block; border: 1px solid var(--line); border-radius: 10px; }
.roads-map .road { fill: none; stroke: var(--road); stroke-width: 3; stroke-linecap: round; }
.roads-map .way { fill: none; stroke-width: 1.6; } .roads-map .lost { stroke-dasharray: 3 3; }
.roads-map .one { opacity: .6; } .roads-map .chosen { opacity: 1; }
.roads-map .car { fill: var(--ink); } .roads-map .belief { fill: none; stroke: var(--ink); stroke-width: 1; }
@media (prefers-color-scheme: dark) { .roads-map .ways { filter: brightness(1.7); } }
main > section:first-child { margin-top: 1rem; }
.words { margin-top: 1rem; } .words td { white-space: normal; min-width: 4em; }
.words td:is(:nth-child(4), :nth-child(5), :nth-child(6)) { min-width: 8em; } .words td:nth-child(9) { min-width: 12em; }
.words td, .words thead th { text-align: left; }
.drive-controls { display: flex; flex-wrap: wrap; gap: .5rem 1rem; align-items: center; margin: .5rem 0; }
.drive-controls input { flex: 1 1 12rem; min-width: 0; }
.drive-controls :is(select, button) { max-width: 100%; font: inherit; padding: .2rem .6rem; min-height: 2.1rem; }
.drive-controls select { color: inherit; background: var(--paper); border: 1px solid var(--line); border-radius: 6px; }
"""


def write_page(results: Results, tasks: Sequence[MissionTask], out: Path) -> None:
    """Write the page from the results and the missions' traces."""
    towns = [_town(result, [task for task in tasks if task.scenario.name == result.name]) for result in results.scenarios]
    first = next((drive for one in results.scenarios for row in one.rows if (drive := drive_of(row)) is not None), {})
    figures = element("section", mission_overview(results), definitions(first))
    body = [
        element("header", element("h1", "Missions")),
        element("p", ABOUT, class_="lede"),
        element("main", figures, *towns),
        element("footer", "Made by ", element("code", "hippodrome drive"), ". The same figures lie in results.json."),
    ]
    write_atomically(out / DRIVE_PAGE, page("Missions", body, (*TABLE_SCRIPTS, "drive.js"), style=STYLE).encode())


def _town(result: ScenarioResult, tasks: Sequence[MissionTask]) -> Html:
    network = RecordingPlan(tasks[0].scenario, "mapping", tasks[0].out).town().network
    driven = [(task, trace) for task in tasks if (trace := _trace(task)) is not None]
    played = [_played(task, trace) for task, trace in driven]
    rows = dict.fromkeys(task.row.label for task, _ in driven)
    ways = [
        element(
            "g",
            *(_way(place, task, trace) for place, (task, trace) in enumerate(driven) if task.row.label == row),
            class_="ways",
            data_row=row,
        )
        for row in rows
    ]
    places = {(task.row.label, task.mission.number): place for place, (task, _) in enumerate(driven)}
    missions = [
        _mission(row.method, one, places.get((row.method, one["number"])))
        for row in result.rows
        for one in (drive_of(row) or {}).get("missions_detail", ())
    ]
    heads = (
        "Row and mission",
        "Reached",
        "Why it ended",
        "Start (lane, way along it)",
        "Goal (lane, way along it)",
        "End",
        "Driven (m)",
        "Time (s)",
        "Events",
        "Play",
    )
    failed = [element("li", f"{row.method} failed: {row.failure}") for row in result.rows if row.failure is not None]
    text = json.dumps(played, allow_nan=False).replace("<", "\\u003c")
    return element(
        "section",
        element("h2", result.name),
        element("ul", failed, class_="failures") if failed else None,
        element("p", LEGEND, class_="note"),
        element("script", Html(text), type="application/json"),
        _controls(driven) if driven else None,
        _map(result.name, network, ways),
        element("div", plain_table(heads, missions, f"{result.name}: missions"), class_="words"),
        class_="drives" if driven else None,
        data_town=result.name,
    )


def _controls(driven: Sequence[tuple[MissionTask, FloatArray]]) -> Html:
    """What plays a mission; ``drive.js`` brings it to life."""
    options = [
        element("option", f"{task.row.label}, mission {task.mission.number}", value=place)
        for place, (task, _) in enumerate(driven)
    ]
    return element(
        "div",
        element("label", "Mission ", element("select", options)),
        element("button", "\u25b6 Play", type="button", class_="play"),
        element("input", type="range", min=0, value=0, aria_label="Time of the mission"),
        element("output", ""),
        class_="drive-controls",
    )


def _mission(method: str, one: dict[str, Any], place: int | None) -> list[Child]:
    events = ", ".join(f"{count} x {kind}" for kind, count in one["events"].items()) or "none"
    label = f"{method}, {one['number']}"
    play = element("button", "\u25b6", type="button", class_="show", data_mission=place, aria_label=f"Play {label}")
    reached = element("span", "yes", class_="good") if one["success"] else element("span", "no", class_="bad")
    places = [_whole(one[name]) for name in ("start", "goal", "end")]
    figures = [f"{one['driven_m']:.0f}", f"{one['time_s']:.0f}"]
    return [label, reached, one["cause"], *places, *figures, events, play if place is not None else "-"]


def _whole(place: str) -> str:
    """A place in words, its metres not apart from their unit."""
    return re.sub(r"(?<=\d) m\b", "\N{NO-BREAK SPACE}m", place)


def _map(name: str, network: RoadNetwork, ways: Sequence[Html]) -> Html:
    low, high = network.points_m.min(axis=0) - MARGIN_M, network.points_m.max(axis=0) + MARGIN_M
    roads = [element("path", d=_path(network.lane_points_m(k)), class_="road") for k in range(network.lane_count)]
    box = f"{low[0]:.1f} {-high[1]:.1f} {high[0] - low[0]:.1f} {high[1] - low[1]:.1f}"
    size = CAR_SHARE * float(high[0] - low[0])
    car = element(
        "path", d=f"M{size:.1f},0 L{-0.5 * size:.1f},{0.45 * size:.1f} L{-0.5 * size:.1f},{-0.45 * size:.1f} Z", class_="car"
    )
    belief = element("circle", r=f"{0.6 * size:.1f}", class_="belief")
    label = f"{name}: the roads and the ways driven on them"
    return element("svg", *roads, *ways, belief, car, viewBox=box, class_="roads-map", role="img", aria_label=label)


def _trace(task: MissionTask) -> FloatArray | None:
    """The trace of a mission, a row for each half second; None where there is none."""
    file = task.trace_file()
    if not file.exists():
        return None
    with np.load(file, allow_pickle=False) as data:
        trace: FloatArray = data["trace"].astype(np.float64)[::EVERY]
    return trace


def _played(task: MissionTask, trace: FloatArray) -> dict[str, Any]:
    """What the player needs of a mission."""

    def column(name: str, digits: int) -> list[float | None]:
        return [round(value, digits) if np.isfinite(value) else None for value in trace[:, TRACE.index(name)].tolist()]

    return {
        "row": task.row.label, "every_s": EVERY * STEP_S, "x": column("x_m", 1), "y": column("y_m", 1),
        "heading": column("heading_rad", 2), "speed": column("speed_mps", 1), "state": column("state", 0),
        "ex": column("estimate_x_m", 1), "ey": column("estimate_y_m", 1),
    }  # fmt: skip


def _way(place: int, task: MissionTask, trace: FloatArray) -> Html:
    """The driven way of a mission: dashed while the vehicle did not know where it was."""
    points, fixed = trace[:, [TRACE.index("x_m"), TRACE.index("y_m")]], trace[:, TRACE.index("localized")] > 0.0
    since = int(np.argmax(fixed)) if fixed.any() else len(fixed)
    colour = COLOURS[task.mission.number % len(COLOURS)]
    lines = [element("path", d=_path(part), class_=name, stroke=colour)
             for part, name in ((points[: since + 1], "way lost"), (points[since:], "way")) if len(part) > 1]  # fmt: skip
    dots = [element("circle", cx=f"{x:.1f}", cy=f"{-y:.1f}", r=radius, fill=colour)
            for (x, y), radius in ((points[0], "2"), (points[-1], "4"))]  # fmt: skip
    title = element("title", f"{task.row.label}, mission {task.mission.number}")
    return element("g", title, *lines, *dots, class_="one", data_mission=place)


def _path(points_m: FloatArray) -> str:
    return "M" + " L".join(f"{x:.1f},{-y:.1f}" for x, y in points_m)
