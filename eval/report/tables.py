"""The report's tables. Wide ones scroll inside their own box, so that the page itself never does."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Final

from hippodrome.eval.report.markup import Child, Html, element, joined
from hippodrome.eval.results.model import Results, Row, ScenarioResult
from hippodrome.eval.results.tables import (
    LOCALIZATION_COLUMNS,
    MAPPING_COLUMNS,
    NONE,
    QUOTED_MARK,
    QUOTED_NOTE,
    Column,
    filled_columns,
    row_cells,
)

FIRST: Final = ("APE (m)", "Success", "Error (m)")  # columns beside the method's name, so that a phone shows them unscrolled
NBSP: Final = "\N{NO-BREAK SPACE}"
KEYED: Final = 4  # columns beyond which a table is wide: on a phone, both names of a row stay in sight if one tells too little
LONG: Final = 36  # letters of a name from which on it is broken
SPLIT: Final = {  # headings of cells that hold several figures, and those of one column for each figure
    "APE median / p95 / max": ("APE median (m)", "APE p95 (m)", "APE max (m)"),
    "Latency (ms)": ("Latency median (ms)", "Latency p99 (ms)"),
}


def row_head(name: Child, sign: Html | None = None) -> Html:
    """The first cell of a row; a long name may break anywhere, so that it leaves room for the figures."""
    return element("th", sign, name, scope="row", class_="long" if len(re.sub("<[^>]*>", "", joined(name))) > LONG else None)


def scrolling(table: Html, label: str) -> Html:
    """A table in a box of its own, reachable by keyboard."""
    return element("div", table, class_="scroll", tabindex="0", role="region", aria_label=label)


def plain_table(heads: Sequence[str], rows: Sequence[Sequence[Child]], label: str) -> Html:
    """A table with words to the left and figures to the right; ``label`` names it for screen readers."""
    kinds = [None, *("text" if _is_words([row[place] for row in rows]) else None for place in range(1, len(heads)))]
    head = element("tr", [element("th", unbroken(title), scope="col", class_=kind) if title else element("td")
                          for title, kind in zip(heads, kinds, strict=True)])  # fmt: skip
    body = [
        element("tr", row_head(row[0]), [element("td", cell, class_=kind) for cell, kind in zip(row[1:], kinds[1:], strict=True)])
        for row in rows
    ]
    is_keyed = len(heads) > KEYED and kinds[1] is not None and len({joined(row[0]) for row in rows}) < len(rows)
    table = element("table", element("thead", head), element("tbody", body), class_="keyed" if is_keyed else None)
    return scrolling(table, label)


def _is_words(cells: Sequence[Child]) -> bool:
    """Whether no cell of a column begins with a figure."""
    texts = [re.sub("<[^>]*>", "", joined(cell)).strip() for cell in cells]
    return any(text not in ("", NONE) for text in texts) and not any(re.match(r"[<(+-]?\s*\d", text) for text in texts)


def grouped_table(groups: Sequence[tuple[str, Sequence[str]]], rows: Sequence[Sequence[Child]], label: str) -> Html:
    """A plain table with two rows of headings: one above groups of columns that show the same figure, one above each column.

    Args:
        groups: Heading of each group, and the headings of its columns; none for a group of one column, whose heading spans both.
        rows: The cells.
        label: Names the table for screen readers.
    """
    top, below, begins = [], [], set()  # columns with which a group begins: a line parts them from those before
    column, grouped = 0, False  # whether the columns before are a group
    for title, heads in groups:
        spans: dict[str, str | int] = {"colspan": len(heads), "scope": "colgroup"} if heads else {"rowspan": 2, "scope": "col"}
        begin = "begin" if heads or grouped else None
        top.append(element("th", title, class_=begin, **spans))
        below += [element("th", head, scope="col", class_=begin if head == heads[0] else None) for head in heads]
        begins |= {column} if begin else set()
        column, grouped = column + (len(heads) or 1), bool(heads)
    body = [
        element("tr", row_head(row[0]),
                [element("td", cell, class_="begin" if place in begins else None) for place, cell in enumerate(row[1:], start=1)])
        for row in rows
    ]  # fmt: skip
    head = element("thead", element("tr", top, class_="groups"), element("tr", below))
    return scrolling(element("table", head, element("tbody", body)), label)


def overview(results: Results, quoted: Sequence[Row], places: Sequence[int]) -> Html:
    """One line per scenario: APE of every method, and how the second drive was localized; the paper's figures below.

    Args:
        results: The scenarios.
        quoted: The paper's rows.
        places: Numbers of the scenarios' sections on the page.
    """
    measured = list(dict.fromkeys(row.method for scenario in results.scenarios for row in scenario.rows))[::-1]  # ours first
    localizing = [method for method in measured if any(_located(_row(one, method)) for one in results.scenarios)]
    shaped = [method for method in measured if any(_shape(_row(one, method)) != NONE for one in results.scenarios)]
    groups: list[tuple[str, Sequence[str]]] = [("Scenario", ()), ("Mean APE of the map (m)", measured)]
    groups += [("Mean APE after the best fit with a scale, Sim(2) (m)", shaped)] if shaped else []
    groups += [("Mean localization error (m)", localizing)] if localizing else []
    groups += [("Road (km)", ()), ("Drive (s)", ()), ("Frames", ())]
    rows: list[Sequence[Child]] = [
        [
            element("a", scenario.name, href=f"#{anchor(place)}"),
            *_best_marked([_ape(_row(scenario, method)) for method in measured]),
            *_best_marked([_shape(_row(scenario, method)) for method in shaped]),
            *_best_marked([_location_error(_row(scenario, method)) for method in localizing]),
            f"{scenario.network.km:.1f}",
            f"{scenario.duration_s:,.0f}",
            f"{scenario.frames:,}",
        ]
        for place, scenario in zip(places, results.scenarios, strict=True)
    ]
    note = element("p", f"The paper's APE: {_paper_line(quoted)} ({QUOTED_NOTE}).", class_="note") if quoted else None
    return Html(grouped_table(groups, rows, "all scenarios") + (note or ""))


def anchor(place: int) -> str:
    """The id of a scenario's section. It is made of its number, as its name may hold anything."""
    return f"scenario-{place + 1}"


