"""``hippodrome gate --study``: how often the gate errs, over many planted changes of each kind and several numbers of pairs."""

from __future__ import annotations

from itertools import product
from typing import Final

from hippodrome.eval.gate.baseline import Baseline, BaselineRow, Figure
from hippodrome.eval.gate.plants import OUTCOMES, Plant, even, nothing, outcomes, shuffled, single_town, uneven
from hippodrome.eval.results.markdown import table

CHANGES: Final = 200  # of each kind; a share is then known to 2 % where errors are rare
TOWNS: Final = 3
SEEDS_A_TOWN: Final = (1, 2, 4)  # 3, 6 and 12 pairs
METHOD: Final = "topometric"
# Typical errors in metres; their ratios alone matter. Each figure of the method draws a change of its own.
FIGURES_M: Final = {"APE mean (m)": 0.3, "RPE mean (m)": 0.1, "localization error mean (m)": 0.5}


def plants() -> tuple[Plant, ...]:
    """The kinds of change that are planted."""
    return (nothing(), shuffled(), even(0.05), even(0.10), even(0.25), uneven(0.10), uneven(0.25), single_town(0.25))


def study_markdown(changes: int = CHANGES) -> str:
    """A table in Markdown: kinds down, pairs across, and in each cell the shares that failed / could not be told / passed."""
    heads = ("planted in each figure", *(f"{TOWNS * seeds} pairs" for seeds in SEEDS_A_TOWN), "errs where it")
    rows = [
        (plant.words, *(_shares(plant, seeds, changes) for seeds in SEEDS_A_TOWN), "passes" if plant.harmful else "fails")
        for plant in plants()
    ]
    head = f"{changes} changes of each kind; in per cent: fails / cannot tell / passes"
    return "\n".join([head, "", *table(heads, rows, align="left")])


def study_baseline(seeds: int) -> Baseline:
    """Figures of ``TOWNS`` towns with that many seeds each."""
    figures = {name: Figure(value=value, definition=name) for name, value in FIGURES_M.items()}
    return Baseline(cells=tuple(
        BaselineRow(scenario=f"town {town}", seed=seed, question="study", method=METHOD, failed=False, localized=True,
                    figures=figures)
        for town, seed in product(range(1, TOWNS + 1), range(1, seeds + 1))
    ))  # fmt: skip


def _shares(plant: Plant, seeds: int, changes: int) -> str:
    found = outcomes(study_baseline(seeds), METHOD, plant, range(changes))
    return " / ".join(f"{100.0 * found[outcome] / changes:.3g}" for outcome in OUTCOMES)
