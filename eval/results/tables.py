"""Table I and the localization table, as Markdown and on the terminal, from ``Results`` alone.

Rows that are quoted from the paper are marked, and a method that failed keeps its row.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from hippodrome.eval.results import markdown
from hippodrome.eval.results.aligned import aligned_note
from hippodrome.eval.results.model import ErrorSummary, Results, Row, ScenarioResult
from hippodrome.eval.results.terminal import wrapped_title

QUOTED_MARK: Final = "†"
QUOTED_NOTE: Final = f"{QUOTED_MARK} quoted from the paper, another drive in another simulator; not measured here"
NONE: Final = "-"
MEGABYTE: Final = 1e6
LEAST: Final = 0.001  # a smaller figure is written as "<0.001"


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table: its heading, and what it says of a row."""

    title: str
    cell: Callable[[Row], str]


def _figure(value: float | None, digits: int = 2) -> str:
    """A number with ``digits`` decimals, or with one significant digit if it would be zero otherwise."""
    if value is None:
        return NONE
    if value == 0.0 or abs(value) >= 10.0**-digits:
        return f"{value:.{digits}f}"
    return f"{value:.1g}" if abs(value) >= LEAST else f"<{LEAST}"


def _count(value: int | None) -> str:
    return NONE if value is None else f"{value:,}"


def _mean(error: ErrorSummary | None) -> str:
    return NONE if error is None else _figure(error.mean_m)


def _placed(row: Row, figure: Callable[[float], str]) -> str:
    """Mean APE as the map lies; in brackets where it lies by a guess."""
    if row.ape is None:
        return NONE
    return f"({figure(row.ape.mean_m)})" if row.refused else figure(row.ape.mean_m)


def _latency(row: Row) -> str:
    """Median and 99th percentile."""
    return NONE if row.latency_ms is None else f"{_figure(row.latency_ms.median)} / {_figure(row.latency_ms.p99)}"


def _covered(row: Row) -> str:
    """Share of the drive that a method answered for, where that is not all of it."""
    return NONE if row.covered is None or row.covered == 1.0 else f"{100.0 * row.covered:.0f}"


def _spread(error: ErrorSummary | None) -> str:
    """Median, 95th percentile and worst case."""
    if error is None or error.median_m is None:
        return NONE
    return " / ".join(_figure(value) for value in (error.median_m, error.p95_m, error.max_m))


def _map_size(row: Row) -> str:
    return NONE if row.map_bytes is None else _figure(row.map_bytes / MEGABYTE)


def _method(row: Row) -> str:
    return f"{row.method} {QUOTED_MARK}" if row.quoted else row.method


def _localization(row: Row, figure: Callable[..., str], field: str) -> str:
    return NONE if row.localization is None else figure(getattr(row.localization, field))


def _runs(row: Row) -> str:
    """Of a method that is run several times: the lowest and the highest mean APE, and how many of the runs failed."""
    spread_m = (row.model_extra or {}).get("ape_spread_m")
    if not spread_m:
        return NONE
    failed, runs = len(failed_runs([row])), len((row.model_extra or {}).get("runs", ()))
    return " to ".join(_figure(float(value)) for value in spread_m) + (f" ({failed} of {runs} failed)" if failed else "")


def failed_runs(rows: Sequence[Row]) -> list[str]:
    """Why runs failed whose row has figures all the same, from the other runs; one line per run.

    A row of which all runs failed is a failure itself, and is not listed here.
    """
    methods_of: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        for run in (row.model_extra or {}).get("runs", ()) if row.failure is None else ():
            if run.get("failure") is not None:
                methods_of.setdefault((str(run["run"]), str(run["failure"])), []).append(row.method)
    return [f"{', '.join(methods)}, {run}: {failure}" for (run, failure), methods in methods_of.items()]


def _success(row: Row) -> str:
    if row.localization is None or row.localization.success is None:
        return NONE
    return "yes" if row.localization.success else "NO"


