"""The first screen of a town: the drive playing, in markup that ``player.js`` brings to life."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from hippodrome.eval.report.belief import AS_PRINTED
from hippodrome.eval.report.files import ScenarioFiles
from hippodrome.eval.report.markup import Html, data_script, element, joined
from hippodrome.eval.report.tables import anchor
from hippodrome.eval.results.model import Results, ScenarioResult

# player.js writes them as factors of real time, of which a long drive's story has more.
SPEEDS = (("0.25", "¼ speed"), ("0.5", "½ speed"), ("1", "1× speed"), ("2", "2× speed"), ("4", "4× speed"))
SLOWER: Final = "The second drive is told more slowly until it is localized, and for six seconds after"
# The curves have the same names above them (chart.js).
PARTS = (("map", "1 The map grows"), ("roads", "2 It comes right"), ("find", "3 Where am I?"), ("follow", "4 Localized"))
EXPLAINED = (  # what is seen in the parts of the story that leave room for it
    ("map", "The car drives through the town; the line behind it is its true path. From camera and wheels alone it makes a map: "
            "streets connect as they should, but lengths and turns are wrong, so the map lies off the roads. "
            "The dashed line is the error at this moment."),
    ("roads", "The map is laid on the road network: every vertex moves to the place at which the roads explain the drive best. "
              "Its colour is what is left of its error."),
    ("made", "The car drives its first way once more in the finished map, whose vertices have the colours of their errors. "
             "The dashed line is the error at this moment."),
)  # fmt: skip
MARKS = (  # sign, meaning, and the parts of the story in which it is seen
    ("road", "roads", "map made roads"),
    ("truth", "true path", "map made roads find"),
    ("car", "true car", "map made find"),
    ("own", "semi-metric map, and the car in it", "map"),
    ("own", "semi-metric map", "roads"),
    ("gap", "error now", "map made"),
    ("ramp", "laid on the roads, by error: 0.1 to 100 m", "roads made"),
    ("vertex-dot", "place in the map", "find"),
    ("arrow", "believed car", "find"),
    ("located", "localized path", "find"),
    ("fix", "belief (95 %)", "find"),
    ("view", "view that fired", "find"),
    ("modules", "places by each grid module", "find"),
)
# The signs of the three grid modules as scene.js draws them: square, diamond, circle.
MODULE_SIGNS: Final = Html(
    '<svg class="mark modules" viewBox="0 0 46 14" aria-hidden="true" fill="none" stroke-width="2">'
    '<path d="M2 2h10v10h-10z" stroke="#cc79a7"/><path d="M23 1l6 6l-6 6l-6-6z" stroke="#0072b2"/>'
    '<circle cx="39" cy="7" r="5.5" stroke="#d55e00"/></svg>'
)
BRAIN_PARTS = (  # equations are those of Li et al. 2025
    ("Head-direction ring:", "each cell stands for a heading, and the cells around the believed one are active, Eq. (1)."),
    ("Grid sheets:", "each cell stands for a place within a period that repeats over the town, Eq. (2); modules of unequal "
                     "periods together tell one place, where their signs on the map meet, Eqs. (15) and (16)."),
    ("Integrator cells (blue):", "move the bump by what wheels and gyro say, and slowly lose certainty."),
    ("Calibration cells (orange):", "take the pose of a recognised view in, an injection, Eqs. (13) and (14)."),
    ("Inhibition:", "keeps the activity of a network limited, Eqs. (3) to (5), and lets its two populations compete, "
                    "Eqs. (6) and (7)."),
)  # fmt: skip
# Of the methods, in the order in which map.json has them; basics.js draws them in the same.
COLOURS: Final = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#5b3a9e")
MODULES = 3  # sheets that there is room for; a belief with fewer hides the others

CARD_MARKS = (  # what is seen on the cards, which leave the views and the grid modules to the towns' own pages
    ("truth", "true path"),
    ("car", "true car"),
    ("own semi", "semi-metric map, and where it has the car"),
    ("gap", "error now"),
    ("ramp", "map on the roads, by error: 0.1 to 100 m"),
    ("arrow", "second drive: where the car believes it is"),
    ("fix", "95 % of its belief"),
)


def player(files: ScenarioFiles) -> Html | None:
    """The player of one town; None without ``map.json``. It reads the map that stands further down in the same section."""
    if files.evidence is None:
        return None
    return element(
        "div",
        data_script(files.second) if files.second else None,
        element("div", element("canvas", class_="scene", role="img", aria_label="The town with the drive and its maps"),
                _moment(), _legend(), class_="stage-map"),
        _seen(files),
        element("div", element("canvas", aria_hidden="true"), class_="chart", tabindex="0", role="slider",
                aria_valuemin=0, aria_valuemax=1000, aria_valuenow=0,
                aria_label="Place in the story; the curves are the errors in metres"),
        _transport(bool(files.second and any(one.periods_m for one in files.second.beliefs))),
        class_="player", role="region", aria_label="The drive, playing",
    )  # fmt: skip


def method_colours(files: ScenarioFiles) -> dict[str, str]:
    """The colour of each method that the map shows, by its name."""
    layers = files.evidence.methods if files.evidence else []
    return {layer.name: COLOURS[place % len(COLOURS)] for place, layer in enumerate(layers)} | {AS_PRINTED: COLOURS[5]}


def brain_at_work(files: ScenarioFiles) -> Html | None:
    """How sure the networks were along the second drive, and one sentence for each part of them; None without a belief."""
    if files.second is None or not any(any(one.grid_rad) for one in files.second.beliefs):
        return None
    canvas = element("canvas", role="img", aria_label="Reliability of both populations of both networks along the second drive")
    parts = [element("li", element("strong", name), f" {words}") for name, words in BRAIN_PARTS]
    return joined(element("div", canvas, class_="traces"), element("ul", parts, class_="facts"))


def towns(results: Results, found: Sequence[ScenarioFiles], places: Sequence[int]) -> Html | None:
    """A card for each scenario that has a map, which tell their stories at the same time; None if none has.

    Args:
        results: The scenarios.
        found: What lies beside the results of each.
        places: Numbers of the scenarios' sections on the page.
    """
    cards = [
        _card(place, scenario)
        for place, scenario, files in zip(places, results.scenarios, found, strict=True)
        if files.evidence is not None
    ]
    if not cards:
        return None
    button = element("button", "▶ Play all", type="button", class_="play-all", aria_pressed="false")
    signs = [element("li", element("i", class_=f"mark {kind}"), words) for kind, words in CARD_MARKS]
    below = element("div", button, element("ul", signs, class_="legend"), class_="transport")
    return element("div", element("div", cards, class_="town-cards"), below, class_="towns")


def _card(place: int, scenario: ScenarioResult) -> Html:
    """A town with the figures of its last row that has a map, which is what a run is about."""
    best = next((row for row in reversed(scenario.rows) if row.ape is not None), None)
    words = f"{best.method}: mean map error (APE) {best.ape.mean_m:.2f} m" if best and best.ape else "no map"
    if best is not None and best.refused is not None:
        words = f"{best.method}: refused"
    where = best.localization if best else None
    found = (
        ""
        if where is None
        else f"second drive: found its place after {where.initial_drive_s:.1f} s"
        if where.initial_drive_s is not None
        else "second drive: never found its place"
    )
    canvas = element("canvas", role="img", aria_label=f"{scenario.name}: the story of its map")
    return element("a", element("span", canvas, class_="stage-map"), element("strong", scenario.name), element("small", ""),
                   element("span", words), element("span", found),
                   href=f"#{anchor(place)}", class_="town", data_place=anchor(place))  # fmt: skip


def _moment() -> Html:
    return element("p", element("strong", ""), element("span", ""), class_="moment")


def _legend() -> Html:
    """What the marks mean; the colours are those of the map's layers."""
    signs = [MODULE_SIGNS if kind == "modules" else element("i", class_=f"mark {kind}") for kind, _, _ in MARKS]
    items = [element("li", sign, words, data_in=parts) for sign, (_, words, parts) in zip(signs, MARKS, strict=True)]
    return element("ul", items, class_="legend")


