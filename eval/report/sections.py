"""The parts of one scenario's section."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from hippodrome.eval.report import comparison
from hippodrome.eval.report.belief import AS_PRINTED
from hippodrome.eval.report.caveats import town_caveats
from hippodrome.eval.report.commands import command_lines
from hippodrome.eval.report.drives import TITLE, mission_table, without_missions
from hippodrome.eval.report.evidence import MapEvidence
from hippodrome.eval.report.files import Picture, ScenarioFiles
from hippodrome.eval.report.markup import Child, Html, data_script, element, joined
from hippodrome.eval.report.meanings import meanings
from hippodrome.eval.report.places import localization_places, mapping_places
from hippodrome.eval.report.player import brain_at_work, method_colours, player
from hippodrome.eval.report.remarks import surprises
from hippodrome.eval.report.tables import (
    anchor,
    break_table,
    localization_table,
    mapping_table,
    plain_table,
    row_heads,
    scrolling,
    swatch,
)
from hippodrome.eval.results.aligned import aligned_note
from hippodrome.eval.results.model import Row, ScenarioResult
from hippodrome.eval.results.tables import LOCALIZATION_COLUMNS, MAPPING_COLUMNS, definitions, failed_runs, unscored_notes
from hippodrome.eval.results.thresholds import limits_in_words, limits_missed

NBSP = "\N{NO-BREAK SPACE}"
PRINTED = (
    f"{AS_PRINTED}: the second drive in the map of topometric, localized by the attractor networks exactly as the paper prints "
    "them. It makes no map, and so has no row above."
)
WIDE_PX = 1400  # a figure that is wider is given a row of its own, else its letters are too small
FLAT = 1.45  # and one that is so many times as wide as high, as curves over time are
MEANING = {"cpu_s": "s of CPU", "step_ms": "ms a step"}  # of a time, by the end of its name


def scenario_section(place: int, scenario: ScenarioResult, quoted: Sequence[Row], files: ScenarioFiles) -> Html:
    """The section of one scenario, from its verdict to how to run it again.

    Args:
        place: Number of the scenario on the page, from 0.
        scenario: Its result.
        quoted: The paper's rows, which stand below ours.
        files: What lies beside the results.
    """
    missions, verdict = mission_table(scenario), _verdict(scenario)
    failures, scenario = _failures(scenario), without_missions(scenario)
    if not scenario.rows and missions:
        return _driven_section(place, scenario, verdict, failures, missions)
    rows, colours = (*scenario.rows, *quoted), method_colours(files)
    return element(
        "section",
        element("h2", scenario.name, " ", verdict),
        player(files),
        element("p", _driven(scenario), class_="note"),
        failures,
        town_caveats(scenario, files),
        _headline(scenario, colours),
        _undrawn(scenario, colours),
        element("h3", "Mapping (Table I)"),
        mapping_table(scenario, quoted, colours),
        element("p", note, class_="note") if (note := aligned_note(rows)) is not None else None,
        surprises([scenario]),
        _titled("Localization from an unknown start (Table II)", localization_table(scenario, quoted, colours)),
        element("p", PRINTED, class_="note") if scenario.as_printed is not None else None,
        _titled("Ten sequences from unknown starts (Table II)", comparison.sequences(files.sequences)),
        _titled("Cheaper than ORB-SLAM3", comparison.ratios(files.ratios)),
        _titled("What each method is given", comparison.fairness(scenario)),
        _folded("What each figure means", _definitions(rows)),
        _titled(TITLE, missions),
        _titled("The brain at work", brain_at_work(files)),
        _titled("Map", _interactive_map(files) if files.evidence else None),
        _titled("Why is it wrong here? The worst places", mapping_places(files, scenario.name)),
        localization_places(files, scenario.name),
        _titled("Breaks", break_table(scenario)),
        _titled("Figures", gallery(files.pictures) if files.pictures else None),
        _titled("Stage times", _timings(scenario)),
        element("h3", "Run it again"),
        _commands(scenario, files.evidence),
        _configuration(scenario),
        class_="panel",
        data_town=scenario.name,
        id=anchor(place),
        style=_frames_style(files),
    )


def _driven_section(place: int, scenario: ScenarioResult, verdict: Html | None, failures: Html | None, missions: Html) -> Html:
    """The section of a scenario of which there are missions alone."""
    return element(
        "section",
        element("h2", scenario.name, " ", verdict),
        failures,
        element("h3", TITLE),
        missions,
        _configuration(scenario),
        class_="panel",
        data_town=scenario.name,
        id=anchor(place),
    )


def _driven(scenario: ScenarioResult) -> str:
    """What was driven, in two sentences."""
    network = scenario.network
    town = f"The road network {network.path}" if network.path is not None else f"A generated town of the kind {network.generator}"
    return (
        f"{town}, with {network.km:.1f}{NBSP}km of road; seed {scenario.seed}, noise level \u201c{scenario.noise}\u201d. "
        f"The first drive took {scenario.duration_s:,.0f}{NBSP}s and {scenario.frames:,} camera frames."
        + (f" Limits: {words}." if (words := limits_in_words(scenario)) else "")
    )


def _definitions(rows: Sequence[Row]) -> Html:
    """The heads in plain English, and the definitions to the letter."""
    heads = [*row_heads(MAPPING_COLUMNS, rows), *row_heads(LOCALIZATION_COLUMNS, [row for row in rows if row.localization])]
    return joined(meanings(heads), element("p", "To the letter, as results.json has it:"), _exact_definitions(rows))


def _exact_definitions(rows: Sequence[Row]) -> Html:
    return element("ul", [element("li", line) for line in definitions(rows)], class_="definitions")


def _titled(title: str, content: Html | None) -> Html | None:
    return joined(element("h3", title), content) if content else None


def _folded(title: str, content: Child) -> Html:
    return element("details", element("summary", title), content)


def _verdict(scenario: ScenarioResult) -> Html | None:
    """Whether the scenario's own limits hold."""
    failed = limits_missed(scenario)
    if failed is None or not (failed or limits_in_words(scenario)):
        return None
    return element("span", "limits failed", class_="badge bad") if failed else element("span", "limits hold", class_="badge good")


