"""Whether a run is worse than the baseline: a paired test over scenarios and seeds, figure by figure."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np
from scipy.stats import t as student_t

from hippodrome.eval.gate.baseline import Baseline, BaselineRow, GateError

ALPHA: Final = 0.01  # chance of failing a build that is no worse, over all figures together: one in a hundred pull requests
TOLERANCE: Final = 0.03  # a mean change below this is not worth anybody's morning, however certain
REPEATABILITY: Final = 0.01  # least standard deviation of a pair's ratio: other processors and drivers round differently
FLOOR_M: Final = 0.01  # errors below a centimetre count as one: their ratios mean nothing
MIN_PAIRS: Final = 3  # fewer say nothing about chance
# A single pair whose error grows by this factor and by this length fails by itself, for one outlier widens the test's own error
# bar. A doubled error below this length is still inside the lane.
JUMP_RATIO: Final = 2.0
JUMP_M: Final = 0.5

Key: TypeAlias = tuple[str, int, str]  # scenario, seed, method
Pair: TypeAlias = tuple[str, float, float]  # scenario and seed in words, error before, error after


@dataclass(frozen=True, slots=True)
class Change:
    """One figure of one method, over all pairs of a run's row and the baseline's row of the same scenario and seed."""

    method: str
    figure: str
    pairs: int
    before: float  # geometric mean over the pairs, in the baseline
    after: float  # geometric mean over the pairs, in the run
    moved: bool  # whether any pair differs at all
    p_worse: float  # probability of a change at least this bad by chance, corrected for the number of figures that moved
    regressed: bool  # whether it fails the build
    worst: str  # the pair that changed most for the worse, in words

    @property
    def ratio(self) -> float:
        return self.after / self.before


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the comparison of a run with a baseline came to."""

    changes: tuple[Change, ...]
    lost: tuple[str, ...]  # rows that fail now, drives that are no longer localized, single errors that more than doubled

    @property
    def passed(self) -> bool:
        return not self.lost and not any(change.regressed for change in self.changes)


def compare(run: Baseline, baseline: Baseline) -> Verdict:
    """Hold a run against a baseline. Raises GateError if they do not measure the same things."""
    now, then = ({cell.key: cell for cell in one.cells} for one in (run, baseline))
    require_comparable(now, then)
    tests = [_test(method, figure, pairs) for (method, figure), pairs in _pairs(now, then).items()]
    changes = _judged(tests)
    proven = {(change.method, change.figure) for change in changes if change.regressed}
    return Verdict(tuple(changes), (*lost_cells(now, then), *_jumps(now, then, proven)))


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


def _pairs(now: Mapping[Key, BaselineRow], then: Mapping[Key, BaselineRow]) -> dict[tuple[str, str], list[Pair]]:
    """The pairs of each method and figure: one for every scenario and seed in which both have the figure."""
    pairs: dict[tuple[str, str], list[Pair]] = {}
    for (scenario, seed, method), cell in sorted(now.items()):
        before = then[scenario, seed, method].figures
        for name in sorted(set(cell.figures) & set(before)):
            old_m, new_m = (max(figures[name].value, FLOOR_M) for figures in (before, cell.figures))
            pairs.setdefault((method, name), []).append((f"{scenario}, seed {seed}", old_m, new_m))
    return pairs


def _test(method: str, figure: str, pairs: Sequence[Pair]) -> Change:
    """One figure's change by a one-sided paired t-test. The verdict on it needs all figures, see ``_judged``.

    The test is on the logarithms of the ratios: what counts is the change in per cent, for small errors as for large ones.
    """
    if len(pairs) < MIN_PAIRS:
        raise GateError(f"'{method}', {figure}: {len(pairs)} pair(s), the test needs {MIN_PAIRS}; give more seeds or scenarios")
    before, after = (np.array([pair[side] for pair in pairs]) for side in (1, 2))
    ratios = np.log(after / before)
    error = max(float(ratios.std(ddof=1)), REPEATABILITY) / np.sqrt(len(ratios))
    p_worse = float(student_t.sf(ratios.mean() / error, len(ratios) - 1))
    worst = pairs[int(np.argmax(ratios))]
    return Change(
        method, figure, len(pairs), float(np.exp(np.log(before).mean())), float(np.exp(np.log(after).mean())),
        bool(np.any(ratios != 0.0)), p_worse, False, f"{worst[0]}: {worst[1]:.3g} to {worst[2]:.3g}",
    )  # fmt: skip


def _judged(tests: Sequence[Change]) -> list[Change]:
    """The changes, in the order given, with Holm's correction for the number of figures that moved, and the verdict on each.

    Runs are deterministic: a figure that the change does not reach stays the same to the last digit, and is no chance to err.
    """
    order = sorted((i for i, test in enumerate(tests) if test.moved), key=lambda i: tests[i].p_worse)
    corrected, running = [1.0] * len(tests), 0.0
    for rank, i in enumerate(order):
        running = max(running, min(1.0, (len(order) - rank) * tests[i].p_worse))
        corrected[i] = running
    return [
        replace(test, p_worse=p_worse, regressed=bool(p_worse < ALPHA and test.ratio > 1.0 + TOLERANCE))
        for test, p_worse in zip(tests, corrected, strict=True)
    ]


def lost_cells(now: Mapping[Key, BaselineRow], then: Mapping[Key, BaselineRow]) -> list[str]:
    """What no mean shows, in words: rows that fail now and did not, drives that were localized and are not."""
    lost = []
    for key in sorted(now):
        if now[key].failed and not then[key].failed:
            lost.append(f"{_place(key)}: fails now")
        if then[key].localized and not now[key].localized:
            lost.append(f"{_place(key)}: no longer localized")
    return lost


def _jumps(now: Mapping[Key, BaselineRow], then: Mapping[Key, BaselineRow], proven: Collection[tuple[str, str]]) -> list[str]:
    """Single figures that are so much worse that no mean is needed, in words.

    ``proven``: methods and figures whose mean fails anyway, which are not told twice.
    """
    pairs = [(key, name, then[key].figures[name].value, figure.value) for key in sorted(now)
             for name, figure in sorted(now[key].figures.items()) if name in then[key].figures]  # fmt: skip
    return [
        f"{_place(key)}: {name} was {old_m:.3g} and is {new_m:.3g}"
        for key, name, old_m, new_m in pairs
        if (key[2], name) not in proven and new_m > JUMP_RATIO * old_m and new_m - old_m > JUMP_M
    ]
