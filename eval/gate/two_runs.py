"""``hippodrome compare A B``: two results side by side, figure by figure. No test and no verdict: those are the gate's."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.table import Table

from hippodrome.eval.gate.baseline import GateError, baseline_of
from hippodrome.eval.gate.compare import MOVED, lost_cells, require_comparable
from hippodrome.eval.report.markup import Child, element
from hippodrome.eval.report.versus import write_versus
from hippodrome.eval.results.model import Results, read_results

HEADS: Final = ("scenario", "seed", "method", "figure", "before", "after", "change")


@dataclass(frozen=True, slots=True)
class Difference:
    """One figure of one method on one scenario in both runs."""

    scenario: str
    seed: int
    method: str
    figure: str
    before: float
    after: float

    @property
    def share(self) -> float:
        """The change as a share of the first value; infinite where that was zero and the second is not."""
        if self.before == 0.0:
            return 0.0 if self.after == 0.0 else float("inf")
        return self.after / self.before - 1.0


def differences(before: Results, after: Results) -> list[Difference]:
    """Every figure that both runs have, in the order of scenarios, seeds and methods.

    Raises GateError if they hold different scenarios, drives or definitions.
    """
    then, now = ({cell.key: cell for cell in baseline_of([one]).cells} for one in (before, after))
    try:
        require_comparable(now, then)
    except GateError as error:  # whose cures are the gate's: there is no baseline here
        said = str(error).partition(";")[0].replace("the run", "the second run").replace("the baseline", "the first run")
        raise GateError(f"{said}; compare runs of the same scenarios and seeds") from None
    return [
        Difference(*key, name, then[key].figures[name].value, figure.value)
        for key, cell in now.items()
        for name, figure in cell.figures.items()
        if name in then[key].figures
    ]


def compare_folders(before: Path, after: Path, console: Console, page: Path | None = None) -> None:
    """Print what moved between two result folders, and what was lost or found outright; ``page`` is written, too, if given.

    Raises HippodromeError if they do not compare, or if a file cannot be read.
    """
    old, new = (read_results(folder / "results.json") for folder in (before, after))
    found = differences(old, new)
    moved = [one for one in found if abs(one.share) > MOVED]
    if moved:
        console.print(_table(moved))
    then, now = ({cell.key: cell for cell in baseline_of([one]).cells} for one in (old, new))
    lost = [*lost_cells(now, then), *(f"{line}, in {before}" for line in lost_cells(then, now))]
    for line in lost:
        console.print(line, markup=False, highlight=False)
    console.print(f"{len(moved)} figure(s) moved, {len(found) - len(moved)} stand still", markup=False, highlight=False)
    if page is not None:
        names = [one.name for one in new.scenarios]
        write_versus(page, (before, after), names, HEADS, [_toned(one) for one in moved], lost)
        console.print(f"page: {page}", soft_wrap=True)


def _table(moved: list[Difference]) -> Table:
    table = Table()
    for head in HEADS:
        table.add_column(head, justify="right" if head in ("seed", "before", "after", "change") else "left")
    for one in moved:
        table.add_row(*_cells(one), style="green" if one.share < 0.0 else "red")
    return table


def _cells(one: Difference) -> list[str]:
    """The cells below ``HEADS``."""
    figures = (f"{one.before:.3g}", f"{one.after:.3g}", f"{100.0 * one.share:+.1f} %")
    return [one.scenario, str(one.seed), one.method, one.figure, *figures]


def _toned(one: Difference) -> list[Child]:
    """The same, the change in the colour of better or worse."""
    *cells, change = _cells(one)
    return [*cells, element("span", change, class_="good" if one.share < 0.0 else "bad")]