def mapping_table(scenario: ScenarioResult, quoted: Sequence[Row], colours: Mapping[str, str]) -> Html:
    """The paper's Table I with our rows above its own, in the order of the tiles: the last one is what a run is about."""
    return _row_table(MAPPING_COLUMNS, [*reversed(scenario.rows), *quoted], f"{scenario.name}: mapping", colours)


def localization_table(scenario: ScenarioResult, quoted: Sequence[Row], colours: Mapping[str, str]) -> Html | None:
    """Localization from an unknown start (the paper's Table II), that by the networks as printed below; None without any."""
    printed = [scenario.as_printed] if scenario.as_printed is not None else []
    rows = [row for row in (*reversed(scenario.rows), *printed, *quoted) if row.localization is not None]
    return _row_table(LOCALIZATION_COLUMNS, rows, f"{scenario.name}: localization", colours) if rows else None


def break_table(scenario: ScenarioResult) -> Html | None:
    """Stretches of vertices that the road match does not vouch for, and why; None if there are none."""
    rows = [
        [row.method, f"{one.get('first_vertex')}–{one.get('last_vertex')}", _words(one.get("status")), str(one.get("cause"))]
        for row in scenario.rows
        for one in _dictionaries(getattr(row, "breaks", None))
    ]
    table = plain_table(["Method", "Vertices", "Status", "Cause"], rows, "breaks")
    words = "Nothing vouches for these vertices: they lie where wheels and views put them beside those that are matched."
    return joined(element("p", words, class_="note"), table) if rows else None


def row_heads(columns: Sequence[Column], rows: Sequence[Row]) -> list[str]:
    """The heads of the table of these rows, that of the methods' names first."""
    return [column.title for column in _row_columns(columns, rows)]