def _failures(scenario: ScenarioResult) -> Html | None:
    lines = [f"Limit: {line}" for line in limits_missed(scenario) or []]
    lines += [f"{row.method} failed: {row.failure}" for row in scenario.rows if row.failure is not None]
    lines += [f"{row.method}: map refused: {row.refused}" for row in scenario.rows if row.refused is not None]
    lines += [*unscored_notes(scenario.rows), *failed_runs(scenario.rows)]
    return element("ul", [element("li", line) for line in lines], class_="failures") if lines else None


def _extra(scenario: ScenarioResult, name: str) -> dict[str, Any]:
    """A dictionary that results may have beside the agreed fields; empty if it is missing or something else."""
    value = getattr(scenario, name, None)
    return value if isinstance(value, dict) else {}


def _headline(scenario: ScenarioResult, colours: Mapping[str, str]) -> Html:
    """One tile per method with its APE and its localization error, the last row first, as it is what a run is about."""
    return element("div", [_tile(row, colours) for row in reversed(scenario.rows)], class_="tiles")


def _tile(row: Row, colours: Mapping[str, str]) -> Html:
    name = element("span", swatch(colours, row.method), row.method)
    if row.ape is None and row.places is not None:
        right = element("strong", f"{100.0 * row.places.best_is_right:.0f} %")
        return element("div", name, right, element("small", "of the places right"), class_="figure-tile")
    if row.ape is None:
        return element("div", name, element("strong", "failed", class_="bad"), class_="figure-tile")
    if row.refused is not None:
        small = element("small", f"nothing vouches for its {row.ape.mean_m:.0f}\N{NO-BREAK SPACE}m")
        return element("div", name, element("strong", "refused", class_="bad"), small, class_="figure-tile")
    details = ["mean APE", *([f"worst {row.ape.max_m:.1f}\N{NO-BREAK SPACE}m"] if row.ape.max_m is not None else [])]
    if row.localization is not None and row.localization.error_mean_m is not None:
        details.append(f"localized to {row.localization.error_mean_m:.2f}\N{NO-BREAK SPACE}m")
    return element("div", name, element("strong", f"{row.ape.mean_m:.2f} m"),
                   [element("small", line) for line in details], class_="figure-tile")  # fmt: skip


def _undrawn(scenario: ScenarioResult, colours: Mapping[str, str]) -> Html | None:
    """Which methods have no colour, as maps do not show them; None if they show all, or there is no map."""
    names = [row.method for row in reversed(scenario.rows) if row.ape is not None and row.method not in colours]
    words = f"A ring without a colour: maps and figures do not show {'; '.join(names)}, which would cover another map."
    return element("p", words, class_="note") if names and colours else None


