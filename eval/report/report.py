"""``report.html``: one file with everything that a reader wants, made from ``results.json`` and the files beside it alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from hippodrome._files import write_atomically
from hippodrome.eval.report.drives import DRIVE_PAGE, TITLE, mission_overview, without_missions
from hippodrome.eval.report.files import ScenarioFiles, read_scenario_files
from hippodrome.eval.report.glance import at_a_glance
from hippodrome.eval.report.markup import Html, element, joined
from hippodrome.eval.report.pages import page
from hippodrome.eval.report.player import towns
from hippodrome.eval.report.remarks import lede, surprises, title
from hippodrome.eval.report.sections import scenario_section
from hippodrome.eval.report.tables import anchor, overview
from hippodrome.eval.results.model import Results, read_results
from hippodrome.eval.results.paper_rows import quoted_rows

REPORT: Final = "report.html"
COMPARE: Final = "compare"  # id of the panel with all scenarios
# While the page is still being read only its first panel is shown; should a script fail, all of them are.
EARLY: Final = 'document.documentElement.className="js";addEventListener("error",()=>{document.documentElement.className=""})'
SCRIPTS: Final = (
    "basics.js",
    "vector.js",
    "save.js",
    "night.js",
    "story.js",
    "mapview.js",
    "map.js",
    "scene.js",
    "chart.js",
    "brain.js",
    "traces.js",
    "player.js",
    "compare.js",
    "tables.js",
    "tabs.js",
)  # each uses those before it


def write_report(out: Path) -> Path:
    """Write ``out/report.html`` from ``out/results.json``; returns its path. The same files give the same bytes.

    Raises:
        ResultsError: A file cannot be read.
    """
    path = out / REPORT
    write_atomically(path, report_html(read_results(out / "results.json"), out).encode())
    return path


def report_html(results: Results, out: Path) -> str:
    """The page. Figures, maps and frames are taken from below ``out`` as far as they exist. Raises ResultsError."""
    quoted = quoted_rows()
    found = [read_scenario_files(out, scenario.name) for scenario in results.scenarios]
    sections = [scenario_section(place, one, quoted, found[place]) for place, one in enumerate(results.scenarios)]
    links = [element("a", "All compared", href=f"#{COMPARE}")]
    links += [element("a", one.name, href=f"#{anchor(place)}") for place, one in enumerate(results.scenarios)]
    body = [
        element("header", element("h1", title(_maps(results))), element("div", element("span", "Towns:", aria_hidden="true"),
                element("nav", links, class_="tabs", aria_label="Towns"), class_="choose-town")),
        element("main", _all_scenarios(results, found, (out / DRIVE_PAGE).exists()), sections),
        element("footer", "Made by ", element("code", _maker(results)), "; ", element("code", "hippodrome report DIR"),
                " makes it again from results.json and the files beside it."),
    ]  # fmt: skip
    return page("hippodrome report", body, SCRIPTS, EARLY)


def _all_scenarios(results: Results, found: Sequence[ScenarioFiles], has_drives: bool) -> Html:
    """The first panel: what was done, every town at a look, and one line of figures for each; then the missions."""
    missions, maps = mission_overview(results), _maps(results)
    kept = [place for place, one in enumerate(results.scenarios) if without_missions(one).rows or missions is None]
    drives = element("p", element("a", "The driven ways, mission by mission", href=DRIVE_PAGE)) if has_drives else None
    return element(
        "section",
        element("p", lede(maps), class_="lede") if kept else None,
        towns(maps, [found[place] for place in kept], kept) if kept else None,
        joined(element("h2", "At a glance"), at_a_glance(maps, [found[place] for place in kept])) if kept else None,
        joined(element("h2", "All scenarios"), overview(maps, quoted_rows(), kept), surprises(maps.scenarios)) if kept else None,
        joined(element("h2", TITLE), missions, drives) if missions else None,
        class_="panel",
        id=COMPARE,
    )


def _maps(results: Results) -> Results:
    """The scenarios with their rows of maps and localization alone; those that have none only if nobody drove missions."""
    bare = [without_missions(one) for one in results.scenarios]
    only_maps = mission_overview(results) is None
    return Results(scenarios=tuple(one for one in bare if one.rows or only_maps))


def _maker(results: Results) -> str:
    """The command that made the results."""
    has_maps = any(without_missions(one).rows for one in results.scenarios)
    return "hippodrome eval" if has_maps or not results.scenarios else "hippodrome drive"
