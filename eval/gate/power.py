"""``hippodrome gate --power``: what the gate would catch, and what it would fail for nothing, on the baseline's own figures."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from hippodrome.eval.gate.baseline import Baseline, BaselineRow, GateError
from hippodrome.eval.gate.compare import compare
from hippodrome.eval.gate.plants import OUTCOMES, FigureChange, outcomes, shake, shuffled, single_town, uneven

REPEATS: Final = 100  # repeats of each trial: its share of failed builds is then known to 5 %
PLANTED: Final = (0.0, 0.05, 0.10, 0.20, 0.50)  # share by which the error is made worse
# Standard deviation of ln(error) from one harmless change to another: none, another processor's rounding, a reordered search.
SHAKEN: Final = (0.0, 0.01, 0.03, 0.10)
TARGET: Final = "APE mean (m)"  # the figure that is made worse


@dataclass(frozen=True, slots=True)
class Trial:
    """How often the gate failed a change that shakes all figures and makes one figure of one method worse."""

    planted: float  # share by which the figure's error is made worse
    shaken: float  # standard deviation of ln(error) by which all figures are shaken
    failed: float  # share of the repeats in which the gate failed


def power_of(baseline: Baseline, method: str, repeats: int = REPEATS) -> list[Trial]:
    """One trial for each size of regression and of noise; the same baseline gives the same shares."""
    return [
        Trial(planted, shaken, _failed_share(baseline, method, planted, shaken, repeats))
        for shaken, planted in product(SHAKEN, PLANTED)
    ]


def print_power(baseline: Baseline, method: str, console: Console) -> None:
    """Two tables: regressions that are even over the pairs, by their size and the noise; and others, by their kind.

    Raises GateError if the baseline has no such method.
    """
    if method not in (methods := {cell.method for cell in baseline.cells}):
        raise GateError(f"the baseline has no method '{method}'; it has: {', '.join(sorted(methods)) or 'none'}")
    if not any(TARGET in cell.figures for cell in baseline.cells if cell.method == method):
        raise GateError(f"'{method}' has no {TARGET} in the baseline, in which regressions are planted; name a method that maps")
    trials = {(trial.shaken, trial.planted): trial.failed for trial in power_of(baseline, method)}
    pairs = sum(cell.method == method for cell in baseline.cells)
    table = Table(title=f"share of builds that fail; {method}, {pairs} pairs", title_justify="left", box=box.SIMPLE_HEAD)
    table.add_column("figures shaken by")
    for planted in PLANTED:
        table.add_column(f"APE +{planted:.0%}" if planted else "no worse", justify="right")
    for shaken in SHAKEN:
        table.add_row(f"{shaken:.0%}", *(f"{trials[shaken, planted]:.0%}" for planted in PLANTED))
    console.print(table)
    console.print(_uneven_table(baseline, method))


def _uneven_table(baseline: Baseline, method: str) -> Table:
    table = Table(title="changes of the APE that are not even over the pairs", title_justify="left", box=box.SIMPLE_HEAD)
    for head in ("planted", *OUTCOMES):
        table.add_column(head, justify="left" if head == "planted" else "right")
    for plant in (uneven(0.10), uneven(0.20), uneven(0.50), single_town(0.25), single_town(0.50), shuffled()):
        found = outcomes(baseline, method, plant, range(REPEATS), (TARGET,))
        table.add_row(plant.words, *(f"{found[outcome] / REPEATS:.0%}" for outcome in OUTCOMES))
    return table


def _failed_share(baseline: Baseline, method: str, planted: float, shaken: float, repeats: int) -> float:
    """Share of the repeats in which the gate fails the baseline made worse and shaken, held against itself."""
    if shaken == 0.0:
        repeats = 1  # nothing differs from one repeat to the next
    failed = 0
    for repeat in range(repeats):
        rng = np.random.default_rng([repeat, round(1e3 * shaken)])
        failed += compare(shake(baseline, _regression(rng, method, planted, shaken)), baseline).failed
    return failed / repeats


def _regression(rng: np.random.Generator, method: str, planted: float, shaken: float) -> FigureChange:
    """A change that makes one figure of one method worse and shakes all figures at random."""

    def change(cell: BaselineRow, name: str, value: float) -> float:
        factor = 1.0 + planted if cell.method == method and name == TARGET else 1.0
        return float(value * factor * np.exp(shaken * rng.standard_normal()))

    return change
