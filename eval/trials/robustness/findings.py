"""All that a robustness trial found, as results and as plain data: of one town, or of several side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hippodrome.eval.trials.robustness.kidnapping import Kidnapping, kidnapping_summary
from hippodrome.eval.trials.robustness.paper_lengths import PaperSequence, paper_record, paper_summary
from hippodrome.eval.trials.robustness.recall import PlaceResult, side_by_side
from hippodrome.eval.trials.robustness.sequences import ELSEWHERE, MAIN_MODE, ConditionResult, pooled
from hippodrome.eval.trials.robustness.targets import Target, targets


@dataclass(frozen=True, slots=True)
class Failure:
    """A sequence of the main mode that has to be looked at."""

    condition: str
    start: int  # number of the unknown start, from 1
    false_fixes: int  # 0: it was not localized in time

    @property
    def options(self) -> str:
        """The options of ``hippodrome robustness`` that run this sequence alone."""
        return f"--conditions {self.condition} --start {self.start}"


@dataclass(frozen=True, slots=True, eq=False)
class Findings:
    """All that one run of the command found in one town."""

    results: Sequence[ConditionResult]  # by mode, then by condition; then the coupled mode's in another town; then other methods'
    places: Sequence[PlaceResult]  # by condition
    kidnapped: dict[str, tuple[Kidnapping, ...]]  # by condition
    paper: tuple[PaperSequence, ...]
    map_bytes: int  # size of the map's file
    views: int  # distinct views in the map
    failed: dict[str, str] = field(default_factory=dict)  # labels of methods beside ours that failed, and why

    @property
    def bytes_per_view(self) -> float:
        return self.map_bytes / self.views

    @property
    def conditions(self) -> list[ConditionResult]:
        """The main mode's results in the mapped town."""
        return [result for result in self.results if result.mode == MAIN_MODE and result.name != ELSEWHERE]

    @property
    def table(self) -> list[ConditionResult]:
        """The rows of the first table: the main mode's results in the mapped town, then those in another town."""
        return [*self.conditions, *(one for one in self.results if one.name == ELSEWHERE and one.mode == MAIN_MODE)]

    def of(self, other: ConditionResult) -> ConditionResult:
        """The result of the same mode or method under the same condition."""
        return next(one for one in self.results if (one.mode, one.name) == (other.mode, other.name))

    def summary(self) -> dict[str, Any]:
        """Every figure as plain data."""
        kidnappings = [one for found in self.kidnapped.values() for one in found]
        return {
            "conditions": [result.record() for result in self.results],
            "places": [result.summary() for result in self.places],
            "kidnapping": {name: kidnapping_summary(found) for name, found in self.kidnapped.items()},
            "kidnapping_all": kidnapping_summary(kidnappings),
            "paper_lengths": {**paper_summary(self.paper), "sequences_run": [paper_record(one) for one in self.paper]},
            "bytes_per_view": self.bytes_per_view,
            **({"failed_methods": self.failed} if self.failed else {}),
            "timings": {"step_ms": self._median("step_ms"), "look_ms": self._median("query_step_ms")},
        }

    def targets(self) -> list[Target]:
        """The figures against their targets. A declaration in another town counts as a false fix too."""
        data = self.summary()
        everywhere = [result.summary() for result in self.results if result.mode == MAIN_MODE]
        mapped = pooled([one for result in self.conditions for one in result.sequences])
        measured = {**data["timings"], "bytes_per_view": self.bytes_per_view}
        return targets(mapped, everywhere, data["places"], data["paper_lengths"], data["kidnapping_all"], measured)

    def failures(self) -> list[Failure]:
        """Every failed sequence of the main mode."""
        return [
            Failure(result.name, one.number, one.false_fixes)
            for result in self.results
            if result.mode == MAIN_MODE
            for one in result.failures
        ]

    def _median(self, field: str) -> float:
        """Median over the main mode's sequences in the mapped town."""
        return float(np.median([getattr(one, field) for result in self.conditions for one in result.sequences]))


def merged(towns: Sequence[Findings]) -> Findings:
    """The findings of several towns under the same conditions as one: sequences, queries and jumps of all, side by side."""
    first = towns[0]
    in_all = set.intersection(*({(one.mode, one.name) for one in town.results} for town in towns))  # a method may fail in one
    results = [
        ConditionResult(one.name, tuple(part for town in towns for part in town.of(one).sequences), one.mode)
        for one in first.results
        if (one.mode, one.name) in in_all
    ]
    failed = {f"{label}, town {number}": why for number, town in enumerate(towns, 1) for label, why in town.failed.items()}
    places = [side_by_side([town.places[i] for town in towns]) for i in range(len(first.places))]
    kidnapped = {name: tuple(jump for town in towns for jump in town.kidnapped[name]) for name in first.kidnapped}
    paper = tuple(sequence for town in towns for sequence in town.paper)
    map_bytes, views = sum(town.map_bytes for town in towns), sum(town.views for town in towns)
    return Findings(results, places, kidnapped, paper, map_bytes, views, failed)
