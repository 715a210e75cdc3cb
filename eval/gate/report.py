"""What the gate says: a short table, JUnit XML for CI systems, Markdown for a GitHub step summary."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from hippodrome.eval.gate.compare import Change, Verdict
from hippodrome.eval.results.markdown import escaped
from hippodrome.eval.results.markdown import table as markdown_table

SHOWN = 12  # reasons shown on the terminal: who broke everything needs no list of it
MOVED = 0.005  # a figure that changes by less than this share stands still


def print_verdict(verdict: Verdict, limits: Sequence[str], console: Console) -> None:
    """The figures that moved, why the build fails, and the verdict; fits a terminal of 80 columns."""
    moved = [change for change in verdict.changes if abs(change.ratio - 1.0) > MOVED]
    if moved:
        console.print(_table(moved))
    worse = [f"{change.method}: {_why(change)}" for change in verdict.changes if change.regressed]
    lines = [*worse, *verdict.lost, *limits]
    for line in lines[:SHOWN]:
        console.print(line, style="red", markup=False, highlight=False, soft_wrap=True)
    if len(lines) > SHOWN:
        console.print(f"and {len(lines) - SHOWN} more; --junit has all", highlight=False)
    still = len(verdict.changes) - len(moved)
    outcome = "passed" if verdict.passed and not limits else "FAILED"
    console.print(f"gate {outcome}: {len(moved)} figure(s) moved, {still} stand still", markup=False, highlight=False)


def _table(moved: Sequence[Change]) -> Table:
    table = Table(
        title="what moved (geometric means over the pairs, m)", title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False
    )
    for head in ("method", "figure", "before", "after", "change", "verdict"):
        table.add_column(head, justify="left" if head in ("method", "figure", "verdict") else "right", no_wrap=head != "verdict")
    for change in moved:
        cells = (change.method, change.figure.removesuffix(UNIT), *_cells(change)[2:5], _word(change))
        table.add_row(*cells, style="red" if change.regressed else "green" if change.ratio < 1.0 else None)
    return table


def _why(change: Change) -> str:
    """A regression in words."""
    return f"{change.figure.removesuffix(UNIT)} {_percent(change)} (p {change.p_worse:.1g}); most in {change.worst} m"


UNIT = " mean (m)"
HEADS = ("method", "figure", "before", "after", "change", "p", "verdict", "worst pair")


def summary_markdown(verdict: Verdict, limits: Sequence[str]) -> str:
    """For ``$GITHUB_STEP_SUMMARY``."""
    title = f"### Gate {'passed' if verdict.passed and not limits else 'failed'}"
    rows = [[escaped(cell, html=True) for cell in _cells(change)] for change in verdict.changes]
    reasons = [f"- {escaped(line, html=True)}" for line in (*verdict.lost, *limits)]
    return "\n".join([title, "", *markdown_table(HEADS, rows, align="left"), "", *reasons]) + "\n"


def junit_xml(verdict: Verdict, limits: Sequence[str]) -> bytes:
    """One test case for each figure, and one for each loss and each limit that does not hold."""
    outright = [("lost", line) for line in verdict.lost] + [("limit", line) for line in limits]
    failures = sum(change.regressed for change in verdict.changes) + len(outright)
    suite = ElementTree.Element(
        "testsuite", name="hippodrome gate", tests=str(len(verdict.changes) + len(outright)), failures=str(failures)
    )
    for change in verdict.changes:
        case = ElementTree.SubElement(suite, "testcase", classname=_xml(change.method), name=change.figure)
        if change.regressed:
            ElementTree.SubElement(case, "failure", message=_xml(_why(change)))
    for kind, line in outright:
        case = ElementTree.SubElement(suite, "testcase", classname=kind, name=_xml(line))
        ElementTree.SubElement(case, "failure", message=_xml(line))
    ElementTree.indent(suite)
    content: bytes = ElementTree.tostring(suite, encoding="utf-8", xml_declaration=True)
    return content + b"\n"


def _cells(change: Change) -> tuple[str, ...]:
    """The cells below ``HEADS``."""
    return (change.method, change.figure, f"{change.before:.3g}", f"{change.after:.3g}", _percent(change),
            f"{change.p_worse:.2g}", _word(change), change.worst)  # fmt: skip


def _word(change: Change) -> str:
    """The verdict in a word; only WORSE fails the build."""
    if change.regressed:
        return "WORSE"
    if abs(change.ratio - 1.0) <= MOVED:
        return "same"
    return "better" if change.ratio < 1.0 else "worse?"


def _percent(change: Change) -> str:
    """The change in per cent or, where it is many times over, as a factor."""
    return f"{100.0 * (change.ratio - 1.0):+.1f} %" if change.ratio < 10.0 else f"x {change.ratio:.0f}"


def _xml(text: str) -> str:
    """Text without the control characters that XML cannot hold."""
    return "".join(character if character.isprintable() else " " for character in text)
