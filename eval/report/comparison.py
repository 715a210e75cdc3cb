"""What ``hippodrome baselines`` adds to a scenario's section: ten sequences, ratios, and what each method is given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hippodrome.eval.report.markup import Html, element, joined
from hippodrome.eval.report.tables import plain_table
from hippodrome.eval.results.fairness import HEAD, fairness_rows
from hippodrome.eval.results.model import ScenarioResult
from hippodrome.eval.results.ratios import NAMES, NOT_QUOTED, times
from hippodrome.eval.results.table_two import HEAD as SEQUENCE_HEAD
from hippodrome.eval.results.table_two import QUOTED, SequenceRow, quoted_cells, sequence_cells


def sequences(rows: Sequence[SequenceRow]) -> Html | None:
    """Table II, the published rows below ours; None without rows."""
    if not rows:
        return None
    failures = [element("li", f"{row.method}, sequence {row.number}: {row.failure}") for row in rows if row.failure is not None]
    return joined(
        plain_table(SEQUENCE_HEAD, [*(sequence_cells(row) for row in rows), *quoted_cells()], "ten sequences"),
        element("ul", failures, class_="failures") if failures else None,
        element("p", QUOTED, class_="note"),
    )


def ratios(found: Mapping[str, Any]) -> Html | None:
    """The content of ``ratios.json``: ORB-SLAM3's cost over ours, or why it is not quoted; None without content."""
    if not found:
        return None
    if NOT_QUOTED in found:
        return element("p", f"Not quoted: {found[NOT_QUOTED]}", class_="note")
    rows = [[label, *(times(figures.get(name)) for name in NAMES)] for label, figures in found.items()]
    return plain_table(["ORB-SLAM3 over", *NAMES.values()], rows, "ratios")


def fairness(scenario: ScenarioResult) -> Html | None:
    """What each method of a scenario's rows is given; None if none of them is described."""
    rows = fairness_rows(reversed(scenario.rows))  # in the order of the other tables
    return plain_table(HEAD, rows, "what each method is given") if rows else None
