"""``hippodrome gate --power``: what the gate would catch, and what it would fail for nothing, on the baseline's own figures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Final, TypeAlias

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from hippodrome.eval.gate.baseline import Baseline, BaselineRow, Figure
from hippodrome.eval.gate.compare import compare

REPEATS: Final = 100  # repeats of each trial: its share of failed builds is then known to 5 %
PLANTED: Final = (0.0, 0.05, 0.10, 0.20, 0.50)  # share by which the error is made worse
# Standard deviation of ln(error) from one harmless change to another: none, another processor's rounding, a reordered search.
SHAKEN: Final = (0.0, 0.01, 0.03, 0.10)
TARGET: Final = "APE mean (m)"  # the figure that is made worse
FigureChange: TypeAlias = Callable[[BaselineRow, str, float], float]  # new value of a row's figure, from its name and value


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


def shake(baseline: Baseline, change: FigureChange) -> Baseline:
    """The baseline with each figure of each row replaced by what ``change`` answers to it."""
    return Baseline(cells=tuple(cell.model_copy(update={"figures": _changed(cell, change)}) for cell in baseline.cells))


def print_power(baseline: Baseline, method: str, console: Console) -> None:
    """A table: noise down, planted regression across, share of builds that fail inside."""
    trials = {(trial.shaken, trial.planted): trial.failed for trial in power_of(baseline, method)}
    pairs = sum(cell.method == method for cell in baseline.cells)
    table = Table(title=f"share of builds that fail; {method}, {pairs} pairs", title_justify="left", box=box.SIMPLE_HEAD)
    table.add_column("figures shaken by")
    for planted in PLANTED:
        table.add_column(f"APE +{planted:.0%}" if planted else "no worse", justify="right")
    for shaken in SHAKEN:
        table.add_row(f"{shaken:.0%}", *(f"{trials[shaken, planted]:.0%}" for planted in PLANTED))
    console.print(table)


def _failed_share(baseline: Baseline, method: str, planted: float, shaken: float, repeats: int) -> float:
    """Share of the repeats in which the gate fails the baseline made worse and shaken, held against itself."""
    if shaken == 0.0:
        repeats = 1  # nothing differs from one repeat to the next
    failed = 0
    for repeat in range(repeats):
        rng = np.random.default_rng([repeat, round(1e3 * shaken)])
        failed += not compare(shake(baseline, _regression(rng, method, planted, shaken)), baseline).passed
    return failed / repeats


def _regression(rng: np.random.Generator, method: str, planted: float, shaken: float) -> FigureChange:
    """A change that makes one figure of one method worse and shakes all figures at random."""

    def change(cell: BaselineRow, name: str, value: float) -> float:
        factor = 1.0 + planted if cell.method == method and name == TARGET else 1.0
        return float(value * factor * np.exp(shaken * rng.standard_normal()))

    return change


def _changed(cell: BaselineRow, change: FigureChange) -> dict[str, Figure]:
    return {name: figure.model_copy(update={"value": change(cell, name, figure.value)}) for name, figure in cell.figures.items()}
