"""What the gate says: a short table, JUnit XML for CI systems, Markdown for a GitHub step summary."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from hippodrome.eval.gate.compare import MOVED, Change, Verdict
from hippodrome.eval.results.markdown import escaped
from hippodrome.eval.results.markdown import table as markdown_table

SHOWN = 12  # reasons shown on the terminal: who broke everything needs no list of it


def outcome_of(verdict: Verdict, limits: Sequence[str]) -> str:
    """``passed``, ``failed`` or ``cannot tell``; what fails outright leaves no doubt."""
    if verdict.failed or limits:
        return "failed"
    return "cannot tell" if verdict.undecided else "passed"


def print_verdict(verdict: Verdict, limits: Sequence[str], console: Console) -> None:
    """The figures that moved, why the build fails, and the verdict; fits a terminal of 80 columns."""
    moved = [change for change in verdict.changes if change.moved]
    if moved:
        console.print(_table(moved))
    worse = [f"{change.method}: {_why(change)}" for change in verdict.changes if change.regressed]
    lines = [*worse, *verdict.lost, *limits]
    for line in lines[:SHOWN]:
        console.print(line, style="red", markup=False, highlight=False, soft_wrap=True)
    if len(lines) > SHOWN:
        console.print(f"and {len(lines) - SHOWN} more; --junit has all", highlight=False)
    for change in [change for change in verdict.changes if change.undecided][:SHOWN]:
        console.print(f"{change.method}: {_why(change)}", style="yellow", markup=False, highlight=False, soft_wrap=True)
    still = len(verdict.changes) - len(moved)
    outcome = OUTCOMES[outcome_of(verdict, limits)]
    fresh = f", {verdict.fresh} are new and compared with nothing" if verdict.fresh else ""
    console.print(f"gate {outcome}: {len(moved)} figure(s) moved, {still} stand still{fresh}", markup=False, highlight=False)


# How the verdict is called out; the last is followed by how to come to one.
OUTCOMES = {
    "passed": "passed",
    "failed": "FAILED",
    "cannot tell": "CANNOT TELL (exit status 3): run more --seeds, with --update on the code before the change first",
}


def _table(moved: Sequence[Change]) -> Table:
    unit = "m" if all(change.figure.endswith(UNIT) for change in moved) else "m where a figure has no unit"
    table = Table(
        title=f"what moved (geometric means over the pairs, {unit})", title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False
    )
    for head in ("method", "figure", "before", "after", "change", "verdict"):
        table.add_column(head, justify="left" if head in ("method", "figure", "verdict") else "right", no_wrap=head != "verdict")
    for change in moved:
        cells = (change.method, change.figure.removesuffix(UNIT), *_cells(change)[2:5], _word(change))
        style = "red" if change.regressed else "yellow" if change.undecided else "green" if change.ratio < 1.0 else None
        table.add_row(*cells, style=style)
    return table


def _why(change: Change) -> str:
    """A regression, or why the pairs do not tell of one, in words."""
    told = f"; {change.undecided}" if change.undecided else ""
    interval = f"{_interval(change)}, p {change.p_worse:.1g}"
    unit = " m" if change.figure.endswith(UNIT) else ""
    return f"{change.figure.removesuffix(UNIT)} {_percent(change.ratio)} ({interval}); most in {change.worst}{unit}{told}"


UNIT = " mean (m)"
HEADS = ("method", "figure", "before", "after", "change", "95 % interval", "p", "verdict", "worst pair")


def summary_markdown(verdict: Verdict, limits: Sequence[str]) -> str:
    """For ``$GITHUB_STEP_SUMMARY``."""
    title = f"### Gate: {outcome_of(verdict, limits)}"
    rows = [[escaped(cell, html=True) for cell in _cells(change)] for change in by_concern(verdict.changes)]
    unsure = [f"{change.method}: {_why(change)}" for change in verdict.changes if change.undecided]
    reasons = [f"- {escaped(line, html=True)}" for line in (*verdict.lost, *limits, *unsure)]
    return "\n".join([title, "", *markdown_table(HEADS, rows, align="left"), "", *reasons]) + "\n"


def by_concern(changes: Sequence[Change]) -> list[Change]:
    """Changes that fail the gate first, then those that the pairs do not tell about; the others stay in their order."""
    return sorted(changes, key=lambda change: (not change.regressed, not change.undecided))


def junit_xml(verdict: Verdict, limits: Sequence[str]) -> bytes:
    """One test case for each figure, and one for each loss and each limit that does not hold.

    A figure that the pairs do not tell about is an error in the words of JUnit: the test came to no result.
    """
    outright = [("lost", line) for line in verdict.lost] + [("limit", line) for line in limits]
    failures = sum(change.regressed for change in verdict.changes) + len(outright)
    suite = ElementTree.Element(
        "testsuite", name="hippodrome gate", tests=str(len(verdict.changes) + len(outright)), failures=str(failures),
        errors=str(sum(bool(change.undecided) for change in verdict.changes)),
    )  # fmt: skip
    for change in verdict.changes:
        case = ElementTree.SubElement(suite, "testcase", classname=_xml(change.method), name=change.figure)
        if change.regressed:
            ElementTree.SubElement(case, "failure", message=_xml(_why(change)))
        elif change.undecided:
            ElementTree.SubElement(case, "error", message=_xml(_why(change)))
    for kind, line in outright:
        case = ElementTree.SubElement(suite, "testcase", classname=kind, name=_xml(line))
        ElementTree.SubElement(case, "failure", message=_xml(line))
    ElementTree.indent(suite)
    content: bytes = ElementTree.tostring(suite, encoding="utf-8", xml_declaration=True)
    return content + b"\n"


def _cells(change: Change) -> tuple[str, ...]:
    """The cells below ``HEADS``."""
    return (change.method, change.figure, f"{change.before:.3g}", f"{change.after:.3g}", _percent(change.ratio),
            _interval(change), f"{change.p_worse:.2g}", _word(change), change.worst)  # fmt: skip


def _word(change: Change) -> str:
    """The verdict in a word; only WORSE fails the build."""
    if change.regressed:
        return "WORSE"
    if change.undecided:
        return "cannot tell"
    if not change.moved:
        return "same"
    # A change too small to matter, in either direction, is none for the verdict.
    return "same" if abs(change.ratio - 1.0) <= MOVED else "better" if change.ratio < 1.0 else "hardly worse"


def _interval(change: Change) -> str:
    """Between which changes the true one lies, 95 times of 100."""
    if not math.isfinite(change.high):
        return "too few pairs for an interval"
    return f"{_percent(change.low)} to {_percent(change.high)}" if change.moved else "-"


def _percent(ratio: float) -> str:
    """A ratio as a change in per cent or, where it is many times over, as a factor."""
    return f"{100.0 * (ratio - 1.0):+z.1f} %" if ratio < 10.0 else f"x {ratio:.3g}"  # z: no minus before zero


def _xml(text: str) -> str:
    """Text without the control characters that XML cannot hold."""
    return "".join(character if character.isprintable() else " " for character in text)
