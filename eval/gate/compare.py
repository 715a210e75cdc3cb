"""Whether a run is worse than the baseline: a paired test over scenarios and seeds, figure by figure.

There are three answers: it is worse, it is not, and the pairs do not tell. ``statistics.py`` has the arithmetic and its reasons.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.eval.gate.baseline import Baseline, BaselineRow, GateError
from hippodrome.eval.gate.statistics import ALPHA, MIN_PAIRS, corrected, effect_of, pairs_needed

TOLERANCE: Final = 0.03  # a mean change below this is not worth anybody's morning, however certain
MOVED: Final = 0.005  # a figure none of whose pairs changes by more than this share stands still: it was rounded otherwise
TOWN_NOTICED: Final = (
    0.15  # a town that becomes worse by more than this share is not passed in silence, whatever the other towns do
)
# A single pair whose figure grows by this factor and by its unit's jump fails by itself, for one outlier widens the test's own
# error bar.
JUMP_RATIO: Final = 2.0


@dataclass(frozen=True, slots=True)
class Scale:
    """What is little and what is much in a unit.

    Args:
        floor: Smaller values count as this one: their ratios mean nothing.
        jump: A value that more than doubles and grows by more than this fails by itself.
    """

    floor: float
    jump: float


METRES: Final = Scale(0.01, 0.5)  # a doubled error below half a metre is still inside the lane
SCALES: Final = {  # by the unit in the figure's name
    "(share)": Scale(0.05, 0.5),  # of ten missions half a one; half of them is no chance any more
    "(times)": Scale(0.5, 0.5),  # one collision more where there was none is one too many
    "(per km)": Scale(0.1, 2.0),
    "(%)": Scale(0.1, 2.0),  # of the time outside of the lane
    "(ratio)": Scale(0.01, 0.5),
}

Key: TypeAlias = tuple[str, int, str]  # scenario, seed, method


@dataclass(frozen=True, slots=True)
class Pair:
    """One figure of one scenario and seed, in the baseline and in the run."""

    scenario: str
    seed: int
    before: float
    after: float

    @property
    def place(self) -> str:
        return f"{self.scenario}, seed {self.seed}"

    @property
    def log_ratio(self) -> float:
        return float(np.log(self.after / self.before))


@dataclass(frozen=True, slots=True)
class Change:
    """One figure of one method, over all pairs of a run's row and the baseline's row of the same scenario and seed."""

    method: str
    figure: str
    pairs: int
    before: float  # geometric mean over the pairs, in the baseline
    after: float  # geometric mean over the pairs, in the run
    low: float  # the true ratio of after to before lies between these in 95 cases of 100
    high: float
    moved: bool  # whether any pair differs by more than rounding
    p_worse: float  # probability of a change at least this bad by chance, corrected for the number of figures that may fail
    regressed: bool  # whether it fails the build
    undecided: str  # empty, or why the pairs do not tell whether the figure is worse, and how many would
    worst: str  # the pair that changed most for the worse, in words

    @property
    def ratio(self) -> float:
        return self.after / self.before


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the comparison of a run with a baseline came to."""

    changes: tuple[Change, ...]
    # Rows that fail now, drives that are no longer localized, figures that are gone, single errors that more than doubled, and
    # towns beyond the limit that the caller set.
    lost: tuple[str, ...]
    fresh: int = 0  # figures of the run that the baseline lacks and nothing is compared with

    @property
    def failed(self) -> bool:
        return bool(self.lost) or any(change.regressed for change in self.changes)

    @property
    def undecided(self) -> bool:
        """Whether nothing fails, and something may be worse."""
        return not self.failed and any(change.undecided for change in self.changes)

    @property
    def passed(self) -> bool:
        return not self.failed and not self.undecided