def _interactive_map(files: ScenarioFiles) -> Html:
    """The canvas with its controls; ``map.js`` brings it to life."""
    assert files.evidence is not None
    stage = element(
        "div",
        element("canvas", tabindex="0", role="img", aria_label="Ground truth and maps; arrow keys step through the vertices"),
        element("div", class_="tip", hidden=True),
        element("div", [element("button", sign, type="button", data_zoom=kind, aria_label=label, title=label)
                        for sign, kind, label in (("+", "in", "Zoom in"), ("−", "out", "Zoom out"), ("⤢", "fit", "Show all"))],
                class_="zoom"),
        element("div", class_="scalebar", aria_hidden="true"),
        class_="stage",
    )  # fmt: skip
    side = element(
        "div",
        element("fieldset", element("legend", "Layers"), class_="layers"),
        element("label", element("input", type="checkbox", checked=True, class_="by-error"), "colour vertices by APE"),
        element("div", class_="colourbar"),
        element("small", "Vertices coloured by APE have a rim in their method's colour where several maps are shown."),
        element("label", "Vertex ", element("input", type="range", min=0, value=0, class_="scrub")),
        element("div", class_="tile", role="img", hidden=True) if files.thumbnails else None,
        element(
            "p",
            "Point at a vertex to see its error; click or tap it to keep it and see its camera frame.",
            class_="vertex",
            aria_live="polite",
        ),
        class_="side",
    )
    missing = element("noscript", "The interactive map needs JavaScript; the figures below show the same maps.")
    return element("div", data_script(files.evidence), stage, side, missing,
                   class_="map")  # fmt: skip


def gallery(pictures: Sequence[Picture]) -> Html:
    """Figures that open by a click and are saved by buttons."""
    return element("div", [_figure(picture) for picture in pictures], class_="gallery")


def _figure(picture: Picture) -> Html:
    image = element("img", src=picture.uri, alt=picture.caption, width=picture.width, height=picture.height)
    button = element("button", image, type="button", class_="enlarge", aria_label=f"Enlarge: {picture.caption}")
    flat = picture.width > FLAT * picture.height
    looks = (("wide", picture.width > WIDE_PX or flat), ("flat", flat and picture.width <= WIDE_PX), ("photo", picture.photo))
    kinds = " ".join(kind for kind, has in looks if has) or None
    drawn = Html(f'<script type="text/plain">{picture.svg}</script>') if picture.svg else None
    return element("figure", button, drawn, element("figcaption", picture.caption), class_=kinds)


def _timings(scenario: ScenarioResult) -> Html | None:
    """The times of the stages with bars, each as a share of the longest in the same unit."""
    figures = {name: float(value) for name, value in _extra(scenario, "timings").items() if isinstance(value, int | float)}
    rows: list[Sequence[Child]] = []
    for name, value in figures.items():
        words, unit = _unit_of(name)
        longest = max(other for key, other in figures.items() if _unit_of(key)[1] == unit)
        share = value / longest if longest > 0.0 else 0.0
        bar = element("span", class_="bar", style=f"--share:{share:.4f}")
        rows.append([words, f"{value:.3g} {unit}", bar])
    return plain_table(["Stage", "Time", "Share of the longest in the same unit"], rows, "stage times") if rows else None


def _unit_of(name: str) -> tuple[str, str]:
    for ending, meaning in MEANING.items():
        if name.endswith(ending):
            return name.removesuffix(ending).strip("_ ").replace("_", " "), meaning
    return name, ""


def _commands(scenario: ScenarioResult, evidence: MapEvidence | None) -> Html:
    """The command of each row, to be typed in the folder of the report."""
    commands = list(command_lines(scenario, evidence))
    lines = [[name, element("code", _unbroken(command))] for name, command in commands]
    others = [row.method for row in scenario.rows if row.method not in dict(commands)]
    note = "In the folder that holds this report. Stages take the road network as it is; noise levels that survey it wrongly " \
           "(realistic, harsh) are reproduced by eval only."  # fmt: skip
    note += f" Made again by the first command only: {'; '.join(others)}." if others else ""
    return joined(plain_table(["Row", "Command"], lines, "commands"), element("p", note, class_="note"))


def _unbroken(command: str) -> list[Html]:
    """Words that browsers do not break at their hyphens."""
    return [joined(element("span", word), " ") for word in command.split(" ")]


def _configuration(scenario: ScenarioResult) -> Html | None:
    """Every setting of the scenario, folded; None if the results do not have them."""
    settings = _extra(scenario, "configuration")
    text = json.dumps(settings, indent=2, ensure_ascii=False)
    box = scrolling(element("pre", text), "effective configuration")
    return _folded("Effective configuration", box) if settings else None


def _frames_style(files: ScenarioFiles) -> str | None:
    """The sheet of frames, once, for every tile of the section."""
    if files.evidence is None or files.thumbnails is None:
        return None
    sheet = files.evidence.thumbnails
    rows = -(-len(sheet.t_s) // sheet.columns)
    second = f"--sheet2:url({files.second_frames});" if files.second_frames else ""
    return f"{second}--sheet:url({files.thumbnails});--columns:{sheet.columns};--rows:{rows};--ratio:{sheet.width}/{sheet.height}"
