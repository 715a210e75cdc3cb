"""Changes planted in the figures of a baseline, to learn what the gate makes of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from hippodrome.eval.gate.baseline import Baseline, BaselineRow, Figure
from hippodrome.eval.gate.compare import compare
from hippodrome.eval.gate.report import outcome_of

OUTCOMES: Final = ("failed", "cannot tell", "passed")
JITTER: Final = 0.01  # standard deviation by which an even change differs from pair to pair, in ln(error)
SHUFFLED: Final = (0.01, 0.25)  # share by which a change of no mean effect moves a figure of a pair, up or down
FigureChange: TypeAlias = Callable[[BaselineRow, str, float], float]  # new value of a row's figure, from its name and value
Draw: TypeAlias = Callable[[np.random.Generator, Baseline], dict[tuple[str, int], float]]  # factor of each scenario and seed


@dataclass(frozen=True, slots=True)
class Plant:
    """A kind of change to one method's figures; each figure of the method draws its own factors."""

    words: str
    harmful: bool  # whether it makes the figures worse on the mean; what passes is then a miss, else what fails a false alarm
    draw: Draw


def drives_of(baseline: Baseline) -> list[tuple[str, int]]:
    """The pairs of a scenario and a seed that the baseline holds, sorted."""
    return sorted({(cell.scenario, cell.seed) for cell in baseline.cells})


def even(share: float, jitter: float = JITTER) -> Plant:
    """Every pair becomes worse by the same share, but for a little jitter."""

    def draw(rng: np.random.Generator, baseline: Baseline) -> dict[tuple[str, int], float]:
        return {drive: (1.0 + share) * float(np.exp(jitter * rng.standard_normal())) for drive in drives_of(baseline)}

    return Plant(f"even: {share:+.0%} in every pair", True, draw)


def uneven(share: float) -> Plant:
    """Every pair becomes worse, between not at all and twice the share."""

    def draw(rng: np.random.Generator, baseline: Baseline) -> dict[tuple[str, int], float]:
        return {drive: 1.0 + float(rng.uniform(0.0, 2.0 * share)) for drive in drives_of(baseline)}

    return Plant(f"uneven: 0 to {2.0 * share:+.0%}", True, draw)


def single_town(share: float) -> Plant:
    """One scenario drawn at random becomes worse in all its seeds, nothing else changes. Of a single scenario, one seed does."""

    def draw(rng: np.random.Generator, baseline: Baseline) -> dict[tuple[str, int], float]:
        drives = drives_of(baseline)
        side = 0 if len({scenario for scenario, _ in drives}) > 1 else 1
        struck = drives[int(rng.integers(len(drives)))][side]
        return {drive: 1.0 + share * (drive[side] == struck) for drive in drives}

    return Plant(f"single town: {share:+.0%} in one alone", True, draw)


def shuffled() -> Plant:
    """Every pair becomes better or worse by the toss of a coin: the spread grows, the mean stays."""

    def draw(rng: np.random.Generator, baseline: Baseline) -> dict[tuple[str, int], float]:
        return {drive: 1.0 + float(rng.choice((-1.0, 1.0)) * rng.uniform(*SHUFFLED)) for drive in drives_of(baseline)}

    return Plant(f"variance only: up to {SHUFFLED[1]:.0%}, up or down in each pair", False, draw)


def nothing() -> Plant:
    """The same code once more."""
    return Plant("same code", False, lambda _, baseline: dict.fromkeys(drives_of(baseline), 1.0))


def outcomes(
    baseline: Baseline, method: str, plant: Plant, repeats: Iterable[int], figures: tuple[str, ...] = ()
) -> Counter[str]:
    """How often the gate answered what, over as many planted changes as ``repeats`` has seeds.

    Args:
        baseline: The figures that the changes are planted in, and which they are held against.
        method: The method whose figures change.
        plant: The kind of change.
        repeats: Seeds of the random draws.
        figures: The figures that change; empty for all that the method has.
    """
    found: Counter[str] = Counter()
    for repeat in repeats:
        changed = shake(baseline, _planted(np.random.default_rng(repeat), baseline, method, plant, figures))
        found[outcome_of(compare(changed, baseline), ())] += 1
    return found


def shake(baseline: Baseline, change: FigureChange) -> Baseline:
    """The baseline with each figure of each row replaced by what ``change`` answers to it."""
    return Baseline(cells=tuple(cell.model_copy(update={"figures": _changed(cell, change)}) for cell in baseline.cells))


def _planted(rng: np.random.Generator, baseline: Baseline, method: str, plant: Plant, figures: tuple[str, ...]) -> FigureChange:
    names = figures or sorted({name for cell in baseline.cells if cell.method == method for name in cell.figures})
    factors = {name: plant.draw(rng, baseline) for name in names}

    def change(cell: BaselineRow, name: str, value: float) -> float:
        return value * factors[name][cell.scenario, cell.seed] if cell.method == method and name in factors else value

    return change


def _changed(cell: BaselineRow, change: FigureChange) -> dict[str, Figure]:
    return {name: figure.model_copy(update={"value": change(cell, name, figure.value)}) for name, figure in cell.figures.items()}