def compare(run: Baseline, baseline: Baseline, town_limit: float | None = None) -> Verdict:
    """Hold a run against a baseline.

    Args:
        run: The figures of this code.
        baseline: Those of earlier code.
        town_limit: Share by which no figure may become worse in any single town, on the mean of its seeds; None: no limit.

    Raises:
        GateError: They do not measure the same things, or hold fewer pairs than the test needs.
    """
    now, then = ({cell.key: cell for cell in one.cells} for one in (run, baseline))
    require_comparable(now, then)
    if (drives := len({key[:2] for key in then})) < MIN_PAIRS:
        raise GateError(f"{drives} pair(s) of a scenario and a seed, the test needs {MIN_PAIRS}; give more seeds or scenarios")
    found = _pairs(now, then)
    changes = _judged([_Test(method, figure, tuple(pairs)) for (method, figure), pairs in found.items()])
    proven = {(change.method, change.figure) for change in changes if change.regressed}
    lost = (*lost_cells(now, then), *_jumps(now, then, proven), *_towns_beyond(found, town_limit))
    fresh = sum(len(set(now[key].figures) - set(then[key].figures)) for key in now)
    return Verdict(tuple(changes), lost, fresh)


def require_comparable(now: Mapping[Key, BaselineRow], then: Mapping[Key, BaselineRow]) -> None:
    """Raise GateError unless both hold the same rows, and rows of the same question and the same definitions."""
    if missing := sorted(set(then) - set(now)):
        raise GateError(f"the run lacks {_place(missing[0])} of the baseline; run the same scenarios and seeds, or --update")
    if extra := sorted(set(now) - set(then)):
        raise GateError(f"the baseline lacks {_place(extra[0])} of the run; refresh it with --update")
    for key, cell in now.items():
        if cell.question != then[key].question:
            raise GateError(f"{_place(key)}: the scenario has changed since the baseline was made; refresh it with --update")
        for name in set(cell.figures) & set(then[key].figures):
            ours, theirs = cell.figures[name].definition, then[key].figures[name].definition
            if ours != theirs:
                raise GateError(f"{_place(key)}: {name} is defined as '{ours}' now and was '{theirs}'; refresh it with --update")


def _place(key: Key) -> str:
    """A row in words."""
    scenario, seed, method = key
    return f"'{scenario}', seed {seed}, '{method}'"


def scale_of(figure: str) -> Scale:
    """The scale of a figure's unit; without one that is known it is an error in metres."""
    return next((scale for unit, scale in SCALES.items() if figure.endswith(unit)), METRES)


def _pairs(now: Mapping[Key, BaselineRow], then: Mapping[Key, BaselineRow]) -> dict[tuple[str, str], list[Pair]]:
    """The pairs of each method and figure: one for every scenario and seed in which both have the figure."""
    pairs: dict[tuple[str, str], list[Pair]] = {}
    for (scenario, seed, method), cell in sorted(now.items()):
        before = then[scenario, seed, method].figures
        for name in sorted(set(cell.figures) & set(before)):
            old_m, new_m = (max(figures[name].value, scale_of(name).floor) for figures in (before, cell.figures))
            pairs.setdefault((method, name), []).append(Pair(scenario, seed, old_m, new_m))
    return pairs


@dataclass(frozen=True, slots=True)
class _Test:
    """One figure of one method before the verdict on it, which needs all figures.

    The test is on the logarithms of the ratios: what counts is the change in per cent, for small errors as for large ones.
    """

    method: str
    figure: str
    pairs: tuple[Pair, ...]

    @property
    def log_ratios(self) -> FloatArray:  # (N,)
        return np.array([pair.log_ratio for pair in self.pairs])

    @property
    def moved(self) -> bool:
        return bool(np.abs(self.log_ratios).max() > np.log1p(MOVED))

    @property
    def may_fail(self) -> bool:
        """Whether a pair changes by more than the tolerance, up or down: without one the mean cannot exceed it either."""
        return bool(np.abs(self.log_ratios).max() > np.log1p(TOLERANCE))


def _judged(tests: Sequence[_Test]) -> list[Change]:
    """The verdict on each figure, in the order given, with the correction for the number of figures that may fail.

    Runs are deterministic: a figure that the change does not reach stays the same to the last digit, and is no chance to err.
    """
    doubtful = [test for test in tests if test.may_fail]
    p_values = dict(zip(map(id, doubtful), corrected([effect_of(test.log_ratios).p_worse for test in doubtful]), strict=True))
    return [_change(test, p_values.get(id(test), 1.0), len(doubtful)) for test in tests]