def _seen(files: ScenarioFiles) -> Html:
    pictures = [_picture("film", "Camera frame"), _picture("fired", "The stored view that fired")] if files.thumbnails else []
    words = [element("p", text, class_="explained", data_in=part) for part, text in EXPLAINED]
    frames = element("div", pictures, class_="frames") if pictures else None
    return element("div", frames, words, _brain() if files.second else None, class_="seen")


def _picture(kind: str, label: str) -> Html:
    return element(
        "figure", element("canvas", role="img", aria_label=label, width=160, height=120), element("figcaption", ""), class_=kind
    )


def _brain() -> Html:
    """The networks, with one sentence for each."""
    sheets = [
        element("figure", element("canvas", class_="sheet", role="img", aria_label=f"Grid cells, module {number}"),
                element("figcaption", f"grid {number}"))
        for number in range(1, MODULES + 1)
    ]  # fmt: skip
    ring = element(
        "figure", element("canvas", class_="ring", role="img", aria_label="Head-direction ring"), element("figcaption", "head")
    )
    colours = element("p", element("b", "integrator", class_="integrator"), " cells follow wheels and gyro, ",
                      element("b", "calibration", class_="calibration"), " cells the views; both on a log scale. ",
                      "Both together are white; black is silent, and a dim network knows nothing.")  # fmt: skip
    return element("div", element("div", ring, sheets, class_="networks"), colours, class_="brain")


def _transport(has_modules: bool) -> Html:
    parts = [element("button", words, type="button", data_part=kind, aria_pressed="false") for kind, words in PARTS]
    speeds = [element("option", words, value=value, selected=value == "1") for value, words in SPEEDS]
    return element(
        "div",
        element("button", "▶ Play", type="button", class_="play", aria_pressed="false"),
        parts,
        element("select", speeds, class_="speed", aria_label="Speed", title=SLOWER),
        element("label", "Map ", element("select", class_="choice")),
        element("label", element("input", type="checkbox", checked=True, class_="modules"), " grid modules")
        if has_modules
        else None,
        class_="transport",
    )