MAPPING_COLUMNS = (
    Column("Method", _method),
    Column("CPU (%)", lambda row: _figure(row.cpu_percent)),
    Column("Map (MB)", _map_size),
    Column("Peak RSS (MB)", lambda row: NONE if row.peak_rss_bytes is None else f"{row.peak_rss_bytes / MEGABYTE:.0f}"),
    Column("Frames", lambda row: _count(row.camera_frames)),
    Column("Keyframes", lambda row: _count(row.keyframes)),
    Column("Vertices", lambda row: _count(row.vertices)),
    Column("Edges", lambda row: _count(row.edges)),
    Column("APE (m)", lambda row: _placed(row, _figure)),
    Column("APE SE(2) (m)", lambda row: _mean(row.ape_se2)),
    Column("APE Sim(2) (m)", lambda row: _mean(row.ape_sim2)),
    Column("APE median / p95 / max", lambda row: _spread(row.ape)),
    Column("APE of the runs", _runs),
    Column("RPE (m)", lambda row: _mean(row.rpe)),
    Column("RPE 20 m (m)", lambda row: _mean(row.rpe_20m)),
    Column("Latency (ms)", _latency),
    Column("Places right (%)", lambda row: NONE if row.places is None else _percent(row.places.best_is_right)),
    Column("Places recalled (%)", lambda row: NONE if row.places is None else _percent(row.places.recall)),
    Column("Covered (%)", _covered),
)

LOCALIZATION_COLUMNS = (
    Column("Method", _method),
    Column("Success", _success),
    Column("Error (m)", lambda row: _localization(row, _figure, "error_mean_m")),
    Column("Error p95 (m)", lambda row: _localization(row, _figure, "error_p95_m")),
    Column("First fix (s driven)", lambda row: _localization(row, lambda value: _figure(value, 1), "initial_drive_s")),
    Column("First fix (m driven)", lambda row: _localization(row, lambda value: _figure(value, 1), "initial_distance_m")),
    Column("CPU of the first fix (ms)", lambda row: _localization(row, _figure, "initial_time_ms")),
    Column("Localized (%)", lambda row: _localization(row, _percent, "localized_share")),
    Column("False fixes", lambda row: _localization(row, _count, "false_fixes")),
)


def _percent(share: float | None) -> str:
    return NONE if share is None else f"{100.0 * share:.1f}"


def table_one_markdown(results: Results, quoted: Sequence[Row] = ()) -> str:
    """Per scenario, the mapping table (the paper's Table I) and the localization table, with all definitions below.

    Args:
        results: The results.
        quoted: Rows of the paper, which stand below ours in each table.
    """
    return "\n".join(_scenario_markdown(scenario, quoted) for scenario in results.scenarios)


def _short(value: float | None) -> str:
    """A number with three digits, as a terminal is narrow."""
    if value is None:
        return NONE
    return f"{value:.{2 if value < 10.0 else 1 if value < 100.0 else 0}f}"


TERMINAL_COLUMNS = (  # they fit 80 characters; table1.md has the rest
    Column("CPU %", lambda row: _short(row.cpu_percent)),
    Column("MB", lambda row: NONE if row.map_bytes is None else _short(row.map_bytes / MEGABYTE)),
    Column("APE m", lambda row: _placed(row, _short)),
    Column("worst", lambda row: NONE if row.ape is None else _short(row.ape.max_m)),
    Column("RPE m", lambda row: NONE if row.rpe is None else _short(row.rpe.mean_m)),
    Column("Sim2", lambda row: NONE if row.ape_sim2 is None else _short(row.ape_sim2.mean_m)),
    Column("loc m", lambda row: _localization(row, _short, "error_mean_m")),
    Column("fix m", lambda row: _localization(row, _short, "initial_distance_m")),
    Column("false", lambda row: _localization(row, _count, "false_fixes")),
)
TERMINAL_NOTE = (
    "Means over the vertices: APE as the map lies, its worst; RPE between consecutive vertices; Sim2, APE after the best "
    "similarity fit. Second drive: loc, its error once localized; fix, metres driven until then; false, confident fixes over "
    "20 m off."
)


def print_table_one(results: Results, quoted: Sequence[Row], console: Console) -> None:
    """Print a narrow table per scenario with its failures below, and one of the paper's rows."""
    for scenario in results.scenarios:
        console.print(_terminal_table(scenario_title(scenario), scenario.rows))
        for row in scenario.rows:
            for line in _complaints(row):
                console.print(line, markup=False, style="red", highlight=False)
        for line in unscored_notes(scenario.rows):
            console.print(line, markup=False, highlight=False)
        if (note := aligned_note(scenario.rows)) is not None:
            console.print(note, markup=False, highlight=False)
    if quoted:
        console.print(_terminal_table(f"the paper {QUOTED_MARK}", quoted))
    console.print(TERMINAL_NOTE, markup=False, style="dim", highlight=False)
    if quoted:
        console.print(QUOTED_NOTE, markup=False, style="dim", highlight=False)