def _row_columns(columns: Sequence[Column], rows: Sequence[Row]) -> list[Column]:
    filled = sorted(filled_columns(columns, rows)[1:], key=lambda column: column.title not in FIRST)
    return [columns[0], *(part for column in filled for part in _parts(column))]


def _row_table(columns: Sequence[Column], rows: Sequence[Row], label: str, colours: Mapping[str, str]) -> Html:
    columns = _row_columns(columns, rows)
    head = element("tr", [element("th", unbroken(column.title), scope="col") for column in columns])
    body = [_row_line(row_cells(columns, row), row, colours) for row in rows]
    return scrolling(element("table", element("thead", head), element("tbody", body)), label)


def unbroken(title: str) -> str:
    """A heading whose lengths, as in "RPE 20 m (m)", are not parted from their units."""
    return re.sub(r"(?<=\d) (?=m\b)|(?<=>) ", NBSP, title)


def _parts(column: Column) -> list[Column]:
    """One column for each figure of a cell, which the cell separates by slashes; a column of single figures is itself."""
    titles = SPLIT.get(column.title, ())
    return [Column(title, partial(_part, column, place)) for place, title in enumerate(titles)] or [column]


def _part(column: Column, place: int, row: Row) -> str:
    parts = column.cell(row).split(" / ")
    return parts[place] if place < len(parts) else NONE


def swatch(colours: Mapping[str, str], method: str) -> Html | None:
    """A dot of the colour that a method has on maps and in figures, a ring if they do not show it; None if there are no maps."""
    if method in colours:
        return element("i", class_="swatch", style=f"background:{colours[method]}")
    return element("i", class_="swatch none", title="not drawn") if colours else None


def _row_line(cells: Sequence[str], row: Row, colours: Mapping[str, str]) -> Html:
    style = "failed" if row.failure is not None or row.refused is not None else "quoted" if row.quoted else None
    sign = None if row.quoted else swatch(colours, row.method)
    return element("tr", row_head(cells[0], sign), [element("td", cell) for cell in cells[1:]], class_=style)


def _row(scenario: ScenarioResult, method: str) -> Row | None:
    return next((row for row in scenario.rows if row.method == method), None)


def _located(row: Row | None) -> bool:
    return row is not None and row.localization is not None


def _dictionaries(value: object) -> list[dict[str, object]]:
    """The dictionaries in a field of a row that is not one of the agreed ones, and so may be anything."""
    return [one for one in value if isinstance(one, dict)] if isinstance(value, list | tuple) else []


def _words(status: object) -> str:
    return str(status).lower().replace("_", " ")


def _ape(row: Row | None) -> Child:
    if row is None:
        return NONE
    if row.ape is None:
        return NONE if row.places is not None else element("span", "FAILED", class_="bad")
    return element("span", f"REFUSED ({row.ape.mean_m:.2f})", class_="bad") if row.refused else f"{row.ape.mean_m:.2f}"


def _shape(row: Row | None) -> str:
    """Mean APE after the best similarity fit."""
    return NONE if row is None or row.ape_sim2 is None else f"{row.ape_sim2.mean_m:.2f}"


def _location_error(row: Row | None) -> Child:
    if row is None or row.localization is None:
        return NONE
    error_m = row.localization.error_mean_m
    return element("span", "never", class_="bad") if error_m is None else f"{error_m:.2f}"


def _best_marked(cells: Sequence[Child]) -> list[Child]:
    """Cells of methods in one town, of which the least figure is marked if there is more than one; a refused one never is."""
    figures = [cell for cell in cells if type(cell) is str and cell != NONE]
    least = min(figures, key=float, default=None)
    several = len(figures) > 1
    return [element("strong", cell, class_="good") if several and type(cell) is str and cell == least else cell for cell in cells]


def _paper_line(quoted: Sequence[Row]) -> str:
    return "; ".join(f"{row.method} {QUOTED_MARK} {row.ape.mean_m:g}\N{NO-BREAK SPACE}m" for row in quoted if row.ape is not None)