def _change(test: _Test, p_worse: float, figures: int) -> Change:
    """One figure with its verdict; ``figures`` is the number of those that may fail."""
    effect, worst = effect_of(test.log_ratios), max(test.pairs, key=lambda pair: pair.log_ratio)
    regressed = test.may_fail and p_worse < ALPHA and effect.mean > np.log1p(TOLERANCE)
    before, after = (float(np.exp(np.mean([np.log(getattr(pair, side)) for pair in test.pairs]))) for side in ("before", "after"))
    return Change(
        test.method, test.figure, len(test.pairs), before, after,
        float(np.exp(effect.low)), float(np.exp(effect.high)), test.moved, p_worse, bool(regressed),
        "" if regressed or not test.may_fail else _undecided(test, effect.mean, figures),
        f"{worst.place}: {worst.before:.3g} to {worst.after:.3g}",
    )  # fmt: skip


def _undecided(test: _Test, mean: float, figures: int) -> str:
    """Why a figure whose harm is not proven may be worse all the same, and how many pairs would tell; empty if it passes."""
    if mean > np.log1p(TOLERANCE):
        needed = pairs_needed(test.log_ratios, figures)
        return f"cannot tell: {needed or 'more than 1000'} pairs needed, there are {len(test.pairs)}"
    town, ratios = max(_towns(test.pairs).items(), key=lambda item: float(np.mean(item[1])))
    if np.mean(ratios) <= np.log1p(TOWN_NOTICED):
        return ""
    share, needed = np.expm1(np.mean(ratios)), pairs_needed(ratios, figures)
    return f"cannot tell: {town} is {share:+.0%}; {needed or 'more than 1000'} pairs of it needed, there are {len(ratios)}"


def _towns(pairs: Sequence[Pair]) -> dict[str, FloatArray]:
    """The log-ratios of each scenario's pairs, an array for each."""
    names = dict.fromkeys(pair.scenario for pair in pairs)
    return {name: np.array([pair.log_ratio for pair in pairs if pair.scenario == name]) for name in names}


def _towns_beyond(found: Mapping[tuple[str, str], Sequence[Pair]], limit: float | None) -> list[str]:
    """The figures that became worse by more than ``limit`` in a town, on the mean of its seeds, in words."""
    if limit is None:
        return []
    shares = [(town, method, figure, float(np.expm1(np.mean(ratios))))
              for (method, figure), pairs in found.items() for town, ratios in _towns(pairs).items()]  # fmt: skip
    return [f"'{town}', '{method}': {figure} {share:+.1%} over its seeds, the limit for a town is {limit:+.1%}"
            for town, method, figure, share in shares if share > limit]  # fmt: skip


def lost_cells(now: Mapping[Key, BaselineRow], then: Mapping[Key, BaselineRow]) -> list[str]:
    """What no mean shows, in words: rows that fail now, drives no longer localized, figures that are no longer there."""
    lost = []
    for key in sorted(now):
        if now[key].failed and not then[key].failed:
            lost.append(f"{_place(key)}: fails now")
        if then[key].localized and not now[key].localized:
            lost.append(f"{_place(key)}: no longer localized")
        lost += [f"{_place(key)}: {name} is missing" for name in _gone(now[key], then[key])]
    return lost


def _gone(now: BaselineRow, then: BaselineRow) -> list[str]:
    """The figures that the row had and lacks, but for those that went with a loss that is told anyway."""
    if now.failed:
        return []
    unlocalized = then.localized and not now.localized
    return [
        name for name in sorted(set(then.figures) - set(now.figures)) if not (unlocalized and name.startswith("localization"))
    ]


def _jumps(now: Mapping[Key, BaselineRow], then: Mapping[Key, BaselineRow], proven: Collection[tuple[str, str]]) -> list[str]:
    """Single figures that are so much worse that no mean is needed, in words.

    ``proven``: methods and figures whose mean fails anyway, which are not told twice.
    """
    pairs = [(key, name, then[key].figures[name].value, figure.value) for key in sorted(now)
             for name, figure in sorted(now[key].figures.items()) if name in then[key].figures]  # fmt: skip
    return [
        f"{_place(key)}: {name} was {old_m:.3g} and is {new_m:.3g}"
        for key, name, old_m, new_m in pairs
        if (key[2], name) not in proven and new_m > JUMP_RATIO * old_m and new_m - old_m > scale_of(name).jump
    ]