def _terminal_table(title: str, rows: Sequence[Row]) -> Table:
    words = Text(wrapped_title(title), style="bold")
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, title=words, title_justify="left")
    table.add_column("method", min_width=18, max_width=20)
    for column in TERMINAL_COLUMNS:
        table.add_column(column.title, justify="right", no_wrap=True, min_width=4)
    for row in rows:
        name = Text(f"{row.method} REFUSED", style="red") if row.refused else Text(row.method)
        table.add_row(name, *(column.cell(row) for column in TERMINAL_COLUMNS))
    return table


def scenario_title(scenario: ScenarioResult) -> str:
    """What was driven, in one line: the network, its length, seed and noise, the number of frames and the duration."""
    network = scenario.network
    source = network.path if network.path is not None else f"generated, {network.generator}"
    return (
        f"{scenario.name}: {source}, {network.km:.1f} km of road, seed {scenario.seed}, noise {scenario.noise}, "
        f"{scenario.frames:,} frames, {scenario.duration_s:,.0f} s"
    )


def definitions(rows: Sequence[Row]) -> list[str]:
    """What the figures in these rows mean: one line per definition, with the methods that it holds for."""
    methods_of: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        for title, field in (
            ("APE", row.ape),
            ("RPE", row.rpe),
            ("RPE 20 m", row.rpe_20m),
            ("APE SE(2)", row.ape_se2),
            ("APE Sim(2)", row.ape_sim2),
        ):
            if field is not None:
                methods_of.setdefault((title, field.definition), []).append(_method(row))
        if row.places is not None:
            methods_of.setdefault(("Places", row.places.definition), []).append(_method(row))
        if row.localization is not None:
            methods_of.setdefault(("Localization", row.localization.definition), []).append(_method(row))
    return [f"{title} ({', '.join(methods)}): {definition}" for (title, definition), methods in sorted(methods_of.items())]


def row_cells(columns: Sequence[Column], row: Row) -> list[str]:
    """What the columns say of a row; its first cell, the method's name, also says if the method failed."""
    cells = [column.cell(row) for column in columns]
    mark = " (FAILED)" if row.failure is not None else " (REFUSED)" if row.refused is not None else ""
    return [f"{cells[0]}{mark}", *cells[1:]]


def unscored_notes(rows: Sequence[Row]) -> list[str]:
    """Why errors are missing, a line for each reason, with the methods that it holds for."""
    methods_of: dict[str, list[str]] = {}
    for row in rows:
        if row.unscored is not None:
            methods_of.setdefault(row.unscored, []).append(row.method)
    return [f"not scored ({', '.join(methods)}): {reason}" for reason, methods in methods_of.items()]


def _complaints(row: Row) -> list[str]:
    """What is wrong with a row, a line each."""
    failed = [f"{row.method}: FAILED: {row.failure}"] if row.failure is not None else []
    return failed + ([f"{row.method}: REFUSED: {row.refused}"] if row.refused is not None else [])


def filled_columns(columns: Sequence[Column], rows: Sequence[Row]) -> list[Column]:
    """The columns in which at least one row has something to say."""
    return [column for column in columns if any(column.cell(row) != NONE for row in rows)]


def _scenario_markdown(scenario: ScenarioResult, quoted: Sequence[Row]) -> str:
    rows = (*scenario.rows, *quoted)
    parts = [f"## {markdown.escaped(scenario_title(scenario))}", "", *_table(MAPPING_COLUMNS, rows), ""]
    if localizing := [row for row in rows if row.localization is not None]:
        parts += ["### Localization from an unknown start", "", *_table(LOCALIZATION_COLUMNS, localizing), ""]
    lines = [line for row in rows for line in _complaints(row)]
    lines += unscored_notes(rows)
    lines += [note] if (note := aligned_note(rows)) is not None else []
    notes = [f"- {markdown.escaped(line)}" for line in (*lines, *failed_runs(rows), *definitions(rows))]
    mark = [f"- {QUOTED_NOTE}"] if any(row.quoted for row in rows) else []
    return "\n".join([*parts, *notes, *mark, ""])


def _table(columns: Sequence[Column], rows: Sequence[Row]) -> list[str]:
    columns = filled_columns(columns, rows)
    cells = ([markdown.escaped(text) for text in row_cells(columns, row)] for row in rows)
    return markdown.table([column.title for column in columns], cells, spaced=True)
