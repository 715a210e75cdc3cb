"""What the localizer's figures must be and what they should be, and how the figures of a run stand to that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from hippodrome.eval.trials.robustness.conditions import SAME, SUN_AND_FOG

FALSE_LIMIT: Final = 0.01  # share of all sequences that may have a false fix


@dataclass(frozen=True, slots=True)
class Target:
    """One figure, what it must be, and what it should be."""

    item: str
    value: float | None  # None: this run did not measure it
    must: float
    aim: float
    most: bool  # True: the figure has to stay below ``must`` and ``aim``; False: above
    unit: str

    @property
    def shortfall(self) -> float:
        """By how much the figure is on the wrong side of what it must be; negative on the right side."""
        assert self.value is not None
        return self.value - self.must if self.most else self.must - self.value

    @property
    def verdict(self) -> str:
        if self.value is None:
            return "not measured"
        sign = 1.0 if self.most else -1.0
        if sign * self.value <= sign * self.aim:
            return "aim reached"
        return "held" if self.shortfall <= 0.0 else "MISSED"

    @property
    def figure(self) -> str:
        return "-" if self.value is None else f"{self.value:.3g}"

    @property
    def with_unit(self) -> str:
        return self.figure if self.value is None else f"{self.figure} {self.unit}"


def targets(
    mapped: dict[str, Any], everywhere: Sequence[dict[str, Any]], places: Sequence[dict[str, Any]], paper: dict[str, Any],
    kidnapped: dict[str, Any], measured: dict[str, Any],
) -> list[Target]:  # fmt: skip
    """All targets with the figures of a run.

    Args:
        mapped: Figures pooled over all conditions in the mapped town.
        everywhere: One row for each condition, another town's among them.
        places: One row of place recognition for each condition.
        paper: Figures pooled over the paper's ten lengths.
        kidnapped: Figures pooled over all kidnappings.
        measured: ``step_ms``, ``look_ms`` and ``bytes_per_view``.
    """
    same = next((row for row in everywhere if row["condition"] == SAME), None)
    recalls = {row["condition"]: next(iter(row["recognisers"].values()))["recall"] for row in places}
    false_share = sum(row["false_sequences"] for row in everywhere) / sum(row["sequences"] for row in everywhere)
    return [
        Target("error after initial localization, same condition, paper's lengths", paper["error_mean_m"], 1.5, 0.7, True, "m"),
        Target("place recognition, recall at 99 %, same condition", _percent(recalls.get(SAME)), 90.0, 97.0, False, "%"),
        Target("place recognition, recall at 99 %, sun + fog", _percent(recalls.get(SUN_AND_FOG)), 75.0, 95.0, False, "%"),
        Target("success within 200 m, same condition", _percent(same["success_share"] if same else None), 95.0, 99.0, False, "%"),
        Target("success within 200 m, all conditions", _percent(mapped["success_share"]), 80.0, 95.0, False, "%"),
        Target("sequences with a false fix, all conditions, another town's included",
               _percent(false_share), 100 * FALSE_LIMIT, 0.0, True, "%"),
        Target("metres until localized, median of all conditions", mapped["localized_after_median_m"], 50.0, 20.0, True, "m"),
        Target("recovery after kidnapping, median of all", kidnapped["recovered_after_median_m"], 100.0, 40.0, True, "m"),
        Target("step with a look, median", measured["look_ms"], 1.0, 0.3, True, "ms"),
        Target("step, mean over all", measured["step_ms"], 1.0, 0.3, True, "ms"),
        Target("bytes per view, on disk", measured["bytes_per_view"], 2000.0, 700.0, True, "bytes"),
    ]  # fmt: skip


def worst(found: Sequence[Target]) -> Target | None:
    """The town that misses a target by most, of the same target's figures in several towns; None if no town measured it."""
    return max((one for one in found if one.value is not None), key=lambda one: one.shortfall, default=None)


def _percent(share: float | None) -> float | None:
    return None if share is None else 100.0 * share
